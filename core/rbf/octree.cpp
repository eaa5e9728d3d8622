#include "core/rbf/octree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::RowVector3d;

// Halvings of the root box; points closer than 2^-40 of it share a leaf.
constexpr int kMaxLevels = 40;

struct Cube {
  RowVector3d centre;
  double half;
};

int octant(const Eigen::Ref<const MatrixXd>& points, Index row, const RowVector3d& centre) {
  return (points(row, 0) > centre(0)) | (points(row, 1) > centre(1)) << 1 |
         (points(row, 2) > centre(2)) << 2;
}

class Builder {
 public:
  Builder(const Eigen::Ref<const MatrixXd>& points, Index leaf_size)
      : points_(points), leaf_size_(leaf_size) {}

  Octree build() {
    tree_.rows.resize(points_.rows());
    std::iota(tree_.rows.begin(), tree_.rows.end(), Index{0});
    const RowVector3d low = points_.colwise().minCoeff(), high = points_.colwise().maxCoeff();
    add_node(0, points_.rows(), -1, {0.5 * (low + high), 0.5 * (high - low).maxCoeff()});
    int begin = 0;
    for (int level = 0; begin < static_cast<int>(tree_.nodes.size()); ++level) {
      tree_.level_begin.push_back(begin);
      const int end = static_cast<int>(tree_.nodes.size());
      if (level < kMaxLevels)
        for (int node = begin; node < end; ++node) split(node);
      begin = end;
    }
    tree_.level_begin.push_back(begin);
    tree_.points.resize(points_.rows(), 3);
    for (Index i = 0; i < points_.rows(); ++i) tree_.points.row(i) = points_.row(tree_.rows[i]);
    for (Octree::Node& node : tree_.nodes) measure(node);
    return std::move(tree_);
  }

 private:
  void add_node(Index begin, Index end, int parent, const Cube& cube) {
    tree_.nodes.push_back({begin, end, parent, -1, 0, cube.centre, 0});
    cubes_.push_back(cube);
  }

  void split(int id) {
    const auto [begin, end] = std::pair(tree_.nodes[id].begin, tree_.nodes[id].end);
    if (end - begin <= leaf_size_) return;
    const Cube cube = cubes_[id];
    std::array<Index, 9> bounds{};
    for (Index i = begin; i < end; ++i) ++bounds[octant(points_, tree_.rows[i], cube.centre) + 1];
    for (int o = 0; o < 8; ++o) bounds[o + 1] += bounds[o];
    const std::vector<Index> old(tree_.rows.begin() + begin, tree_.rows.begin() + end);
    std::array<Index, 9> next = bounds;
    for (const Index row : old) tree_.rows[begin + next[octant(points_, row, cube.centre)]++] = row;

    tree_.nodes[id].first_child = static_cast<int>(tree_.nodes.size());
    for (int o = 0; o < 8; ++o) {
      if (bounds[o] == bounds[o + 1]) continue;
      const double step = 0.5 * cube.half;
      const RowVector3d offset(o & 1 ? step : -step, o & 2 ? step : -step, o & 4 ? step : -step);
      add_node(begin + bounds[o], begin + bounds[o + 1], id, {cube.centre + offset, step});
      ++tree_.nodes[id].child_count;
    }
  }

  void measure(Octree::Node& node) const {
    const auto points = tree_.points.middleRows(node.begin, node.end - node.begin);
    node.centre = 0.5 * (points.colwise().minCoeff() + points.colwise().maxCoeff());
    node.radius = std::sqrt((points.rowwise() - node.centre).rowwise().squaredNorm().maxCoeff());
  }

  Eigen::Ref<const MatrixXd> points_;
  Index leaf_size_;
  Octree tree_;
  std::vector<Cube> cubes_;
};

}  // namespace

Octree build_octree(const Eigen::Ref<const Eigen::MatrixXd>& points, Index leaf_size) {
  return Builder(points, leaf_size).build();
}

}  // namespace cadmorph
