#include "core/rbf/pointwise_field.h"

#include <utility>

#include "core/parallel.h"
#include "core/rbf/exact_sum.h"
#include "core/rbf/octree.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// Points that walk the tree together: few enough to lie close together, many enough for a walk to
// cost little beside their sums.
constexpr Index kBlock = 512;

// Adds the sum over the centres at a block of points in unit coordinates.
class TreeSum {
 public:
  TreeSum(const FieldTerms& terms, const MatrixXd& points, MatrixXd& out)
      : terms_(terms), tree_(terms.tree), sum_(terms.kernel), points_(points), out_(out) {}

  void run() {
    if (tree_.nodes.empty()) return sum_.add(points_, terms_.centres, terms_.weights, out_);
    std::vector<Index> all(points_.rows());
    for (Index i = 0; i < points_.rows(); ++i) all[i] = i;
    visit(0, all);
  }

 private:
  // Whether a node is far is asked of each point alone, so that its terms and their order are its
  // own.
  void visit(int id, const std::vector<Index>& rows) {
    const SourceTree::Node& node = tree_.nodes[id];
    std::vector<Index> far, near;
    for (const Index row : rows) (is_far(node, row) ? far : near).push_back(row);
    add(far, tree_.skeleton_points, tree_.skeleton_weights, node.skeleton_begin, node.skeleton_end);
    if (node.child_count == 0)
      add(near, terms_.centres, terms_.weights, node.begin, node.end);
    else if (!near.empty())
      for (int c = 0; c < node.child_count; ++c) visit(node.first_child + c, near);
  }

  bool is_far(const SourceTree::Node& node, Index row) const {
    if (node.skeleton_begin == node.skeleton_end) return false;
    const Eigen::RowVector3d difference = points_.row(row) - node.centre;
    return tree_.separation * tree_.separation * difference.squaredNorm() >=
           node.radius * node.radius;
  }

  void add(const std::vector<Index>& rows, const MatrixXd& sources, const MatrixXd& weights,
           Index begin, Index end) {
    if (rows.empty() || begin == end) return;
    MatrixXd values = MatrixXd::Zero(static_cast<Index>(rows.size()), out_.cols());
    sum_.add(points_(rows, Eigen::all), sources.middleRows(begin, end - begin),
             weights.middleRows(begin, end - begin), values);
    for (std::size_t i = 0; i < rows.size(); ++i)
      out_.row(rows[i]) += values.row(static_cast<Index>(i));
  }

  const FieldTerms& terms_;
  const SourceTree& tree_;
  ExactSum sum_;
  const MatrixXd& points_;
  MatrixXd& out_;
};

// Rows in an order that keeps neighbours together.
std::vector<Index> blockwise_order(const MatrixXd& points) {
  return build_octree(points, kBlock).rows;
}

}  // namespace

PointwiseField::PointwiseField(FieldTerms terms)
    : terms_(std::move(terms)), correction_(terms_.correction) {}

RowMatrix PointwiseField::evaluate(const Points& points) const {
  RowMatrix result(points.rows(), terms_.linear.cols());
  if (points.rows() == 0) return result;
  const MatrixXd unit = (points.rowwise() - terms_.origin) / terms_.unit;
  const std::vector<Index> order = blockwise_order(unit);
  parallel_for(points.rows(), kBlock, [&](Index begin, Index end) {
    for (Index first = begin; first < end; first += kBlock) {
      const Index last = std::min(first + kBlock, end);
      const std::vector<Index> rows(order.begin() + first, order.begin() + last);
      const MatrixXd block = unit(rows, Eigen::all);
      MatrixXd values = exact_linear(terms_.linear, block);
      TreeSum(terms_, block, values).run();
      for (std::size_t i = 0; i < rows.size(); ++i)
        result.row(rows[i]) = values.row(static_cast<Index>(i));
    }
  });
  if (!correction_.is_empty()) result += correction_.evaluate(unit);
  return result;
}

}  // namespace cadmorph
