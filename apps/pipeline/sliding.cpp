#include "apps/pipeline/sliding.h"

#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

// Of the diagonal: far above rounding, far below the 1e-6 of the closest nodes in a graded mesh.
constexpr double kSamePlace = 1e-9;

}  // namespace

const SlidingNodes* Sliding::nodes() {
  if (nodes_) return &*nodes_;
  const Mesh& mesh = base_.mesh();
  // Those of a plane mesh within faces need no surface to stay in the plane.
  const bool is_in_plane = !plane_normal(mesh, mesh.points, result_.positions).isZero(0);
  return &nodes_.emplace(
      slide_on_cad(variant_, base_.association(), base_.boundary, result_.surface, is_in_plane));
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

void settle_slid_nodes(const BaseSide& base, MorphResult& result) {
  SurfaceMorphResult& surface = result.surface;
  for (std::size_t i = 0; i < base.boundary.nodes.size(); ++i)
    if (surface.beyond_wires[i] > 0 &&
        result.positions.row(base.boundary.nodes[i]) != surface.positions.row(i))
      surface.distance[i] -= std::exchange(surface.beyond_wires[i], 0);
}

}  // namespace cadmorph
