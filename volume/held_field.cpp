#include "volume/held_field.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/rbf/point_order.h"
#include "core/rbf/solver_choice.h"

namespace cadmorph {
namespace {

// Centres that carry a field well enough to choose anchors by.
constexpr Index kMostCarriers = 1500;

// Between the targets that anchors are chosen by others may move a little farther: then the
// farthest of them become some, too.
constexpr int kMostHolds = 8;

// Carriers closer than this part of the diagonal would bring their system near to rounding.
constexpr double kLeastSeparation = 1e-4;

// What the centres of a field with anchors may miss counts in spacings, or in this part of the
// largest displacement: the spacing of a far field is far larger than that.
constexpr double kMostMissed = 0.5;

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

// Holds a field by anchors among the volume nodes while one of them moves too far. Where centres
// that nearly coincide leave no anchors to be found, it stays as it is.
void hold_back(const MorphPart& part, const RowMatrix& values, const RowMatrix& targets,
               const VolumeMorphOptions& options, BoundedField& bounded, HoldHistory* history) {
  const double at_first = overshoot(values, bounded.displacements);
  if (!is_bounded(options) || at_first <= kMostOvershoot) return;
  const std::vector<Index> carriers = carriers_of(*part.system, bounded.field, part.centres);
  std::vector<Index> first;
  if (bounded.field.report().solver == SolverKind::Adaptive)
    first = part.system->kernels(bounded.field);
  if (history) history->carriers = carriers;
  TriedAnchors tried;
  char text[120];
  try {
    for (int hold = 0; hold < kMostHolds; ++hold) {
      const Index known = std::ssize(tried.anchors.targets);
      tried.anchors = find_anchors(part.centres, values, carriers, options.kernel, targets, tried);
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
      if (now < overshoot(values, bounded.displacements)) {
        bounded.field = std::move(held.field);
        bounded.displacements = tried.displacements;
        if (history) history->taken = history->holds.size();
      }
      if (now <= kMostOvershoot) break;
    }
    std::snprintf(text, sizeof text,
                  "; %zu nodes inside hold the field, which ran on to %.3g times the motion of the "
                  "surface",
                  tried.anchors.targets.size(), at_first);
    bounded.remark = text;
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

FieldMap held_derivative(const MorphPart& part, const RowMatrix& values, const Points& base,
                         const VolumeMorphOptions& options) {
  BoundedField bounded{part.system->solve(values), RowMatrix(0, 3), {}};
  bounded.displacements = part.targets->evaluate({bounded.field}).front();
  HoldHistory history;
  const PartTargets all = targets_of(part, base);
  const RowMatrix& targets = all.points;
  hold_back_by_cells(part, values, all, options, bounded, &history);
  FieldMap map;
  if (history.taken == 0) {
    map.field = part.system->derivative(bounded.field, targets);
    return map;
  }
  const HeldField& held = history.holds[history.taken - 1];
  const auto field_of = [&](Index anchors, const std::vector<Index>& rows) {
    const auto before = std::ranges::find(history.holds, anchors, &HeldField::anchors);
    return before->system.derivative(before->field, targets(rows, Eigen::all));
  };
  map.field = held.system.derivative(held.field, targets);
  map.anchors.emplace(part.centres, history.carriers, options.kernel, targets, history.anchors,
                      held.anchors, field_of);
  return map;
}

}  // namespace cadmorph
