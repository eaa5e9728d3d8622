#include "apps/bench/given_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

#include "cad/projector.h"
#include "core/errors.h"
#include "surface/surface_mesh.h"
#include "volume/baselines/interior_system.h"

namespace cadmorph::bench {
namespace {

using Eigen::Vector3d;
using Triangle = std::array<RowId, 3>;

// Feet farther than this part of the CAD's diagonal are searched for anew: of nodes that lie on
// their face, whose feet are far nearer, but for wrong ones. A smaller part costs time alone.
constexpr double kFarFoot = 0.02;

// Triangles of each face. A quad counts as both its pairs of triangles.
IdVector<FaceId, std::vector<Triangle>> face_triangles(const Boundary& boundary,
                                                       const Association& association,
                                                       std::size_t faces) {
  IdVector<FaceId, std::vector<Triangle>> result(faces);
  for (const FacetId f : association.facet_face.ids()) {
    if (association.facet_face[f] < 0) continue;
    auto& triangles = result[association.facet_face[f]];
    const auto nodes = boundary.facet(f);
    const auto corner = [&](std::size_t i) { return row_of(boundary, nodes[i % nodes.size()]); };
    if (nodes.size() == 3) triangles.push_back({corner(0), corner(1), corner(2)});
    if (nodes.size() > 3)
      for (std::size_t i = 0; i < nodes.size(); ++i)
        triangles.push_back({corner(i), corner(i + 1), corner(i + 2)});
  }
  return result;
}

// Adds the linear element's stiffness: minus half the cotangent of the angle opposite to an edge.
void add_triangle(const Points& base, const Triangle& triangle, const std::map<RowId, int>& local,
                  std::vector<MatrixEntry>& entries) {
  for (int i = 0; i < 3; ++i) {
    const RowId a = triangle[(i + 1) % 3], b = triangle[(i + 2) % 3];
    const Vector3d u = base.row(a) - base.row(triangle[i]), v = base.row(b) - base.row(triangle[i]);
    const double area = u.cross(v).norm();
    if (area == 0) continue;
    const double half_cotangent = u.dot(v) / (2 * area);
    const int p = local.at(a), q = local.at(b);
    entries.emplace_back(p, q, -half_cotangent);
    entries.emplace_back(q, p, -half_cotangent);
    entries.emplace_back(p, p, half_cotangent);
    entries.emplace_back(q, q, half_cotangent);
  }
}

Vector3d nearest_on_face(const CadModel& variant, FaceId face, const Vector3d& x,
                         const Eigen::Vector2d& seed) {
  const FaceFoot near = project_on_face(variant, face, x, seed);
  if (near.distance < kFarFoot * variant.diagonal()) return near.point;
  const FaceFoot anywhere = project_globally(variant, face, x);
  return anywhere.distance < near.distance ? anywhere.point : near.point;
}

}  // namespace

Points harmonic_surface(const Points& base, const Boundary& boundary,
                        const Association& association, const CadModel& variant,
                        const TopologyMatch& match, const Points& positions) {
  Points result = positions;
  const auto faces = face_triangles(boundary, association, match.faces.size());
  for (const FaceId face : faces.ids()) {
    std::map<RowId, int> local;
    for (const Triangle& triangle : faces[face])
      for (const RowId row : triangle) local.emplace(row, static_cast<int>(local.size()));
    std::vector<MatrixEntry> entries;
    for (const Triangle& triangle : faces[face]) add_triangle(base, triangle, local, entries);
    const auto is_inside = [&](RowId row) {
      return association.dimension[row] == CadDimension::Face && association.face(row) == face;
    };
    std::vector<Index> held;
    Points displacements(local.size(), 3);
    for (const auto& [row, number] : local) {
      if (is_inside(row)) continue;
      displacements.row(held.size()) = positions.row(row) - base.row(row);
      held.push_back(number);
    }
    if (held.empty() || held.size() == local.size()) continue;  // closed, or nothing inside
    const InteriorSystem system(static_cast<Index>(local.size()), held, entries,
                                InteriorSystem::Symmetry::PositiveDefinite);
    const Points moved = system.solve(displacements.topRows(held.size()));
    const double unit = association.mesh_unit_mm;
    for (const auto& [row, number] : local)
      if (is_inside(row))
        result.row(row) = nearest_on_face(variant, match.faces[face],
                                          unit * (base.row(row) + moved.row(number)).transpose(),
                                          association.uv.row(row)) /
                          unit;
  }
  return result;
}

}  // namespace cadmorph::bench
