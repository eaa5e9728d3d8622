#include "core/rbf/h2_matrix.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/archive_types.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// The range that ProxyShell is made for; below is rounding.
constexpr double kFinestTolerance = 1e-15, kCoarsestTolerance = 1e-6;

// Part of a node's tolerance for its own: the errors of many nodes add up. With half or twice of it
// canisters of 15,666 and 21,124 centres take as many iterations; with 1 the tests pass.
constexpr double kShare = 0.3;

double node_tolerance(double accuracy, double spacing, double radius) {
  const double ratio = spacing / radius;
  return std::clamp(kShare * accuracy * ratio * ratio * ratio, kFinestTolerance,
                    kCoarsestTolerance);
}

// Each ball lies beyond the proxies of the other, which begin at radius / separation.
bool are_separated(double radius_a, double radius_b, double distance, double separation) {
  const auto [small, large] = std::minmax(radius_a, radius_b);
  return distance >= small + large / separation;
}

template <class Body>
void for_each_level(const Octree& tree, bool is_upward, const Body& body) {
  const int levels = tree.level_count();
  for (int l = 0; l < levels; ++l) {
    const int level = is_upward ? levels - 1 - l : l;
    const int first = tree.level_begin[level], last = tree.level_begin[level + 1];
    parallel_for(last - first, 1, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) body(first + static_cast<int>(i));
    });
  }
}

}  // namespace

H2Matrix::H2Matrix(const Eigen::Ref<const MatrixXd>& points, const Eigen::VectorXd& spacing,
                   H2Options options)
    : tree_(build_octree(points, options.leaf_size)),
      far_(tree_.nodes.size()),
      near_(tree_.nodes.size()) {
  find_interactions(0, 0, options.separation);
  find_skeletons(spacing, options);
}

H2Matrix::H2Matrix(InputArchive& archive) {
  archive(tree_, far_, near_, skeletons_, skeleton_begin_, skeleton_points_);
}

void H2Matrix::store(OutputArchive& archive) const {
  archive(tree_, far_, near_, skeletons_, skeleton_begin_, skeleton_points_);
}

void H2Matrix::find_interactions(int a, int b, double separation) {
  const Octree::Node &A = tree_.nodes[a], &B = tree_.nodes[b];
  if (a == b) {
    if (A.is_leaf()) near_[a].push_back(a);
    for (int i = 0; i < A.child_count; ++i)
      for (int j = i; j < A.child_count; ++j)
        find_interactions(A.first_child + i, A.first_child + j, separation);
    return;
  }
  const double distance = (A.centre - B.centre).norm();
  if (are_separated(A.radius, B.radius, distance, separation)) {
    far_[a].push_back(b);
    far_[b].push_back(a);
  } else if (A.is_leaf() && B.is_leaf()) {
    near_[a].push_back(b);
    near_[b].push_back(a);
  } else if (B.is_leaf() || (!A.is_leaf() && A.radius >= B.radius)) {
    for (int i = 0; i < A.child_count; ++i) find_interactions(A.first_child + i, b, separation);
  } else {
    for (int i = 0; i < B.child_count; ++i) find_interactions(a, B.first_child + i, separation);
  }
}

// Skeletons are chosen among the points of a leaf, or the skeletons of the children.
void H2Matrix::find_skeletons(const Eigen::VectorXd& spacing, const H2Options& options) {
  const int count = static_cast<int>(tree_.nodes.size());
  std::vector<char> is_needed(count, 0);
  for (int node = 0; node < count; ++node) {
    const int parent = tree_.nodes[node].parent;
    is_needed[node] = !far_[node].empty() || (parent >= 0 && is_needed[parent]);
  }
  const ProxyShell proxies(options.separation);
  skeletons_.resize(count);
  std::vector<MatrixXd> points(count);
  std::vector<double> finest(count, 1e300);
  for_each_level(tree_, true, [&](int id) {
    const Octree::Node& node = tree_.nodes[id];
    for (int c = 0; c < node.child_count; ++c)
      finest[id] = std::min(finest[id], finest[node.first_child + c]);
    if (node.is_leaf())
      for (Index i = node.begin; i < node.end; ++i)
        finest[id] = std::min(finest[id], spacing(tree_.rows[i]));
    if (!is_needed[id]) return;
    MatrixXd candidates;
    if (node.is_leaf()) {
      candidates = tree_.points.middleRows(node.begin, node.end - node.begin);
    } else {
      Index rows = 0;
      for (int c = 0; c < node.child_count; ++c) rows += points[node.first_child + c].rows();
      candidates.resize(rows, 3);
      rows = 0;
      for (int c = 0; c < node.child_count; ++c) {
        const MatrixXd& child = points[node.first_child + c];
        candidates.middleRows(rows, child.rows()) = child;
        rows += child.rows();
      }
    }
    skeletons_[id] =
        find_skeleton(candidates, node.centre, node.radius,
                      node_tolerance(options.accuracy, finest[id], node.radius), proxies);
    points[id].resize(skeletons_[id].rank, 3);
    for (Index i = 0; i < points[id].rows(); ++i)
      points[id].row(i) = candidates.row(skeletons_[id].permutation[i]);
  });

  skeleton_begin_.assign(1, 0);
  for (int id = 0; id < count; ++id)
    skeleton_begin_.push_back(skeleton_begin_.back() + points[id].rows());
  skeleton_points_.resize(skeleton_begin_.back(), 3);
  for (int id = 0; id < count; ++id)
    skeleton_points_.middleRows(skeleton_begin_[id], points[id].rows()) = points[id];
}

Index H2Matrix::candidate_begin(int id) const {
  const Octree::Node& node = tree_.nodes[id];
  return node.is_leaf() ? node.begin : skeleton_begin_[node.first_child];
}

Index H2Matrix::candidate_count(int id) const {
  const Octree::Node& node = tree_.nodes[id];
  if (node.is_leaf()) return node.end - node.begin;
  return skeleton_begin_[node.first_child + node.child_count] - skeleton_begin_[node.first_child];
}

H2Matrix::Sources H2Matrix::compress(const MatrixXd& weights) const {
  Sources sources;
  sources.weights.resize(weights.rows(), weights.cols());
  parallel_for(weights.rows(), 8192, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) sources.weights.row(i) = weights.row(tree_.rows[i]);
  });
  sources.skeletons.resize(skeleton_begin_.back(), weights.cols());
  for_each_level(tree_, true, [&](int id) {
    if (rank(id) == 0) return;
    const MatrixXd& from = tree_.nodes[id].is_leaf() ? sources.weights : sources.skeletons;
    sources.skeletons.middleRows(skeleton_begin_[id], rank(id)) =
        skeletons_[id].compress(from.middleRows(candidate_begin(id), candidate_count(id)));
  });
  return sources;
}

// The transpose of `compress`: potentials at the skeletons down to the points.
void H2Matrix::expand(MatrixXd& potentials, MatrixXd& result) const {
  for_each_level(tree_, false, [&](int id) {
    if (rank(id) == 0) return;
    MatrixXd& to = tree_.nodes[id].is_leaf() ? result : potentials;
    to.middleRows(candidate_begin(id), candidate_count(id)) +=
        skeletons_[id].expand(potentials.middleRows(skeleton_begin_[id], rank(id)));
  });
}

MatrixXd H2Matrix::multiply(const MatrixXd& weights) const {
  const Sources sources = compress(weights);
  const Index columns = weights.cols();
  const int count = static_cast<int>(tree_.nodes.size());
  MatrixXd potentials = MatrixXd::Zero(skeleton_begin_.back(), columns);
  MatrixXd sums = MatrixXd::Zero(weights.rows(), columns);
  parallel_for(count, 1, [&](Index begin, Index end) {
    for (int a = static_cast<int>(begin); a < end; ++a) {
      const Octree::Node& A = tree_.nodes[a];
      const Index row = skeleton_begin(a), k = rank(a);
      for (const int b : far_[a])
        sum_.add(skeleton_points_.middleRows(row, k),
                 skeleton_points_.middleRows(skeleton_begin(b), rank(b)),
                 sources.skeletons.middleRows(skeleton_begin(b), rank(b)),
                 potentials.middleRows(row, k));
      for (const int b : near_[a]) {
        const Octree::Node& B = tree_.nodes[b];
        sum_.add(tree_.points.middleRows(A.begin, A.end - A.begin),
                 tree_.points.middleRows(B.begin, B.end - B.begin),
                 sources.weights.middleRows(B.begin, B.end - B.begin),
                 sums.middleRows(A.begin, A.end - A.begin));
      }
    }
  });
  expand(potentials, sums);
  MatrixXd result(weights.rows(), columns);
  parallel_for(weights.rows(), 8192, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) result.row(tree_.rows[i]) = sums.row(i);
  });
  return result;
}

}  // namespace cadmorph
