#include "apps/pipeline/sliding.h"

#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

constexpr double kSamePlace = 1e-9;  // of the diagonal

}  // namespace

const SlidingNodes* Sliding::nodes() {
  if (nodes_) return &*nodes_;
  // Those of a plane mesh within faces need no surface to stay in the plane.
  return &nodes_.emplace(slide_on_cad(variant_, base_.association(), base_.boundary,
                                      result_.surface, is_in_plane(result_)));
}

Index Sliding::turned_facets(const Points& positions, const RowMatrix& slides) const {
  return count_turned_facets(base_.mesh(), base_.association(), base_.boundary, *nodes_, positions,
                             slides);
}

void take_volume(MorphResult& result, MorphResult& from) {
  result.positions = std::move(from.positions);
  result.validity = std::move(from.validity);
  result.report.solver = std::move(from.report.solver);
  result.report.stepping = std::move(from.report.stepping);
  result.report.untangling = std::move(from.report.untangling);
}

double same_place(const MorphResult& result) {
  return kSamePlace * result.variant->diagonal() / result.base->association().mesh_unit_mm;
}

bool is_in_plane(const MorphResult& result) {
  const Mesh& mesh = result.base->mesh();
  return !plane_normal(mesh, mesh.points, result.positions).isZero(0);
}

std::vector<char> nodes_to_leave(const MorphResult& result) {
  const BaseSide& base = *result.base;
  const Mesh& mesh = base.mesh();
  std::vector<char> leave = base.fixed_nodes();
  for (const Index node : base.boundary.nodes) leave[node] = 1;
  if (!is_in_plane(result)) return leave;
  const std::vector<char> is_border = border_nodes(mesh, mesh.points);
  const Association& association = base.association();
  for (const RowId row : association.dimension.ids())
    if (const Index node = base.boundary.nodes[row];
        association.dimension[row] == CadDimension::Face && !association.is_amid[row] &&
        result.surface.positions.row(row) != mesh.points.row(node))
      leave[node] = is_border[node];
  for (const Index c : base.misordered)
    for (const Index node : mesh.cell(c)) leave[node] = 1;
  return leave;
}

void settle_slid_nodes(const BaseSide& base, MorphResult& result) {
  SurfaceMorphResult& surface = result.surface;
  for (std::size_t i = 0; i < base.boundary.nodes.size(); ++i)
    if (surface.beyond_wires[i] > 0 &&
        result.positions.row(base.boundary.nodes[i]) != surface.positions.row(i))
      surface.distance[i] -= std::exchange(surface.beyond_wires[i], 0);
}

}  // namespace cadmorph
