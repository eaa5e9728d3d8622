#include "volume/volume_morph.h"

#include <optional>
#include <utility>

#include "core/errors.h"
#include "volume/edge_lengths.h"

namespace cadmorph {
namespace {

RowMatrix rows_of(const Points& points, const std::vector<Index>& rows) {
  RowMatrix result(rows.size(), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(i) = points.row(rows[i]);
  return result;
}

std::vector<Index> free_nodes(Index count, const std::vector<Index>& surface_nodes) {
  std::vector<char> is_surface(count, 0);
  for (const Index node : surface_nodes) {
    if (node < 0 || node >= count)
      throw InvalidInputError("surface node " + std::to_string(node) + " is not in the mesh of " +
                              std::to_string(count) + " nodes");
    if (std::exchange(is_surface[node], 1))
      throw InvalidInputError("surface node " + std::to_string(node) + " is prescribed twice");
  }
  std::vector<Index> result;
  for (Index n = 0; n < count; ++n)
    if (!is_surface[n]) result.push_back(n);
  return result;
}

RbfOptions with_local_lengths(RbfOptions options, const Mesh& mesh,
                              const std::vector<Index>& surface_nodes) {
  if (options.local_length.size() > 0) return options;
  const Eigen::VectorXd lengths = shortest_incident_edges(mesh);
  options.local_length.resize(surface_nodes.size());
  for (std::size_t i = 0; i < surface_nodes.size(); ++i)
    options.local_length[i] = lengths[surface_nodes[i]];
  // A node without an edge gives no scale of its own: leave the choice to the solver.
  if (options.local_length.minCoeff() <= 0) options.local_length.resize(0);
  return options;
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
  std::vector<Index> volume_nodes;
  VolumeMorphOptions options;
  RowMatrix centres;
  RowMatrix targets;
  std::optional<RbfSystem> system;
  RbfReport no_report;
};

VolumeMorph::VolumeMorph(const Mesh& mesh, std::vector<Index> surface_nodes,
                         VolumeMorphOptions options) {
  if (surface_nodes.empty()) throw InvalidInputError("no surface node to prescribe");
  auto impl = std::make_shared<Impl>();
  impl->base = mesh.points;
  impl->volume_nodes = free_nodes(mesh.node_count(), surface_nodes);
  impl->centres = rows_of(mesh.points, surface_nodes);
  impl->targets = rows_of(mesh.points, impl->volume_nodes);
  if (!impl->volume_nodes.empty())
    impl->system.emplace(impl->centres, options.kernel,
                         with_local_lengths(options.rbf, mesh, surface_nodes));
  impl->surface_nodes = std::move(surface_nodes);
  impl->options = std::move(options);
  impl_ = std::move(impl);
}

Points VolumeMorph::morph(const Points& surface_positions, RbfReport* report) const {
  check_positions(surface_positions, impl_->surface_nodes);
  Points result = impl_->base;
  if (impl_->system) {
    const RbfField field = impl_->system->solve(surface_positions - impl_->centres);
    const RowMatrix displacements = field.evaluate(impl_->targets);
    for (std::size_t i = 0; i < impl_->volume_nodes.size(); ++i)
      result.row(impl_->volume_nodes[i]) += displacements.row(i);
    if (report) *report = field.report();
  }
  for (std::size_t i = 0; i < impl_->surface_nodes.size(); ++i)
    result.row(impl_->surface_nodes[i]) = surface_positions.row(i);
  return result;
}

const RbfReport& VolumeMorph::report() const {
  return impl_->system ? impl_->system->report() : impl_->no_report;
}

const std::vector<Index>& VolumeMorph::surface_nodes() const { return impl_->surface_nodes; }

const VolumeMorphOptions& VolumeMorph::options() const { return impl_->options; }

}  // namespace cadmorph
