#include "core/rbf/field_evaluator.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/archive_types.h"
#include "core/parallel.h"
#include "core/rbf/simd.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::RowVector3d;
using Eigen::VectorXd;

// A flat box of targets gets at least this part of its largest extent in each direction, by which
// coordinates are divided: far above rounding, too little for a field to change across it.
constexpr double kLeastExtent = 1e-3;

Index cube(Index p) { return p * p * p; }

struct Box {
  RowVector3d centre = RowVector3d::Zero(), half = RowVector3d::Ones();
  double radius() const { return half.norm(); }

  template <class Archive>
  void serialize(Archive& archive) {
    archive(centre, half);
  }
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
    constexpr double kAtNode = 1e-15;  // the quotient of both sums is 0 / 0 there
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

// What a box of targets sees.
struct Plan {
  Box box;
  bool has_grid = false;
  bool is_last = false;        // children take no part
  std::vector<int> far, near;  // nodes of sources: seen through skeletons, summed directly

  template <class Archive>
  void serialize(Archive& archive) {
    archive(box, has_grid, is_last, far, near);
  }
};

// Finds the plans of all boxes from the root down.
class Planner {
 public:
  Planner(const H2Matrix& sources, const Octree& targets, const EvaluatorOptions& options)
      : sources_(sources), targets_(targets), options_(options), plans_(targets.nodes.size()) {}

  std::vector<Plan> run() {
    visit(0, {0});
    return std::move(plans_);
  }

 private:
  // `open`: nodes of sources that no larger box has dealt with.
  void visit(int id, std::vector<int> open) {
    const Octree::Node& node = targets_.nodes[id];
    const Index count = node.end - node.begin;
    Plan& plan = plans_[id];
    plan.box = bounding_box(targets_.points.middleRows(node.begin, count));
    plan.has_grid = count > cube(options_.order);
    plan.is_last = node.is_leaf() || !plan.has_grid;
    std::vector<int> remaining = split(plan, std::move(open));
    if (plan.is_last) {
      plan.near = std::move(remaining);
      return;
    }
    parallel_for(node.child_count, 1, [&](Index begin, Index end) {
      for (Index c = begin; c < end; ++c) visit(node.first_child + static_cast<int>(c), remaining);
    });
  }

  // Takes the separated ones among the open nodes; returns those left, opened where they are larger
  // than the box (at the last box: down to leaves).
  std::vector<int> split(Plan& plan, std::vector<int> open) const {
    std::vector<int> remaining;
    while (!open.empty()) {
      const int id = open.back();
      open.pop_back();
      const Octree::Node& source = sources_.tree().nodes[id];
      if (is_far(plan, source) && sources_.rank(id) > 0) {
        plan.far.push_back(id);
      } else if (!source.is_leaf() && (plan.is_last || source.radius > plan.box.radius())) {
        for (int c = 0; c < source.child_count; ++c) open.push_back(source.first_child + c);
      } else {
        remaining.push_back(id);
      }
    }
    return remaining;
  }

  bool is_far(const Plan& plan, const Octree::Node& source) const {
    const double distance = (source.centre - plan.box.centre).norm();
    return options_.separation * distance >= plan.box.radius() + source.radius;
  }

  const H2Matrix& sources_;
  const Octree& targets_;
  const EvaluatorOptions& options_;
  std::vector<Plan> plans_;
};

// Values at the tensor nodes of a box: order^3 x M, the last direction fastest.
struct Grid {
  const Box& box;
  MatrixXd values;
};

// Carries out the plans for one set of weights.
class Evaluation {
 public:
  Evaluation(const H2Matrix& matrix, const H2Matrix::Sources& sources, const Octree& targets,
             const std::vector<Plan>& plans, int order)
      : matrix_(matrix),
        sources_(sources),
        targets_(targets),
        plans_(plans),
        line_(order),
        result_(MatrixXd::Zero(targets.points.rows(), sources.weights.cols())) {}

  MatrixXd run() {
    visit(0, nullptr);
    return std::move(result_);
  }

 private:
  // Adds to the targets of a node the field of the sources of its plan and that of `inherited`.
  void visit(int id, const Grid* inherited) {
    const Octree::Node& node = targets_.nodes[id];
    const Plan& plan = plans_[id];
    const auto points = targets_.points.middleRows(node.begin, node.end - node.begin);
    auto out = result_.middleRows(node.begin, node.end - node.begin);
    Grid grid{plan.box, {}};
    if (plan.has_grid) {
      grid.values = inherited ? refine(*inherited, grid.box)
                              : MatrixXd::Zero(cube(line_.order()), result_.cols());
      add_far(plan.far, grid_points(grid.box), grid.values);
      if (plan.is_last) add_interpolated(grid, points, out);
    } else {
      if (inherited) add_interpolated(*inherited, points, out);
      add_far(plan.far, points, out);
    }
    for (const int s : plan.near) add_near(s, points, out);
    if (plan.is_last) return;
    parallel_for(node.child_count, 1, [&](Index begin, Index end) {
      for (Index c = begin; c < end; ++c) visit(node.first_child + static_cast<int>(c), &grid);
    });
  }

  void add_far(const std::vector<int>& sources, const Eigen::Ref<const MatrixXd>& points,
               Eigen::Ref<MatrixXd> out) const {
    for (const int id : sources) {
      const Index row = matrix_.skeleton_begin(id), k = matrix_.rank(id);
      matrix_.kernel().add(points, matrix_.skeleton_points().middleRows(row, k),
                           sources_.skeletons.middleRows(row, k), out);
    }
  }

  void add_near(int id, const Eigen::Ref<const MatrixXd>& points, Eigen::Ref<MatrixXd> out) const {
    const Octree::Node& source = matrix_.tree().nodes[id];
    const Index count = source.end - source.begin;
    matrix_.kernel().add(points, matrix_.tree().points.middleRows(source.begin, count),
                         sources_.weights.middleRows(source.begin, count), out);
  }

  MatrixXd grid_points(const Box& box) const {
    const int p = line_.order();
    MatrixXd points(cube(p), 3);
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
    constexpr Index kBlock = 64;  // keeps the bases in the cache
    const simd::Functions& simd = simd::functions(simd::best());
    MatrixXd basis[3], sum(kBlock, out.cols());
    for (MatrixXd& values : basis) values = MatrixXd::Zero(kBlock, line_.order());
    for (Index begin = 0; begin < points.rows(); begin += kBlock) {
      const Index n = std::min(kBlock, points.rows() - begin);
      for (int d = 0; d < 3; ++d)
        basis[d].topRows(n) = line_basis(grid.box, d, points.col(d).segment(begin, n));
      simd.contract(n, line_.order(), basis[0].data(), basis[1].data(), basis[2].data(), kBlock,
                    out.cols(), grid.values.data(), grid.values.rows(), sum.data());
      out.middleRows(begin, n) += sum.topRows(n);
    }
  }

  const H2Matrix& matrix_;
  const H2Matrix::Sources& sources_;
  const Octree& targets_;
  const std::vector<Plan>& plans_;
  ChebyshevLine line_;
  MatrixXd result_;
};

}  // namespace

struct FieldEvaluator::Impl {
  Octree targets;
  int order = 0;
  std::vector<Plan> plans;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(targets, order, plans);
  }
};

FieldEvaluator::FieldEvaluator(const H2Matrix& matrix, const Eigen::Ref<const MatrixXd>& targets,
                               EvaluatorOptions options) {
  Impl impl{build_octree(targets, options.leaf_size), options.order, {}};
  if (targets.rows() > 0) impl.plans = Planner(matrix, impl.targets, options).run();
  impl_ = std::make_shared<const Impl>(std::move(impl));
}

FieldEvaluator::FieldEvaluator(InputArchive& archive)
    : impl_(std::make_shared<const Impl>(take<Impl>(archive))) {}

void FieldEvaluator::store(OutputArchive& archive) const { archive(*impl_); }

const Octree& FieldEvaluator::targets() const { return impl_->targets; }

MatrixXd FieldEvaluator::evaluate(const H2Matrix& matrix, const H2Matrix::Sources& sources) const {
  if (impl_->plans.empty()) return MatrixXd::Zero(0, sources.weights.cols());
  return Evaluation(matrix, sources, impl_->targets, impl_->plans, impl_->order).run();
}

MatrixXd evaluate_field(const H2Matrix& matrix, const H2Matrix::Sources& sources,
                        const Eigen::Ref<const MatrixXd>& targets,
                        const EvaluatorOptions& options) {
  const FieldEvaluator evaluator(matrix, targets, options);
  const MatrixXd sorted = evaluator.evaluate(matrix, sources);
  MatrixXd result(sorted.rows(), sorted.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(evaluator.targets().rows[i]) = sorted.row(i);
  return result;
}

}  // namespace cadmorph
