#include "core/rbf/anchors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/affine_fit.h"
#include "core/rbf/centre_frame.h"
#include "core/rbf/dense_solver.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/point_order.h"
#include "core/rbf/rbf_field_impl.h"
#include "core/rbf/rbf_system.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Anchors are added while a candidate moves farther than kEnough times the largest value; each time
// those that move farther than kWorthAdding times it and kPartOfWorst of the farthest. What lies
// between candidates has the rest up to kMostOvershoot. With 0.25 for kPartOfWorst a ball that
// turns in a far field keeps 2 % less of the smallest scaled Jacobian. With 1.1 or 1.19 for kEnough
// it, a foil and what grows of them come out the same, with 1.04 or 1.12 for kWorthAdding to 1 %.
constexpr double kEnough = 1.15, kWorthAdding = 1.08, kPartOfWorst = 0.5;

// Candidates are this part of their distance from the centres away from each other. With half or
// twice a ball and a foil in far fields, which turn or grow, keep as much to 2 %.
constexpr double kGrading = 0.3;
// Each round takes as many kernels for each carrier, of which there are some 1,500: hundredths of a
// second.
constexpr std::size_t kMostCandidates = 6000;

// An anchor keeps others of its round this part of its distance from the centres away. Twice as far
// apart they change first cells on a sphere that turns by 20 degrees by about 2 % in place of 1.8.
constexpr double kSpread = 0.5;

// Centres weigh their size over the distance to the power d + kLocality in the means, in d
// dimensions: the higher, the farther a body that turns takes its surroundings along; the lower,
// the sooner they come to rest. With 2 or 5 those keep 0.2 % less to 1.1 % more of the smallest.
constexpr int kLocality = 3;

// Each adds anchors where the field still moves too far, and ends the search where none does: with
// half as many those four come out the same.
constexpr int kMostRounds = 30;

// Targets between the candidates may move too far: then they are anchors, too, so many times. With
// 4 or 16 those come out the same.
constexpr int kMostHolds = 8;

// Centres of each kind that tell whether anchors may be needed: those that move by no less than
// this part of the largest value, and the others. Two times 250 are a system of some milliseconds.
// Half and twice of either, or of kMissed, leave those as they are to the last bit.
constexpr Index kProbes = 250;
constexpr double kMoves = 0.1;

// The field by these probes is taken to be off by no more than so many times its difference from
// that by half as many. Each doubling at least halves the error, which makes it once the
// difference; what lies between the candidates adds to it. With 1 or 4 those come out the same.
constexpr double kMissedAgain = 2;

// Nor do they tell much where they miss this part of the largest value at the centres that move, in
// the root mean square.
constexpr double kMissed = 0.05;

// Motions count in steps of this: of nodes that are mirror images the first is taken, not the one
// that rounding favours on this processor. Far above rounding, far below kEnough - kWorthAdding.
constexpr double kGrain = 1e-3;

RowMatrix stack(const RowMatrix& above, const RowMatrix& below) {
  RowMatrix result(above.rows() + below.rows(), above.cols());
  result << above, below;
  return result;
}

VectorXd distances(const KdTree& tree, const RowMatrix& points) {
  VectorXd result(points.rows());
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      result(i) = std::sqrt(tree.nearest(points.row(i).data(), 1).front().squared_distance);
  });
  return result;
}

// The farthest target of each cell of a grid whose cells grow with the distance from the centres.
std::vector<Index> graded(const RowMatrix& targets, const VectorXd& distance) {
  using Cell = std::array<Index, 4>;
  std::map<Cell, Index> farthest;
  const Eigen::RowVectorXd low = targets.colwise().minCoeff();
  for (Index i = 0; i < targets.rows(); ++i) {
    if (!(distance(i) > 0)) continue;
    const int level = std::ilogb(kGrading * distance(i));
    const double size = std::ldexp(1.0, level);
    Cell cell{level, 0, 0, 0};
    for (Index d = 0; d < targets.cols(); ++d)
      cell[static_cast<std::size_t>(d) + 1] =
          static_cast<Index>(std::floor((targets(i, d) - low(d)) / size));
    const auto [place, is_new] = farthest.try_emplace(cell, i);
    if (!is_new && distance(i) > distance(place->second)) place->second = i;
  }
  std::vector<Index> result;
  for (const auto& [cell, target] : farthest) result.push_back(target);
  std::ranges::sort(result, [&](Index a, Index b) {
    return distance(a) != distance(b) ? distance(a) > distance(b) : a < b;
  });
  if (result.size() > kMostCandidates) result.resize(kMostCandidates);
  return result;
}

// Means of the values at points, with positive weights: size / distance^power of each centre.
class Means {
 public:
  explicit Means(const RowMatrix& centres)
      : centres_(centres),
        size_(surface_shares(centres)),
        power_(CentreFrame(centres).terms() - 1 + kLocality) {}

  RowMatrix at(const RowMatrix& points, const RowMatrix& values) const {
    RowMatrix result(points.rows(), values.cols());
    parallel_for(points.rows(), 1, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const VectorXd weights = weights_at(points.row(i));
        result.row(i) = weights.transpose() * values / weights.sum();
      }
    });
    return result;
  }

  // Of each centre (a column) in the mean at each point.
  MatrixXd weights(const RowMatrix& points) const {
    MatrixXd result(points.rows(), centres_.rows());
    for (Index i = 0; i < points.rows(); ++i) {
      const VectorXd weights = weights_at(points.row(i));
      result.row(i) = weights.transpose() / weights.sum();
    }
    return result;
  }

 private:
  VectorXd weights_at(const Eigen::RowVectorXd& point) const {
    const VectorXd r2 = (centres_.rowwise() - point).rowwise().squaredNorm();
    return size_.array() * (r2.array() / r2.minCoeff()).pow(-0.5 * power_);
  }

  const RowMatrix& centres_;
  VectorXd size_;
  int power_;
};

// Interpolates at targets, to what rounding leaves of it: a body far smaller than its far field
// brings the system near to that.
RowMatrix interpolate(const RowMatrix& points, const RowMatrix& values, const Kernel& kernel,
                      const RowMatrix& targets) {
  const std::vector<Index> distinct = distinct_rows(points).rows;
  const RowMatrix rows = points(distinct, Eigen::all);
  const CentreFrame frame(rows);
  const KernelSum sum(in_units(kernel, frame.unit()), log_scale(kernel, frame.unit()));
  const MatrixXd centres = frame.to_unit(rows), at = frame.to_unit(targets);
  const SaddleSolution solution = make_dense_solver(Factorisation::Cholesky, sum.matrix(centres),
                                                    frame.polynomials(centres), kernel.cpd_sign())
                                      ->solve(values(distinct, Eigen::all));
  return sum(at, centres, solution.weights) + frame.polynomials(at) * solution.coefficients;
}

// Those that move farthest, each at a distance from the centres and from those taken before it.
std::vector<Index> farthest_moved(const VectorXd& moved, const RowMatrix& candidates,
                                  const RowMatrix& centres) {
  const double least = std::max(kWorthAdding, kPartOfWorst * moved.maxCoeff());
  std::vector<Index> order;
  for (Index i = 0; i < moved.size(); ++i)
    if (moved(i) > least) order.push_back(i);
  std::ranges::stable_sort(order, [&](Index a, Index b) { return moved(a) > moved(b); });
  const KdTree old(centres), tree(candidates(order, Eigen::all));
  std::vector<char> is_near(order.size(), 0);
  std::vector<Index> result;
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (is_near[k]) continue;
    const double* x = candidates.row(order[k]).data();
    const double distance = std::sqrt(old.nearest(x, 1).front().squared_distance);
    if (distance == 0) continue;
    result.push_back(order[k]);
    for (const Neighbour& near : tree.within(x, kSpread * distance)) is_near[near.index] = 1;
  }
  return result;
}

// Motions in parts of the largest value, rounded.
VectorXd motions(const RowMatrix& displacements, double largest) {
  return (displacements.rowwise().norm().array() / (largest * kGrain)).round() * kGrain;
}

// Centres and anchors so far, on the way to more.
class Search {
 public:
  Search(const RowMatrix& centres, const RowMatrix& values, const std::vector<Index>& carriers,
         const Kernel& kernel, const RowMatrix& targets)
      : targets_(targets),
        kernel_(kernel),
        values_(values),
        means_(centres),
        largest_(values.rowwise().norm().maxCoeff()),
        points_(centres(carriers, Eigen::all)),
        prescribed_(values(carriers, Eigen::all)),
        chosen_(graded(targets, distances(KdTree(points_), targets))),
        candidates_(targets(chosen_, Eigen::all)) {
    anchors_.values.resize(0, values.cols());
  }

  void add(const Anchors& before) {
    anchors_.rounds = before.rounds;
    add(before.targets, before.values);
  }

  void add(const std::vector<Index>& added, const RowMatrix& values) {
    anchors_.targets.insert(anchors_.targets.end(), added.begin(), added.end());
    anchors_.values = stack(anchors_.values, values);
    points_ = stack(points_, targets_(added, Eigen::all));
    prescribed_ = stack(prescribed_, values);
  }

  // Those of the targets (rows of `among`, all where that is null) that moved farthest.
  bool add_farthest(const RowMatrix& displacements, const RowMatrix& points,
                    const std::vector<Index>* among) {
    const VectorXd moved = motions(displacements, largest_);
    const std::vector<Index> rows = farthest_moved(moved, points, points_);
    if (rows.empty()) return false;
    std::vector<Index> added = rows;
    if (among)
      for (Index& target : added) target = (*among)[static_cast<std::size_t>(target)];
    RowMatrix held = means_.at(targets_(added, Eigen::all), values_);
    VectorXd parts(held.rows());
    for (Index i = 0; i < held.rows(); ++i) {
      const double least = held.row(i).norm() / largest_, most = moved(rows[i]);
      const double part = std::min(1 / (most * most), (kWorthAdding - least) / (most - least));
      parts(i) = std::max(part, 0.0);
      held.row(i) += parts(i) * (displacements.row(rows[i]) - held.row(i));
    }
    anchors_.rounds.push_back({static_cast<Index>(anchors_.targets.size()), !among, parts});
    add(added, held);
    return true;
  }

  void run() {
    for (int round = 0; round < kMostRounds && !chosen_.empty(); ++round) {
      const RowMatrix field = interpolate(points_, prescribed_, kernel_, candidates_);
      if (motions(field, largest_).maxCoeff() <= kEnough) return;
      if (!add_farthest(field, candidates_, &chosen_)) return;
    }
  }

  Anchors& anchors() { return anchors_; }

 private:
  const RowMatrix& targets_;
  const Kernel& kernel_;
  const RowMatrix& values_;
  Means means_;
  double largest_;
  RowMatrix points_, prescribed_;
  std::vector<Index> chosen_;
  RowMatrix candidates_;
  Anchors anchors_;
};

}  // namespace

double overshoot(const RowMatrix& values, const RowMatrix& displacements) {
  if (values.rows() == 0 || displacements.rows() == 0) return 0;
  const double largest = values.rowwise().norm().maxCoeff();
  return largest > 0 ? displacements.rowwise().norm().maxCoeff() / largest : 0;
}

Anchors find_anchors(const RowMatrix& centres, const RowMatrix& values,
                     const std::vector<Index>& carriers, const Kernel& kernel,
                     const RowMatrix& targets, const TriedAnchors& before) {
  Search search(centres, values, carriers, kernel, targets);
  if (!before.anchors.targets.empty()) search.add(before.anchors);
  if (before.displacements.rows() > 0) search.add_farthest(before.displacements, targets, nullptr);
  search.run();
  return std::move(search.anchors());
}

OvershootCheck::OvershootCheck(RowMatrix centres, const Kernel& kernel, const RowMatrix& targets)
    : centres_(std::move(centres)),
      candidates_(targets(graded(targets, distances(KdTree(centres_), targets)), Eigen::all)),
      order_(farthest_point_order(Points(centres_)).rows),
      kernel_(kernel) {}

RowMatrix OvershootCheck::by_probes(const RowMatrix& values, Index count,
                                    const RowMatrix& targets) const {
  const VectorXd moved = values.rowwise().norm();
  const double moves = kMoves * moved.maxCoeff();
  // A body that moves may be small beside what rests: it has as many of the probes.
  std::array<Index, 2> left = {count, count};
  std::vector<Index> probes;
  for (const Index row : order_)
    if (Index& more = left[moved(row) > moves]; more > 0) {
      probes.push_back(row);
      --more;
    }
  return interpolate(centres_(probes, Eigen::all), values(probes, Eigen::all), kernel_, targets);
}

OvershootGuess OvershootCheck::guess(const RowMatrix& values) const {
  const double largest = values.rows() > 0 ? values.rowwise().norm().maxCoeff() : 0;
  if (largest == 0 || candidates_.rows() == 0) return OvershootGuess::None;
  try {
    const RowMatrix all = by_probes(values, kProbes, stack(candidates_, centres_));
    const RowMatrix field = all.topRows(candidates_.rows());
    const double farthest = motions(field, largest).maxCoeff();
    if (farthest > kEnough) return OvershootGuess::Likely;
    const RowMatrix change = field - by_probes(values, kProbes / 2, candidates_);
    if (farthest + kMissedAgain * motions(change, largest).maxCoeff() > kEnough)
      return OvershootGuess::Unknown;
    const double missed = (all.bottomRows(values.rows()) - values).squaredNorm();
    const double moving =
        static_cast<double>((values.rowwise().norm().array() > kMoves * largest).count());
    return std::sqrt(missed / moving) > kMissed * largest ? OvershootGuess::Unknown
                                                          : OvershootGuess::None;
  } catch (const SolverError&) {  // probes nearly coincide
    return OvershootGuess::Unknown;
  }
}

AnchorDerivative::AnchorDerivative(const RowMatrix& centres, const std::vector<Index>& carriers,
                                   const Kernel& kernel, const RowMatrix& targets,
                                   const Anchors& anchors, Index count, const FieldOf& field)
    : centres_(centres.rows()), count_(count) {
  const Means means(centres);
  std::vector<Index> all(static_cast<std::size_t>(centres.rows()));
  std::iota(all.begin(), all.end(), Index{0});
  const auto range = [&](Index begin, Index end) {
    return std::vector<Index>(anchors.targets.begin() + begin, anchors.targets.begin() + end);
  };
  for (const Anchors::Round& round : anchors.rounds) {
    if (round.begin >= count) break;
    const Index end = round.begin + round.parts.size();
    Step step;
    step.begin = round.begin;
    step.end = end;
    step.parts = round.parts;
    const std::vector<Index> at = range(step.begin, end);
    const RowMatrix points = targets(at, Eigen::all);
    step.means = means.weights(points);
    if (round.is_field) {
      step.inputs = all;
      step.field = field(step.begin, at);
    } else {
      step.inputs = carriers;
      const RbfSystem system(
          stack(centres(carriers, Eigen::all), targets(range(0, step.begin), Eigen::all)), kernel,
          {.solver = SolverKind::Cholesky});
      step.field = system.derivative(points);
    }
    steps_.push_back(std::move(step));
  }
}

MatrixXd AnchorDerivative::forward(const MatrixXd& values) const {
  MatrixXd result(count_, values.cols());
  for (const Step& step : steps_) {
    MatrixXd known(static_cast<Index>(step.inputs.size()) + step.begin, values.cols());
    known << values(step.inputs, Eigen::all), result.topRows(step.begin);
    const MatrixXd mean = step.means * values;
    result.middleRows(step.begin, mean.rows()) =
        mean + step.parts.asDiagonal() * (step.field.forward(known) - mean);
  }
  return result;
}

MatrixXd AnchorDerivative::adjoint(MatrixXd slopes) const {
  MatrixXd result = MatrixXd::Zero(centres_, slopes.cols());
  for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) {
    const MatrixXd own = slopes.middleRows(step->begin, step->end - step->begin);
    const MatrixXd by_field = step->parts.asDiagonal() * own;
    result += step->means.transpose() * (own - by_field);
    const MatrixXd by_known = step->field.adjoint(by_field);
    const auto inputs = static_cast<Index>(step->inputs.size());
    for (Index i = 0; i < inputs; ++i) result.row(step->inputs[i]) += by_known.row(i);
    slopes.topRows(step->begin) += by_known.bottomRows(step->begin);
  }
  return result;
}

MatrixXd FieldMap::forward(const MatrixXd& values) const {
  MatrixXd result = forward_held(values);
  if (more) result += more->fields * (more->functionals * values);
  return result;
}

MatrixXd FieldMap::adjoint(const MatrixXd& slopes) const {
  MatrixXd result = adjoint_held(slopes);
  if (more) result += more->functionals.transpose() * (more->fields.transpose() * slopes);
  return result;
}

MatrixXd FieldMap::forward_held(const MatrixXd& values) const {
  if (!anchors) return field.forward(values);
  const MatrixXd held = anchors->forward(values);
  MatrixXd all(values.rows() + held.rows(), values.cols());
  all << values, held;
  return field.forward(all);
}

MatrixXd FieldMap::adjoint_held(const MatrixXd& slopes) const {
  MatrixXd all = field.adjoint(slopes);
  if (!anchors) return all;
  const Index held = anchors->size();
  const Index own = all.rows() - held;
  return all.topRows(own) + anchors->adjoint(all.bottomRows(held));
}

namespace {

// How an interpolant of all values came to keep within the bound.
struct BoundedField {
  RbfSystem system;             // without anchors
  RowMatrix displacements;      // of the targets
  std::vector<Index> all = {};  // rows of the centres
  Anchors anchors = {};
  std::vector<std::pair<Index, RbfSystem>> holds = {};  // with so many of the anchors
  std::size_t taken = 0;  // the hold that the displacements are of, from 1; 0: without anchors
};

BoundedField bounded_field(const RowMatrix& centres, const RowMatrix& values, const Kernel& kernel,
                           const RowMatrix& targets) {
  RbfSystem system(centres, kernel);
  BoundedField field{.system = system, .displacements = system.solve(values).evaluate(targets)};
  if (overshoot(values, field.displacements) <= kMostOvershoot) return field;
  field.all.resize(static_cast<std::size_t>(centres.rows()));
  std::iota(field.all.begin(), field.all.end(), Index{0});
  try {
    RowMatrix held;
    for (int hold = 0; hold < kMostHolds && overshoot(values, field.displacements) > kMostOvershoot;
         ++hold) {
      field.anchors =
          find_anchors(centres, values, field.all, kernel, targets, {field.anchors, held});
      const Anchors& anchors = field.anchors;
      field.holds.emplace_back(
          static_cast<Index>(anchors.targets.size()),
          RbfSystem(stack(centres, targets(anchors.targets, Eigen::all)), kernel));
      held = field.holds.back().second.solve(stack(values, anchors.values)).evaluate(targets);
      if (overshoot(values, held) < overshoot(values, field.displacements)) {
        field.displacements = held;
        field.taken = field.holds.size();
      }
    }
  } catch (const SolverError&) {  // centres nearly coincide: what there is has to do
  }
  return field;
}

}  // namespace

RowMatrix interpolate_bounded(const RowMatrix& centres, const RowMatrix& values,
                              const Kernel& kernel, const RowMatrix& targets) {
  return bounded_field(centres, values, kernel, targets).displacements;
}

FieldMap bounded_derivative(const RowMatrix& centres, const RowMatrix& values, const Kernel& kernel,
                            const RowMatrix& targets) {
  const BoundedField bounded = bounded_field(centres, values, kernel, targets);
  FieldMap map;
  if (bounded.taken == 0) {
    map.field = bounded.system.derivative(targets);
    return map;
  }
  const auto& [count, system] = bounded.holds[bounded.taken - 1];
  const auto field_of = [&](Index anchors, const std::vector<Index>& rows) {
    const auto before =
        std::ranges::find(bounded.holds, anchors, &std::pair<Index, RbfSystem>::first);
    return before->second.derivative(targets(rows, Eigen::all));
  };
  map.field = system.derivative(targets);
  map.anchors.emplace(centres, bounded.all, kernel, targets, bounded.anchors, count, field_of);
  return map;
}

}  // namespace cadmorph
