#include "volume/volume_morph.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "core/archive_types.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "volume/baselines/baseline.h"
#include "volume/components.h"
#include "volume/held_field.h"
#include "volume/morph_part.h"

namespace cadmorph {
namespace {

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

RbfReport with_remarks(RbfReport report, const MorphPart& part) {
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
  std::vector<MorphPart> parts;
  std::unique_ptr<Baseline> baseline;  // in place of the parts when the method is not RBF
  RbfReport report;

  void set_up_rbf(const Mesh& mesh, const std::vector<Index>& free_surface);
  void restore_rbf(const Mesh& mesh, InputArchive& archive);
  void set_up_baseline(const Mesh& mesh);
  void gather_reports();
  void require_derivative() const;
  Points morph_by_baseline(const Points& surface_positions, RbfReport* figures) const;
  void morph_by_rbf(const std::vector<Points>& surface_positions,
                    std::vector<VolumeMorphResult>& results) const;
  // Figures or error of one component in each of several morphs; neither where it was left out.
  struct PartFigures {
    std::vector<std::optional<RbfReport>> reports;
    std::vector<std::exception_ptr> errors;
  };
  PartFigures move_part(const MorphPart& part, const std::vector<Points>& surface_positions,
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
  for (const MorphPart& part : parts)
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

struct VolumeMorph::Linear {
  VolumeDerivative map;
  RbfReport report;

  VolumeMorphResult morph(const Points& base, const Points& surface_positions) const;
};

VolumeMorphResult VolumeMorph::Linear::morph(const Points& base,
                                             const Points& surface_positions) const {
  const Stopwatch watch;
  const std::vector<Index>& nodes = map.surface_nodes();
  VolumeMorphResult result;
  result.positions = base + Points(map.forward(surface_positions - base(nodes, Eigen::all)));
  result.positions(nodes, Eigen::all) = surface_positions;
  result.report = report;
  result.report.seconds += watch.seconds();
  return result;
}

// Moves the volume nodes of one component in all results that have no error. Components share no
// volume node: several may do so at once.
VolumeMorph::Impl::PartFigures VolumeMorph::Impl::move_part(
    const MorphPart& part, const std::vector<Points>& surface_positions,
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
  const PartTargets targets = targets_of(part, base);
  for (std::size_t s = 0; s < solved.size(); ++s) {
    const std::size_t r = solved[s];
    BoundedField bounded{std::move(fields[s]), std::move(displacements[s]), {}};
    hold_back(part, values[s], targets, options, bounded);
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
  if (linear_)
    throw InvalidInputError("a linearised volume morph can't be stored; store it before");
  archive(impl_->surface_nodes);
  if (impl_->baseline) return;
  archive(impl_->scales.lengths, impl_->scales.slits, impl_->parts.size());
  for (const MorphPart& part : impl_->parts) store_part(part, archive);
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
      if (linear_)
        results[r] = linear_->morph(impl_->base, surface_positions[r]);
      else if (impl_->baseline)
        results[r].positions = impl_->morph_by_baseline(surface_positions[r], &results[r].report);
    } catch (const Error&) {
      results[r].error = std::current_exception();
    }
  }
  if (!linear_ && !impl_->baseline) impl_->morph_by_rbf(surface_positions, results);
  return results;
}

std::vector<RbfField> VolumeMorph::fields(const Points& surface_positions) const {
  check_positions(surface_positions, impl_->surface_nodes);
  if (impl_->baseline)
    throw InvalidInputError("a morph by " + to_string(impl_->options.method) +
                            " has no field; use the RBF method");
  if (linear_)
    throw InvalidInputError("a linearised volume morph has no fields; take those of the plain one");
  std::vector<RbfField> result;
  for (const MorphPart& part : impl_->parts) {
    if (part.nodes.surface.empty()) continue;
    MorphPart whole = part;
    if (!whole.system) add_system(whole, impl_->scales, impl_->options);
    const RowMatrix values = surface_positions(whole.nodes.surface, Eigen::all) - whole.centres;
    PartTargets targets = targets_of(whole, impl_->base);
    targets.points.conservativeResize(targets.of_cells, 3);
    BoundedField bounded{whole.system->solve(values), RowMatrix(0, 3), {}};
    if (targets.of_cells > 0) {
      bounded.displacements = bounded.field.evaluate(targets.points);
      hold_back(whole, values, targets, impl_->options, bounded);
    }
    result.push_back(std::move(bounded.field));
  }
  return result;
}

void VolumeMorph::Impl::require_derivative() const {
  if (baseline)
    throw InvalidInputError("a morph by " + to_string(options.method) +
                            " has no derivative here; use the RBF method");
}

VolumeDerivative VolumeMorph::derivative(const Points& surface_positions) const {
  const Impl& s = *impl_;
  check_positions(surface_positions, s.surface_nodes);
  if (linear_) return linear_->map;
  s.require_derivative();
  std::vector<VolumeDerivative::Part> parts(s.parts.size());
  parallel_for(std::ssize(parts), 1, [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p) {
      const MorphPart& part = s.parts[p];
      if (!part.system) continue;
      const RowMatrix values = surface_positions(part.nodes.surface, Eigen::all) - part.centres;
      parts[p] = {part.nodes.surface, part.nodes.volume,
                  held_derivative(part, values, s.base, s.options)};
    }
  });
  std::erase_if(parts, [](const auto& part) { return part.volume.empty(); });
  return {s.base.rows(), s.surface_nodes, std::move(parts)};
}

VolumeMorph VolumeMorph::linearised(const std::vector<Points>& references) const {
  const Impl& s = *impl_;
  const Stopwatch watch;
  s.require_derivative();
  if (references.empty()) throw InvalidInputError("no motion is given to linearise a morph for");
  const Points start = s.base(s.surface_nodes, Eigen::all);
  bool is_moving = false;
  for (const Points& positions : references) {
    check_positions(positions, s.surface_nodes);
    is_moving |= positions != start;
  }
  if (!is_moving)
    throw InvalidInputError("no motion that is given to linearise a morph for moves a node");
  std::vector<LinearField> fields(s.parts.size());
  parallel_for(std::ssize(fields), 1, [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p) {
      const MorphPart& part = s.parts[p];
      if (!part.system) continue;
      std::vector<RowMatrix> motions;
      for (const Points& positions : references)
        motions.emplace_back(positions(part.nodes.surface, Eigen::all) - part.centres);
      fields[p] = linear_field(part, motions, s.base, s.options);
    }
  });
  std::vector<VolumeDerivative::Part> parts;
  Index kernels = 0, anchors = 0;
  double overshoot = 0;
  for (std::size_t p = 0; p < fields.size(); ++p) {
    if (!s.parts[p].system) continue;
    kernels += fields[p].kernels;
    anchors += fields[p].anchors;
    overshoot = std::max(overshoot, fields[p].overshoot);
    parts.push_back({s.parts[p].nodes.surface, s.parts[p].nodes.volume, std::move(fields[p].map)});
  }
  RbfReport report = s.report;
  report.reason += "; a linear map of " + std::to_string(kernels) + " kernels and " +
                   std::to_string(anchors) + " anchors, chosen for " +
                   std::to_string(references.size()) + " motions";
  if (is_bounded(s.options) && overshoot > kMostOvershoot) {
    char text[80];
    std::snprintf(text, sizeof text, ", which runs on to %.3g times one of them", overshoot);
    report.reason += text;
  }
  report.seconds = watch.seconds();
  VolumeMorph result = *this;
  result.linear_ = std::make_shared<const Linear>(
      Linear{{s.base.rows(), s.surface_nodes, std::move(parts)}, std::move(report)});
  return result;
}

VolumeMorph::HoldCheck VolumeMorph::hold_check() const {
  const Impl& s = *impl_;
  HoldCheck result;
  if (linear_ || s.baseline || !is_bounded(s.options)) return result;
  for (const MorphPart& part : s.parts) {
    if (!part.system) continue;
    const PartTargets targets = targets_of(part, s.base);
    if (targets.of_cells == 0) continue;
    result.parts_.push_back(
        {part.nodes.surface, part.centres, *part.system, *part.targets, targets.of_cells,
         OvershootCheck(part.centres, s.options.kernel, targets.points.topRows(targets.of_cells))});
  }
  return result;
}

bool VolumeMorph::HoldCheck::Part::may_be_held(const RowMatrix& values) const {
  const OvershootGuess guess = check.guess(values);
  if (guess != OvershootGuess::Unknown) return guess == OvershootGuess::Likely;
  const RowMatrix moved = targets.evaluate({system.solve(values)}).front();
  return overshoot(values, moved.topRows(of_cells)) > kMostOvershoot;
}

bool VolumeMorph::HoldCheck::may_be_held(const Points& surface_positions) const {
  return std::ranges::any_of(parts_, [&](const Part& part) {
    return part.may_be_held(surface_positions(part.surface, Eigen::all) - part.centres);
  });
}

Index VolumeMorph::field_count() const {
  return std::ranges::count_if(impl_->parts,
                               [](const MorphPart& part) { return !part.nodes.surface.empty(); });
}

const RbfReport& VolumeMorph::report() const { return linear_ ? linear_->report : impl_->report; }

const std::vector<Index>& VolumeMorph::surface_nodes() const { return impl_->surface_nodes; }

const VolumeMorphOptions& VolumeMorph::options() const { return impl_->options; }

}  // namespace cadmorph
