#include "surface/straight_nodes.h"

#include <algorithm>

#include "surface/node_feet.h"

namespace cadmorph {
namespace {

// Of the edge's length: above what formats of single precision leave, below what an edge that
// follows a curve bends.
constexpr double kStraight = 1e-4;

double tolerance_of(const CadModel& model, CadDimension dimension, int entity) {
  switch (dimension) {
    case CadDimension::Vertex:
      return model.vertices()[VertexId(entity)].tolerance;
    case CadDimension::Edge:
      return model.edges()[EdgeId(entity)].tolerance;
    default:
      return model.faces()[FaceId(entity)].tolerance;
  }
}

// Whether a facet of the node lies on one CAD face with all its corners.
bool is_on_voted_facet(const SurfaceMesh& surface, const Association& association, RowId n) {
  return std::ranges::any_of(surface.facets_at(n),
                             [&](FacetId f) { return association.facet_face[f] >= 0; });
}

bool is_off(const CadModel& model, const SurfaceMesh& surface, const Association& association,
            RowId n) {
  if (association.dimension[n] == CadDimension::None) return true;
  return association.distance[n] >
         tolerance_of(model, association.dimension[n], association.entity[n]) +
             kOnEntity * surface.local_length[n];
}

bool is_amid_corners(const SurfaceMesh& surface, const Association& association, RowId n) {
  if (!is_amid_straight(surface, n) || !is_on_voted_facet(surface, association, n)) return false;
  for (const RowId corner : surface.between[n])
    if (corner >= 0 && association.dimension[corner] == CadDimension::None) return false;
  return true;
}

}  // namespace

bool is_amid_straight(const SurfaceMesh& surface, RowId node) {
  if (surface.is_corner(node)) return false;
  const Eigen::Vector3d x = surface.points.row(node);
  return (surface.middle(node, surface.points) - x).norm() <= kStraight * surface.own_length[node];
}

void find_straight_nodes(const CadModel& model, const SurfaceMesh& surface,
                         const IdVector<RowId, char>& is_off_voted, Association& association) {
  for (const RowId n : association.dimension.ids())
    association.is_amid[n] = (is_off_voted[n] || is_off(model, surface, association, n)) &&
                             is_amid_corners(surface, association, n);
  for (const RowId n : association.dimension.ids()) {
    if (!association.is_amid[n]) continue;
    association.dimension[n] = CadDimension::None;
    association.entity[n] = -1;
    association.uv.row(n).setZero();
    association.distance[n] = 0;
  }
}

}  // namespace cadmorph
