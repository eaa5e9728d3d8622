#include "core/rbf/field_evaluator.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::RowVector3d;
using Eigen::VectorXd;

// A flat box of targets gets at least this part of its largest extent in each direction.
constexpr double kLeastExtent = 1e-3;

struct Box {
  RowVector3d centre = RowVector3d::Zero(), half = RowVector3d::Ones();
  double radius() const { return half.norm(); }
};

Box bounding_box(const Eigen::Ref<const MatrixXd>& points) {
  const RowVector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  Box box{0.5 * (low + high), 0.5 * (high - low)};
  const double least = std::max(kLeastExtent * box.half.maxCoeff(), 1e-300);
  box.half = box.half.cwiseMax(least);
  return box;
}

// Chebyshev interpolation in one direction, on [-1, 1].
class ChebyshevLine {
 public:
  explicit ChebyshevLine(int order) : nodes_(order), weights_(order) {
    for (int i = 0; i < order; ++i) {
      const double angle = std::numbers::pi * (i + 0.5) / order;
      nodes_(i) = std::cos(angle);
      weights_(i) = (i % 2 == 0 ? 1 : -1) * std::sin(angle);
    }
  }

  int order() const { return static_cast<int>(nodes_.size()); }
  const VectorXd& nodes() const { return nodes_; }

  // Lagrange polynomials at x (barycentric form): x.size() x order.
  MatrixXd basis(const VectorXd& x) const {
    constexpr double kAtNode = 1e-15;
    MatrixXd result(x.size(), order());
    for (Index i = 0; i < x.size(); ++i) {
      Index nearest = 0;
      const VectorXd difference = (x(i) - nodes_.array()).matrix();
      if (difference.cwiseAbs().minCoeff(&nearest) < kAtNode) {
        result.row(i).setZero();
        result(i, nearest) = 1;
      } else {
        result.row(i) = weights_.cwiseQuotient(difference).transpose();
        result.row(i) /= result.row(i).sum();
      }
    }
    return result;
  }

 private:
  VectorXd nodes_, weights_;
};

// Values at the tensor nodes of a box: order^3 x M, the last direction fastest.
struct Grid {
  Box box;
  MatrixXd values;
};

class Evaluator {
 public:
  Evaluator(const H2Matrix& matrix, const H2Matrix::Sources& sources, const Octree& targets,
            const EvaluatorOptions& options)
      : matrix_(matrix),
        sources_(sources),
        targets_(targets),
        options_(options),
        line_(options.order),
        result_(MatrixXd::Zero(targets.points.rows(), sources.weights.cols())) {}

  MatrixXd run() {
    visit(0, {0}, nullptr);
    return std::move(result_);
  }

 private:
  // Adds to the targets of `node` the field of the source nodes in `open` and that of `inherited`.
  void visit(int id, std::vector<int> open, const Grid* inherited) {
    const Octree::Node& node = targets_.nodes[id];
    const Index count = node.end - node.begin, grid_size = grid_node_count();
    const auto points = targets_.points.middleRows(node.begin, count);
    auto out = result_.middleRows(node.begin, count);
    const bool has_grid = count > grid_size;
    const bool is_last = node.is_leaf() || !has_grid;
    Grid grid{bounding_box(points), {}};
    if (has_grid) {
      grid.values =
          inherited ? refine(*inherited, grid.box) : MatrixXd::Zero(grid_size, result_.cols());
    } else if (inherited) {
      add_interpolated(*inherited, points, out);
    }

    const std::vector<int> remaining =
        has_grid ? add_far(grid.box, std::move(open), is_last, grid_points(grid.box), grid.values)
                 : add_far(grid.box, std::move(open), is_last, points, out);
    if (is_last) {
      if (has_grid) add_interpolated(grid, points, out);
      for (const int s : remaining) add_near(s, points, out);
      return;
    }
    parallel_for(node.child_count, 1, [&](Index begin, Index end) {
      for (Index c = begin; c < end; ++c)
        visit(node.first_child + static_cast<int>(c), remaining, &grid);
    });
  }

  // Sums the separated ones among the open source nodes; returns those left, opened where they are
  // larger than the box (at the last box: down to leaves).
  std::vector<int> add_far(const Box& box, std::vector<int> open, bool is_last,
                           const Eigen::Ref<const MatrixXd>& points,
                           Eigen::Ref<MatrixXd> out) const {
    std::vector<int> remaining;
    while (!open.empty()) {
      const int id = open.back();
      open.pop_back();
      const Octree::Node& source = matrix_.tree().nodes[id];
      const double distance = (source.centre - box.centre).norm();
      const bool is_far = options_.separation * distance >= box.radius() + source.radius;
      if (is_far && matrix_.rank(id) > 0) {
        const Index row = matrix_.skeleton_begin(id), k = matrix_.rank(id);
        matrix_.kernel().add(points, matrix_.skeleton_points().middleRows(row, k),
                             sources_.skeletons.middleRows(row, k), out);
      } else if (!source.is_leaf() && (is_last || source.radius > box.radius())) {
        for (int c = 0; c < source.child_count; ++c) open.push_back(source.first_child + c);
      } else {
        remaining.push_back(id);
      }
    }
    return remaining;
  }

  void add_near(int id, const Eigen::Ref<const MatrixXd>& points, Eigen::Ref<MatrixXd> out) const {
    const Octree::Node& source = matrix_.tree().nodes[id];
    const Index count = source.end - source.begin;
    matrix_.kernel().add(points, matrix_.tree().points.middleRows(source.begin, count),
                         sources_.weights.middleRows(source.begin, count), out);
  }

  Index grid_node_count() const {
    const Index p = line_.order();
    return p * p * p;
  }

  MatrixXd grid_points(const Box& box) const {
    const int p = line_.order();
    MatrixXd points(grid_node_count(), 3);
    Index row = 0;
    for (int i = 0; i < p; ++i)
      for (int j = 0; j < p; ++j)
        for (int k = 0; k < p; ++k, ++row)
          points.row(row) = box.centre + box.half.cwiseProduct(RowVector3d(
                                             line_.nodes()(i), line_.nodes()(j), line_.nodes()(k)));
    return points;
  }

  MatrixXd line_basis(const Box& box, int direction, const VectorXd& coordinates) const {
    return line_.basis((coordinates.array() - box.centre(direction)) / box.half(direction));
  }

  // The interpolant of a grid at the nodes of the grid of a box inside.
  MatrixXd refine(const Grid& grid, const Box& inner) const {
    const Index p = line_.order();
    MatrixXd basis[3];
    for (int d = 0; d < 3; ++d)
      basis[d] = line_basis(grid.box, d,
                            (inner.centre(d) + inner.half(d) * line_.nodes().array()).matrix());
    MatrixXd values(grid.values.rows(), grid.values.cols());
    for (Index m = 0; m < values.cols(); ++m) {
      // Each product contracts the fastest direction and turns the next one to the front.
      MatrixXd turned = Eigen::Map<const MatrixXd>(grid.values.col(m).data(), p, p * p);
      for (int d = 2; d >= 0; --d) {
        const MatrixXd contracted = (basis[d] * turned).transpose();
        turned = Eigen::Map<const MatrixXd>(contracted.data(), p, p * p);
      }
      values.col(m) = Eigen::Map<const VectorXd>(turned.data(), p * p * p);
    }
    return values;
  }

  void add_interpolated(const Grid& grid, const Eigen::Ref<const MatrixXd>& points,
                        Eigen::Ref<MatrixXd> out) const {
    constexpr Index kBlock = 256;  // keeps the partly contracted values in the cache
    const Index p = line_.order();
    for (Index begin = 0; begin < points.rows(); begin += kBlock) {
      const Index n = std::min(kBlock, points.rows() - begin);
      MatrixXd basis[3];
      for (int d = 0; d < 3; ++d)
        basis[d] = line_basis(grid.box, d, points.col(d).segment(begin, n));
      for (Index m = 0; m < out.cols(); ++m) {
        const Eigen::Map<const MatrixXd> values(grid.values.col(m).data(), p, p * p);
        const MatrixXd planes = basis[2] * values;  // n x (p * p), direction 1 fastest
        VectorXd sum = VectorXd::Zero(n);
        for (Index i = 0; i < p; ++i) {
          VectorXd line = VectorXd::Zero(n);
          for (Index j = 0; j < p; ++j) line += planes.col(i * p + j).cwiseProduct(basis[1].col(j));
          sum += line.cwiseProduct(basis[0].col(i));
        }
        out.col(m).segment(begin, n) += sum;
      }
    }
  }

  const H2Matrix& matrix_;
  const H2Matrix::Sources& sources_;
  const Octree& targets_;
  EvaluatorOptions options_;
  ChebyshevLine line_;
  MatrixXd result_;
};

}  // namespace

MatrixXd evaluate_field(const H2Matrix& matrix, const H2Matrix::Sources& sources,
                        const Eigen::Ref<const MatrixXd>& targets,
                        const EvaluatorOptions& options) {
  if (targets.rows() == 0) return MatrixXd::Zero(0, sources.weights.cols());
  const Octree tree = build_octree(targets, options.leaf_size);
  const MatrixXd sorted = Evaluator(matrix, sources, tree, options).run();
  MatrixXd result(targets.rows(), sorted.cols());
  parallel_for(targets.rows(), 8192, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) result.row(tree.rows[i]) = sorted.row(i);
  });
  return result;
}

}  // namespace cadmorph
