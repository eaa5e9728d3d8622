#include "volume/volume_morph.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "core/archive_types.h"
#include "core/edge_lengths.h"
#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/anchors.h"
#include "core/rbf/point_order.h"
#include "core/rbf/solver_choice.h"
#include "core/stopwatch.h"
#include "volume/baselines/baseline.h"
#include "volume/components.h"

namespace cadmorph {
namespace {

// A slit in the part is narrower than these parts of a node's shortest and longest mesh edge: where
// no edge spans it, and where one does.
constexpr double kOpenSlit = 1e-4, kSpannedSlit = 3e-6;

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

std::vector<Index> at(const std::vector<Index>& list, const std::vector<Index>& positions) {
  std::vector<Index> result;
  for (const Index position : positions) result.push_back(list[position]);
  return result;
}

void check_nodes(Index count, const std::vector<Index>& surface_nodes) {
  std::vector<char> is_surface(count, 0);
  for (const Index node : surface_nodes) {
    if (node < 0 || node >= count)
      throw InvalidInputError("surface node " + std::to_string(node) + " is not in the mesh of " +
                              std::to_string(count) + " nodes");
    if (std::exchange(is_surface[node], 1))
      throw InvalidInputError("surface node " + std::to_string(node) + " is prescribed twice");
  }
}

// What the mesh says of the scale at each surface node.
struct NodeScales {
  Eigen::VectorXd lengths;  // shortest incident edge, or what the options say
  Eigen::VectorXd slits;    // nodes this near each other lie on the two sides of a slit
};

NodeScales node_scales(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                       const RbfOptions& options) {
  const IncidentEdges edges = incident_edges(mesh);
  const Eigen::VectorXd shortest = edges.shortest(surface_nodes);
  return {options.local_length.size() > 0 ? options.local_length : shortest,
          (kOpenSlit * shortest).cwiseMax(kSpannedSlit * edges.longest(surface_nodes))};
}

// Positions of the surface nodes that serve as centres, of those within `reach` of each other one.
// The two sides of a slit would make the system singular to rounding, and its field can't jump
// between them: one side stands for both.
std::vector<Index> clear_of_each_other(const RowMatrix& points, const Eigen::VectorXd& reach) {
  const KdTree tree(points);
  const Index count = points.rows();
  std::vector<std::vector<Index>> near(static_cast<std::size_t>(count));
  parallel_for(count, 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for (const Neighbour& other : tree.within(points.row(i).data(), reach[i]))
        if (other.index < i) near[i].push_back(other.index);
  });
  std::vector<char> is_kept(static_cast<std::size_t>(count), 1);
  std::vector<Index> kept;
  for (Index i = 0; i < count; ++i) {
    is_kept[i] = std::none_of(near[i].begin(), near[i].end(), [&](Index j) { return is_kept[j]; });
    if (is_kept[i]) kept.push_back(i);
  }
  return kept;
}

// One component with its system.
struct Part {
  Component nodes;
  RowMatrix centres;                // of its surface nodes
  Index dropped = 0;                // surface nodes that the other side of a slit stands for
  Index beyond = 0;                 // see Targets
  Eigen::VectorXd lengths;          // local ones of the centres; may be empty
  std::optional<RbfSystem> system;  // none where no node is free
  std::optional<RbfTargets> targets;
};

RowMatrix centres_of(const Component& nodes, const Mesh& mesh,
                     const std::vector<Index>& surface_nodes) {
  const std::vector<Index> ids = at(surface_nodes, nodes.surface);
  return mesh.points(ids, Eigen::all);
}

// Where the field of a part is evaluated for its volume nodes. It is known about the mesh alone,
// and runs on outside: nodes of no cell beyond the ball about the mesh, such as dummies at the end
// of the world, move as the nearest point of that ball.
struct Targets {
  RowMatrix points;
  Index of_cells = 0;  // rows of nodes of cells, the first; others neither bound nor hold the field
  Index beyond = 0;    // nodes of no cell beyond the ball
};

Targets targets_of(const Part& part, const Points& base) {
  Targets targets{base(part.nodes.volume, Eigen::all),
                  std::ssize(part.nodes.volume) - part.nodes.loose, 0};
  if (part.nodes.loose == 0 || part.centres.rows() == 0) return targets;
  const Eigen::RowVector3d middle = part.centres.colwise().mean();
  const double radius =
      std::sqrt((part.centres.rowwise() - middle).rowwise().squaredNorm().maxCoeff());
  for (Index i = targets.of_cells; i < targets.points.rows(); ++i) {
    const Eigen::RowVector3d way = targets.points.row(i) - middle;
    const double distance = way.norm();
    if (distance <= radius) continue;
    targets.points.row(i) = middle + radius / distance * way;
    ++targets.beyond;
  }
  return targets;
}

// Takes surface nodes out that lie across a slit, and factors the rest.
void add_system(Part& part, const NodeScales& scales, const VolumeMorphOptions& options) {
  const auto clear = clear_of_each_other(part.centres, scales.slits(part.nodes.surface));
  part.dropped = part.centres.rows() - static_cast<Index>(clear.size());
  part.nodes.surface = at(part.nodes.surface, clear);
  part.centres = RowMatrix(part.centres(clear, Eigen::all));
  RbfOptions rbf = options.rbf;
  rbf.local_length = scales.lengths(part.nodes.surface);
  // A node without an edge gives no scale of its own: leave the choice to the solver.
  if (rbf.local_length.minCoeff() <= 0) rbf.local_length.resize(0);
  part.lengths = rbf.local_length;
  part.system.emplace(part.centres, options.kernel, rbf);
}

Part make_part(Component nodes, const Mesh& mesh, const std::vector<Index>& surface_nodes,
               const NodeScales& scales, const VolumeMorphOptions& options) {
  Part part;
  part.nodes = std::move(nodes);
  part.centres = centres_of(part.nodes, mesh, surface_nodes);
  if (part.nodes.volume.empty() || part.nodes.surface.empty()) return part;
  add_system(part, scales, options);
  const Targets targets = targets_of(part, mesh.points);
  part.beyond = targets.beyond;
  part.targets.emplace(*part.system, targets.points);
  return part;
}

Part restore_part(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                  const VolumeMorphOptions& options, InputArchive& archive) {
  Part part;
  archive(part.nodes, part.dropped, part.beyond, part.lengths);
  part.centres = centres_of(part.nodes, mesh, surface_nodes);
  if (!take<bool>(archive)) return part;
  part.system.emplace(part.centres, options.kernel, options.rbf, archive);
  part.targets.emplace(*part.system, archive);
  return part;
}

void store_part(const Part& part, OutputArchive& archive) {
  archive(part.nodes, part.dropped, part.beyond, part.lengths, part.system.has_value());
  if (!part.system) return;
  part.system->store(archive);
  part.targets->store(archive);
}

// The centres that a field rests on, or those of them that are farthest from each other.
std::vector<Index> carriers_of(const RbfSystem& system, const RbfField& field,
                               const RowMatrix& centres) {
  const double diagonal = (centres.colwise().maxCoeff() - centres.colwise().minCoeff()).norm();
  if (centres.rows() <= kMostCarriers)
    return clear_of_each_other(
        centres, Eigen::VectorXd::Constant(centres.rows(), kLeastSeparation * diagonal));
  std::vector<Index> carriers = system.kernels(field);
  if (static_cast<Index>(carriers.size()) <= kMostCarriers) return carriers;
  PointOrder order = farthest_point_order(Points(centres(carriers, Eigen::all)));
  order.rows.resize(kMostCarriers);
  return at(carriers, order.rows);
}

// Full solvers that were asked for answer without anchors: they are what others compare with.
bool is_bounded(const VolumeMorphOptions& options) {
  const SolverKind asked = options.rbf.solver;
  return (asked == SolverKind::Auto || asked == SolverKind::Adaptive) &&
         is_triharmonic_3d(options.kernel, 3);
}

// A field that anchors hold, with the first so many of them.
struct HeldField {
  RbfSystem system;
  RbfField field;
  Index anchors;
};

// `first`: centres and, counted on from these, anchors to start from.
HeldField solve_with_anchors(const Part& part, const RowMatrix& values, const Anchors& anchors,
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

// A field with what it does at the volume nodes.
struct BoundedField {
  RbfField field;
  RowMatrix displacements;
  std::string remark;
};

// How it came about.
struct HoldHistory {
  std::vector<Index> carriers;
  Anchors anchors;
  std::vector<HeldField> holds;
  std::size_t taken = 0;  // the hold that the field is of, from 1; 0: without anchors
};

// Holds a field by anchors among the volume nodes while one of them moves too far. Where centres
// that nearly coincide leave no anchors to be found, it stays as it is.
void hold_back(const Part& part, const RowMatrix& values, const RowMatrix& targets,
               const VolumeMorphOptions& options, BoundedField& bounded,
               HoldHistory* history = nullptr) {
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
void hold_back_by_cells(const Part& part, const RowMatrix& values, const Targets& targets,
                        const VolumeMorphOptions& options, BoundedField& bounded,
                        HoldHistory* history = nullptr) {
  const Index of_cells = targets.of_cells, loose = targets.points.rows() - of_cells;
  if (loose == 0) return hold_back(part, values, targets.points, options, bounded, history);
  BoundedField result{std::move(bounded.field), bounded.displacements.topRows(of_cells), {}};
  hold_back(part, values, targets.points.topRows(of_cells), options, result, history);
  bounded.displacements.topRows(of_cells) = result.displacements;
  bounded.displacements.bottomRows(loose) = result.field.evaluate(targets.points.bottomRows(loose));
  bounded.field = std::move(result.field);
  bounded.remark = std::move(result.remark);
}

// The derivative of what move_part does for these values.
FieldMap derivative_of(const Part& part, const RowMatrix& values, const Points& base,
                       const VolumeMorphOptions& options) {
  BoundedField bounded{part.system->solve(values), RowMatrix(0, 3), {}};
  bounded.displacements = part.targets->evaluate({bounded.field}).front();
  HoldHistory history;
  const Targets all = targets_of(part, base);
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

// A mesh without a free node, such as a part's surface alone, has one field nevertheless: that of
// all its nodes.
std::vector<Component> components_of(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                                     const std::vector<Index>& free_surface) {
  std::vector<Component> components = split_components(mesh, surface_nodes, free_surface);
  if (std::ranges::any_of(components, [](const Component& c) { return !c.volume.empty(); }))
    return components;
  Component all;
  for (Index i = 0; i < static_cast<Index>(surface_nodes.size()); ++i) all.surface.push_back(i);
  return {all};
}

RbfReport with_remarks(RbfReport report, const Part& part) {
  report.merged += part.dropped;
  if (part.dropped > 0)
    report.reason += "; " + std::to_string(part.dropped) + " nodes follow the other side of a slit";
  if (part.beyond > 0)
    report.reason += "; " + std::to_string(part.beyond) +
                     " nodes of no element lie outside and move as the mesh does next to them";
  return report;
}

// Components report side by side: one at a time.
VolumeMorphOptions with_serial_progress(VolumeMorphOptions options) {
  if (!options.rbf.progress) return options;
  const auto mutex = std::make_shared<std::mutex>();
  options.rbf.progress = [mutex, progress = options.rbf.progress](auto&&... figures) {
    const std::lock_guard lock(*mutex);
    return progress(figures...);
  };
  return options;
}

// Sums and worst figures of several systems; solver and reason of the largest.
RbfReport combine(const std::vector<RbfReport>& reports) {
  RbfReport all;
  Index largest = -1;
  for (const RbfReport& r : reports) {
    if (r.centres > largest) {
      largest = r.centres;
      all.solver = r.solver;
      all.reason = r.reason;
      all.polynomial_terms = r.polynomial_terms;
      all.reciprocal_condition = r.reciprocal_condition;
    }
    all.centres += r.centres;
    all.merged += r.merged;
    all.iterations = std::max(all.iterations, r.iterations);
    all.max_residual = std::max(all.max_residual, r.max_residual);
    all.seconds += r.seconds;
  }
  if (reports.size() > 1)
    all.reason += "; " + std::to_string(reports.size()) + " components one by one";
  return all;
}

void check_positions(const Points& positions, const std::vector<Index>& surface_nodes) {
  if (positions.rows() != static_cast<Index>(surface_nodes.size()))
    throw InvalidInputError(std::to_string(positions.rows()) + " positions for " +
                            std::to_string(surface_nodes.size()) + " surface nodes");
  for (Index i = 0; i < positions.rows(); ++i)
    if (!positions.row(i).allFinite())
      throw InvalidInputError("the new position of surface node " +
                              std::to_string(surface_nodes[i]) + " is not finite");
}

}  // namespace

struct VolumeMorph::Impl {
  Points base;
  std::vector<Index> surface_nodes;
  VolumeMorphOptions options;
  NodeScales scales;
  std::vector<Part> parts;
  std::unique_ptr<Baseline> baseline;  // in place of the parts when the method is not RBF
  RbfReport report;

  void set_up_rbf(const Mesh& mesh, const std::vector<Index>& free_surface);
  void restore_rbf(const Mesh& mesh, InputArchive& archive);
  void set_up_baseline(const Mesh& mesh);
  void gather_reports();
  Points morph_by_baseline(const Points& surface_positions, RbfReport* figures) const;
  void morph_by_rbf(const std::vector<Points>& surface_positions,
                    std::vector<VolumeMorphResult>& results) const;
  // Figures or error of one component in each of several morphs; neither where it was left out.
  struct PartFigures {
    std::vector<std::optional<RbfReport>> reports;
    std::vector<std::exception_ptr> errors;
  };
  PartFigures move_part(const Part& part, const std::vector<Points>& surface_positions,
                        std::vector<VolumeMorphResult>& results) const;
};

void VolumeMorph::Impl::set_up_rbf(const Mesh& mesh, const std::vector<Index>& free_surface) {
  scales = node_scales(mesh, surface_nodes, options.rbf);
  std::vector<Component> components = components_of(mesh, surface_nodes, free_surface);
  parts.resize(components.size());
  const VolumeMorphOptions guarded = with_serial_progress(options);
  parallel_for(static_cast<Index>(parts.size()), 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      parts[i] = make_part(std::move(components[i]), mesh, surface_nodes, scales, guarded);
  });
  gather_reports();
}

void VolumeMorph::Impl::restore_rbf(const Mesh& mesh, InputArchive& archive) {
  const VolumeMorphOptions guarded = with_serial_progress(options);
  archive(scales.lengths, scales.slits);
  const auto count = take<std::size_t>(archive);
  for (std::size_t i = 0; i < count; ++i)
    parts.push_back(restore_part(mesh, surface_nodes, guarded, archive));
  gather_reports();
}

void VolumeMorph::Impl::gather_reports() {
  std::vector<RbfReport> reports;
  for (const Part& part : parts)
    if (part.system) reports.push_back(with_remarks(part.system->report(), part));
  report = combine(reports);
}

void VolumeMorph::Impl::set_up_baseline(const Mesh& mesh) {
  const Stopwatch watch;
  baseline = make_baseline(options.method, mesh, surface_nodes);
  report.centres = static_cast<Index>(surface_nodes.size());
  report.seconds = watch.seconds();
}

Points VolumeMorph::Impl::morph_by_baseline(const Points& surface_positions,
                                            RbfReport* figures) const {
  const Stopwatch watch;
  Points result = base + baseline->displacements(surface_positions -
                                                 RowMatrix(base(surface_nodes, Eigen::all)));
  for (std::size_t i = 0; i < surface_nodes.size(); ++i)
    result.row(surface_nodes[i]) = surface_positions.row(i);
  if (figures) {
    *figures = report;
    figures->seconds += watch.seconds();
  }
  return result;
}

// Moves the volume nodes of one component in all results that have no error. Components share no
// volume node: several may do so at once.
VolumeMorph::Impl::PartFigures VolumeMorph::Impl::move_part(
    const Part& part, const std::vector<Points>& surface_positions,
    std::vector<VolumeMorphResult>& results) const {
  PartFigures figures{std::vector<std::optional<RbfReport>>(results.size()),
                      std::vector<std::exception_ptr>(results.size())};
  std::vector<std::size_t> sound;
  std::vector<RowMatrix> values;
  for (std::size_t r = 0; r < results.size(); ++r) {
    if (results[r].error) continue;
    sound.push_back(r);
    values.push_back(surface_positions[r](part.nodes.surface, Eigen::all) - part.centres);
  }
  std::vector<RbfSolution> solutions = part.system->solve_each(values);
  std::vector<RbfField> fields;
  std::vector<std::size_t> solved;
  for (std::size_t s = 0; s < sound.size(); ++s) {
    figures.errors[sound[s]] = solutions[s].error;
    if (solutions[s].error) continue;
    solved.push_back(sound[s]);
    if (solved.size() - 1 != s) values[solved.size() - 1] = std::move(values[s]);
    figures.reports[sound[s]] = with_remarks(solutions[s].field.report(), part);
    fields.push_back(std::move(solutions[s].field));
  }
  std::vector<RowMatrix> displacements = part.targets->evaluate(fields);
  const Targets targets = targets_of(part, base);
  for (std::size_t s = 0; s < solved.size(); ++s) {
    const std::size_t r = solved[s];
    BoundedField bounded{std::move(fields[s]), std::move(displacements[s]), {}};
    hold_back_by_cells(part, values[s], targets, options, bounded);
    figures.reports[r]->reason += bounded.remark;
    for (std::size_t i = 0; i < part.nodes.volume.size(); ++i)
      results[r].positions.row(part.nodes.volume[i]) += bounded.displacements.row(i);
  }
  return figures;
}

void VolumeMorph::Impl::morph_by_rbf(const std::vector<Points>& surface_positions,
                                     std::vector<VolumeMorphResult>& results) const {
  for (VolumeMorphResult& result : results)
    if (!result.error) result.positions = base;
  std::vector<PartFigures> figures(parts.size());
  parallel_for(static_cast<Index>(parts.size()), 1, [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p)
      if (parts[p].system) figures[p] = move_part(parts[p], surface_positions, results);
  });
  for (std::size_t r = 0; r < results.size(); ++r) {
    std::vector<RbfReport> reports;
    for (const PartFigures& part : figures) {
      if (part.errors.empty()) continue;
      if (part.reports[r]) reports.push_back(*part.reports[r]);
      if (!results[r].error) results[r].error = part.errors[r];
    }
    if (results[r].error) continue;
    results[r].report = combine(reports);
    for (std::size_t i = 0; i < surface_nodes.size(); ++i)
      results[r].positions.row(surface_nodes[i]) = surface_positions[r].row(i);
  }
}

VolumeMorph::VolumeMorph(const Mesh& mesh, std::vector<Index> surface_nodes,
                         VolumeMorphOptions options, const std::vector<Index>& free_surface) {
  if (surface_nodes.empty()) throw InvalidInputError("no surface node to prescribe");
  check_nodes(mesh.node_count(), surface_nodes);
  auto impl = std::make_shared<Impl>();
  impl->base = mesh.points;
  impl->surface_nodes = std::move(surface_nodes);
  impl->options = std::move(options);
  if (impl->options.method == MorphMethod::Rbf)
    impl->set_up_rbf(mesh, free_surface);
  else
    impl->set_up_baseline(mesh);
  impl_ = std::move(impl);
}

VolumeMorph::VolumeMorph(const Mesh& mesh, VolumeMorphOptions options, InputArchive& archive) {
  auto impl = std::make_shared<Impl>();
  impl->base = mesh.points;
  impl->surface_nodes = take<std::vector<Index>>(archive);
  impl->options = std::move(options);
  if (impl->options.method == MorphMethod::Rbf)
    impl->restore_rbf(mesh, archive);
  else
    impl->set_up_baseline(mesh);
  impl_ = std::move(impl);
}

void VolumeMorph::store(OutputArchive& archive) const {
  archive(impl_->surface_nodes);
  if (impl_->baseline) return;
  archive(impl_->scales.lengths, impl_->scales.slits, impl_->parts.size());
  for (const Part& part : impl_->parts) store_part(part, archive);
}

Points VolumeMorph::morph(const Points& surface_positions, RbfReport* report) const {
  VolumeMorphResult result = std::move(morph_each({surface_positions}).front());
  if (result.error) std::rethrow_exception(result.error);
  if (report) *report = std::move(result.report);
  return std::move(result.positions);
}

std::vector<VolumeMorphResult> VolumeMorph::morph_each(
    const std::vector<Points>& surface_positions) const {
  std::vector<VolumeMorphResult> results(surface_positions.size());
  for (std::size_t r = 0; r < results.size(); ++r) {
    try {
      check_positions(surface_positions[r], impl_->surface_nodes);
      if (impl_->baseline)
        results[r].positions = impl_->morph_by_baseline(surface_positions[r], &results[r].report);
    } catch (const Error&) {
      results[r].error = std::current_exception();
    }
  }
  if (!impl_->baseline) impl_->morph_by_rbf(surface_positions, results);
  return results;
}

std::vector<RbfField> VolumeMorph::fields(const Points& surface_positions) const {
  check_positions(surface_positions, impl_->surface_nodes);
  if (impl_->baseline)
    throw InvalidInputError("a morph by " + to_string(impl_->options.method) +
                            " has no field; use the RBF method");
  std::vector<RbfField> result;
  for (const Part& part : impl_->parts) {
    if (part.nodes.surface.empty()) continue;
    Part whole = part;
    if (!whole.system) add_system(whole, impl_->scales, impl_->options);
    const RowMatrix values = surface_positions(whole.nodes.surface, Eigen::all) - whole.centres;
    RowMatrix targets = targets_of(whole, impl_->base).points;
    targets.conservativeResize(targets.rows() - whole.nodes.loose, 3);
    BoundedField bounded{whole.system->solve(values), RowMatrix(0, 3), {}};
    if (targets.rows() > 0) {
      bounded.displacements = bounded.field.evaluate(targets);
      hold_back(whole, values, targets, impl_->options, bounded);
    }
    result.push_back(std::move(bounded.field));
  }
  return result;
}

VolumeDerivative VolumeMorph::derivative(const Points& surface_positions) const {
  const Impl& s = *impl_;
  check_positions(surface_positions, s.surface_nodes);
  if (s.baseline)
    throw InvalidInputError("a morph by " + to_string(s.options.method) +
                            " has no derivative here; use the RBF method");
  std::vector<VolumeDerivative::Part> parts(s.parts.size());
  parallel_for(std::ssize(parts), 1, [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p) {
      const Part& part = s.parts[p];
      if (!part.system) continue;
      const RowMatrix values = surface_positions(part.nodes.surface, Eigen::all) - part.centres;
      parts[p] = {part.nodes.surface, part.nodes.volume,
                  derivative_of(part, values, s.base, s.options)};
    }
  });
  std::erase_if(parts, [](const auto& part) { return part.volume.empty(); });
  return {s.base.rows(), s.surface_nodes, std::move(parts)};
}

VolumeMorph::HoldCheck VolumeMorph::hold_check() const {
  const Impl& s = *impl_;
  HoldCheck result;
  if (s.baseline || !is_bounded(s.options)) return result;
  for (const Part& part : s.parts) {
    if (!part.system) continue;
    const Targets targets = targets_of(part, s.base);
    if (targets.of_cells == 0) continue;
    result.parts_.push_back(
        {part.nodes.surface, part.centres,
         OvershootCheck(part.centres, s.options.kernel, targets.points.topRows(targets.of_cells))});
  }
  return result;
}

bool VolumeMorph::HoldCheck::may_be_held(const Points& surface_positions) const {
  return std::ranges::any_of(parts_, [&](const Part& part) {
    return part.check.may_overshoot(surface_positions(part.surface, Eigen::all) - part.centres);
  });
}

Index VolumeMorph::field_count() const {
  return std::ranges::count_if(impl_->parts,
                               [](const Part& part) { return !part.nodes.surface.empty(); });
}

const RbfReport& VolumeMorph::report() const { return impl_->report; }

const std::vector<Index>& VolumeMorph::surface_nodes() const { return impl_->surface_nodes; }

const VolumeMorphOptions& VolumeMorph::options() const { return impl_->options; }

}  // namespace cadmorph
