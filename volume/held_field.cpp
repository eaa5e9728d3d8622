#include "volume/held_field.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/affine_fit.h"
#include "core/rbf/point_order.h"
#include "core/rbf/solver_choice.h"

namespace cadmorph {
namespace {

// Centres that carry a field well enough to choose anchors by; the dense system of so many takes
// less than 0.1 s.
constexpr Index kMostCarriers = 1500;

// Between the targets that anchors are chosen by others may move a little farther: then the
// farthest of them become some, too. With 4 a ball and a foil in far fields come out the same, and
// the tests pass, with 16, too.
constexpr int kMostHolds = 8;

// With more anchors nothing is held: those of bodies in far fields are 20 to 1,400. Where walls and
// gaps fill the domain many of its nodes become some, and to hold these takes ten times as long as
// all else: a duct with a twisted plate 363, then 3,016 and 4,341, in 13 of 16 s.
constexpr Index kMostAnchors = 2000;

// Carriers closer than this part of the diagonal would bring their system near to rounding: r^3 is
// 1e-12 of what it is across the part.
constexpr double kLeastSeparation = 1e-4;

// What the centres of a field with anchors may miss counts in spacings, or in this part of the
// largest displacement: the spacing of a far field is far larger than that. The tests pass with
// half and twice of it.
constexpr double kMostMissed = 0.5;

// A field that runs on near the surface alone is left as it is, since targets there follow the
// surface's own nodes anyway, and to hold it takes up to ten times as long as the field. A target
// may move n times as far as the surface does where it lies no deeper than kNear / n spacings of
// the surface's nodes. The product of n and that depth is 3 to 9 in thin walls and gaps, 14 and
// more in far fields of ten radii (docs/adaptive-centres.md).
constexpr double kNear = 10;

// The kernels of a linear map are chosen for motions of at least this part of the size of what
// moves. The motions given may be much smaller, the steps of differences, for which a few kernels
// would do; changes of parameters move entities by up to a tenth of the part.
constexpr double kFar = 0.1;

// Modes of several motions smaller than this part of the largest are left out. They are differences
// of motions that are nearly the same, and anchors may make their fields differ by far more, which
// would then be divided by so small a size. The tests pass with half and twice of it.
constexpr double kLeastMode = 0.1;

// The centres that a field rests on, or those of them that are farthest from each other.
std::vector<Index> carriers_of(const RbfSystem& system, const RbfField& field,
                               const RowMatrix& centres) {
  const double diagonal = (centres.colwise().maxCoeff() - centres.colwise().minCoeff()).norm();
  if (centres.rows() <= kMostCarriers)
    return clear_of_each_other(
        centres, Eigen::VectorXd::Constant(centres.rows(), kLeastSeparation * diagonal));
  std::vector<Index> carriers = system.kernels(field);
  if (static_cast<Index>(carriers.size()) <= kMostCarriers) return carriers;
  const PointOrder order = farthest_point_order(Points(centres(carriers, Eigen::all)));
  std::vector<Index> farthest;
  for (Index i = 0; i < kMostCarriers; ++i) farthest.push_back(carriers[order.rows[i]]);
  return farthest;
}

// Whether a target moves farther than kMostOvershoot and its distance from the surface allow.
bool runs_on(const RowMatrix& centres, const RowMatrix& values, const RowMatrix& targets,
             const RowMatrix& displacements) {
  const double largest = values.rowwise().norm().maxCoeff();
  const KdTree tree(centres);
  std::atomic<bool> does = false;
  parallel_for(targets.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end && !does; ++i) {
      const double moved = displacements.row(i).norm();
      if (moved <= kMostOvershoot * largest) continue;
      const Neighbour near = tree.nearest(targets.row(i).data(), 1).front();
      const double spacing = std::sqrt(squared_spacing(tree, centres.row(near.index).data()));
      if (moved * std::sqrt(near.squared_distance) > kNear * largest * spacing) does = true;
    }
  });
  return does;
}

// A field that anchors hold, with the first so many of them.
struct HeldField {
  RbfSystem system;
  RbfField field;
  Index anchors;
};

// `first`: centres and, counted on from these, anchors to start from.
HeldField solve_with_anchors(const MorphPart& part, const RowMatrix& values, const Anchors& anchors,
                             const std::vector<Index>& first, const RowMatrix& targets,
                             const VolumeMorphOptions& options) {
  const RowMatrix points = targets(anchors.targets, Eigen::all);
  const KdTree tree(part.centres);
  RbfOptions rbf = options.rbf;
  rbf.solver = SolverKind::Adaptive;  // others come near to rounding in a large far field
  rbf.local_length.resize(0);
  rbf.most_missed = kMostMissed * values.rowwise().norm().maxCoeff();
  rbf.first_centres = first;
  RowMatrix all(part.centres.rows() + points.rows(), 3), prescribed(all.rows(), 3);
  all << part.centres, points;
  prescribed << values, anchors.values;
  if (part.lengths.size() > 0) {
    rbf.local_length.resize(all.rows());
    rbf.local_length.head(part.lengths.size()) = part.lengths;
    for (Index i = 0; i < points.rows(); ++i)
      rbf.local_length(part.lengths.size() + i) =
          std::sqrt(tree.nearest(points.row(i).data(), 1).front().squared_distance);
  }
  RbfSystem system(all, options.kernel, rbf);
  RbfField field = system.solve(prescribed);
  return {std::move(system), std::move(field), points.rows()};
}

// How it came about.
struct HoldHistory {
  std::vector<Index> carriers;
  Anchors anchors;
  std::vector<HeldField> holds;
  std::size_t taken = 0;  // the hold that the field is of, from 1; 0: without anchors
};

// Holds a field that runs on by anchors among the volume nodes while one of them moves too far.
// Where centres that nearly coincide leave no anchors to be found, it stays as it is.
void hold_back(const MorphPart& part, const RowMatrix& values, const RowMatrix& targets,
               const VolumeMorphOptions& options, BoundedField& bounded, HoldHistory* history) {
  const double at_first = overshoot(values, bounded.displacements);
  if (!is_bounded(options) || at_first <= kMostOvershoot ||
      !runs_on(part.centres, values, targets, bounded.displacements))
    return;
  const std::vector<Index> carriers = carriers_of(*part.system, bounded.field, part.centres);
  std::vector<Index> first;
  if (bounded.field.report().solver == SolverKind::Adaptive)
    first = part.system->kernels(bounded.field);
  if (history) history->carriers = carriers;
  TriedAnchors tried;
  Index holding = 0;
  double least = at_first;
  char text[160];
  try {
    for (int hold = 0; hold < kMostHolds; ++hold) {
      const Index known = std::ssize(tried.anchors.targets);
      tried.anchors = find_anchors(part.centres, values, carriers, options.kernel, targets, tried);
      if (std::ssize(tried.anchors.targets) > kMostAnchors) break;
      for (Index i = known; i < std::ssize(tried.anchors.targets); ++i)
        first.push_back(part.centres.rows() + i);
      HeldField held = solve_with_anchors(part, values, tried.anchors, first, targets, options);
      first = held.system.kernels(held.field);
      tried.displacements = held.field.evaluate(targets);
      if (history) {
        history->anchors = tried.anchors;
        history->holds.push_back(held);
      }
      const double now = overshoot(values, tried.displacements);
      if (now < least) {
        least = now;
        holding = held.anchors;
        bounded.field = std::move(held.field);
        bounded.displacements = tried.displacements;
        if (history) history->taken = history->holds.size();
      }
      if (now <= kMostOvershoot) break;
    }
    if (holding > 0)
      std::snprintf(text, sizeof text,
                    "; %td nodes inside hold the field, which ran on to %.3g times the motion of "
                    "the surface",
                    holding, at_first);
    else
      std::snprintf(text, sizeof text, "; runs on to %.3g times the motion of the surface",
                    at_first);
    bounded.remark = text;
    if (holding > 0 && least > kMostOvershoot) {
      std::snprintf(text, sizeof text, ", and runs on to %.3g times that now", least);
      bounded.remark += text;
    }
  } catch (const SolverError& error) {
    std::snprintf(text, sizeof text, "; runs on to %.3g times the motion of the surface: ",
                  overshoot(values, bounded.displacements));
    bounded.remark = text + std::string(error.what());
  }
}

// As hold_back, by the nodes of cells alone; those of no cell follow the field that results.
void hold_back_by_cells(const MorphPart& part, const RowMatrix& values, const PartTargets& targets,
                        const VolumeMorphOptions& options, BoundedField& bounded,
                        HoldHistory* history) {
  const Index of_cells = targets.of_cells, loose = targets.points.rows() - of_cells;
  if (loose == 0) return hold_back(part, values, targets.points, options, bounded, history);
  BoundedField result{std::move(bounded.field), bounded.displacements.topRows(of_cells), {}};
  hold_back(part, values, targets.points.topRows(of_cells), options, result, history);
  bounded.displacements.topRows(of_cells) = result.displacements;
  bounded.displacements.bottomRows(loose) = result.field.evaluate(targets.points.bottomRows(loose));
  bounded.field = std::move(result.field);
  bounded.remark = std::move(result.remark);
}

}  // namespace

bool is_bounded(const VolumeMorphOptions& options) {
  const SolverKind asked = options.rbf.solver;
  return (asked == SolverKind::Auto || asked == SolverKind::Adaptive) &&
         is_triharmonic_3d(options.kernel, 3);
}

void hold_back(const MorphPart& part, const RowMatrix& values, const PartTargets& targets,
               const VolumeMorphOptions& options, BoundedField& bounded) {
  hold_back_by_cells(part, values, targets, options, bounded, nullptr);
}

namespace {

// A held or plain field's map, and what it is made of.
struct HeldMap {
  FieldMap map;
  Index kernels = 0, anchors = 0;  // kernels: of centres and anchors
};

HeldMap held_map(const MorphPart& part, const RowMatrix& values, const PartTargets& all,
                 const VolumeMorphOptions& options) {
  const RowMatrix& targets = all.points;
  BoundedField bounded{part.system->solve(values), RowMatrix(0, 3), {}};
  bounded.displacements = part.targets->evaluate({bounded.field}).front();
  HoldHistory history;
  hold_back_by_cells(part, values, all, options, bounded, &history);
  HeldMap result;
  if (history.taken == 0) {
    result.map.field = part.system->derivative(bounded.field, targets);
    result.kernels = std::ssize(part.system->kernels(bounded.field));
    return result;
  }
  const HeldField& held = history.holds[history.taken - 1];
  const auto field_of = [&](Index anchors, const std::vector<Index>& rows) {
    const auto before = std::ranges::find(history.holds, anchors, &HeldField::anchors);
    return before->system.derivative(before->field, targets(rows, Eigen::all));
  };
  result.map.field = held.system.derivative(held.field, targets);
  result.map.anchors.emplace(part.centres, history.carriers, options.kernel, targets,
                             history.anchors, held.anchors, field_of);
  result.kernels = std::ssize(held.system.kernels(held.field));
  result.anchors = held.anchors;
  return result;
}

// The diagonal of the box of the centres that move by more than half of the largest motion.
double extent_of_moving(const RowMatrix& centres, const RowMatrix& motion) {
  const Eigen::VectorXd moved = motion.rowwise().norm();
  const double half = moved.maxCoeff() / 2;
  Eigen::AlignedBox3d box;
  for (Index i = 0; i < centres.rows(); ++i)
    if (moved(i) > half) box.extend(centres.row(i).transpose());
  return box.diagonal().norm();
}

// Beside each other, as large each, and not small; those that rest are left out.
RowMatrix side_by_side(const RowMatrix& centres, const std::vector<RowMatrix>& motions) {
  double largest = 0;
  for (const RowMatrix& motion : motions) {
    const double own = motion.rowwise().norm().maxCoeff();
    if (own > 0) largest = std::max({largest, own, kFar * extent_of_moving(centres, motion)});
  }
  RowMatrix result(motions.front().rows(), 0);
  for (const RowMatrix& motion : motions) {
    const double own = motion.rowwise().norm().maxCoeff();
    if (own == 0) continue;
    result.conservativeResize(Eigen::NoChange, result.cols() + 3);
    result.rightCols(3) = largest / own * motion;
  }
  return result;
}

// The functionals that tell how much of each column of `values` (N x C) there is in others, by
// least squares (C x N): of columns that nearly depend on each other their sum alone.
Eigen::MatrixXd shares_of(const Eigen::MatrixXd& values) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(values.transpose() * values);
  const Eigen::VectorXd& sizes = modes.eigenvalues();
  const double least = kLeastMode * kLeastMode * sizes.maxCoeff();
  const Eigen::VectorXd inverse =
      (sizes.array() > least).select(sizes.cwiseMax(least).cwiseInverse(), 0.0);
  return modes.eigenvectors() * inverse.asDiagonal() * modes.eigenvectors().transpose() *
         values.transpose();
}

// What has to be added to a held map, so that affine motions are exact, and `motions` (N x C) do
// what `fields` (T x C) say.
LowRankMap corrections(const FieldMap& map, const AffineFit& affine, const RowMatrix& motions,
                       const Eigen::MatrixXd& fields) {
  const Eigen::MatrixXd coefficients = affine.fit * motions;
  const Eigen::MatrixXd rest = motions - affine.at_centres * coefficients;
  const Eigen::MatrixXd shares = shares_of(rest);
  const Index terms = affine.fit.rows();
  LowRankMap result;
  result.functionals.resize(terms + shares.rows(), motions.rows());
  result.functionals << affine.fit, shares - (shares * affine.at_centres) * affine.fit;
  result.fields.resize(affine.at_targets.rows(), terms + shares.rows());
  result.fields << affine.at_targets - map.forward(affine.at_centres),
      fields - affine.at_targets * coefficients - map.forward(rest);
  return result;
}

}  // namespace

FieldMap held_derivative(const MorphPart& part, const RowMatrix& values, const Points& base,
                         const VolumeMorphOptions& options) {
  return held_map(part, values, targets_of(part, base), options).map;
}

LinearField linear_field(const MorphPart& part, const std::vector<RowMatrix>& motions,
                         const Points& base, const VolumeMorphOptions& options) {
  const PartTargets targets = targets_of(part, base);
  const RowMatrix all = side_by_side(part.centres, motions);
  const Index count = all.cols() / 3;
  if (count == 0) return {held_map(part, motions.front(), targets, options).map};
  // Of the motions one by one: the most anchors serve for what is none of these.
  HeldMap chosen;
  Eigen::MatrixXd fields(targets.points.rows(), all.cols());
  for (Index k = 0; k < count; ++k) {
    const RowMatrix motion = all.middleCols(3 * k, 3);
    HeldMap own = held_map(part, motion, targets, options);
    fields.middleCols(3 * k, 3) = own.map.forward(motion);
    if (k == 0 || own.anchors > chosen.anchors) chosen = std::move(own);
  }
  if (chosen.anchors > 0) {
    chosen.map.more = corrections(chosen.map, AffineFit(part.centres, targets.points), all, fields);
  } else if (count > 1) {  // kernels for all
    const RbfField field = part.system->solve(all);
    chosen.map.field = part.system->derivative(field, targets.points);
    chosen.kernels = std::ssize(part.system->kernels(field));
  }
  LinearField result{std::move(chosen.map), chosen.kernels, chosen.anchors};
  for (Index k = 0; k < count; ++k) {
    const RowMatrix motion = all.middleCols(3 * k, 3);
    const RowMatrix moved = result.map.forward(motion).topRows(targets.of_cells);
    result.overshoot = std::max(result.overshoot, overshoot(motion, moved));
  }
  return result;
}

}  // namespace cadmorph
