#include "surface/face_folds.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <optional>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Sine of the turn at a straight corner, as where a coarser cell's edge meets those of two finer
// ones: what the digits of a mesh file leave of it. It may come out on either side.
constexpr double kStraight = 1e-4;

// At a pole one parameter is arbitrary, and so is the normal that it gives.
bool is_at_pole(const FaceSide& side, Index i, double local_length) {
  const CadFace& f = side.model.faces()[side.face];
  const SurfacePoint s = side.model.evaluate(side.face, side.uv.row(i));
  const Vector2d size = f.upper - f.lower;
  return std::min(s.du.norm() * size[0], s.dv.norm() * size[1]) < 0.1 * local_length;
}

Vector3d normal_at(const FaceSide& side, Index i) {
  return side.model.normal(side.face, side.uv.row(i));
}

}  // namespace

FaceFolds::FaceFolds(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                     const std::vector<RowId>& rows, const FaceSide& before) {
  std::vector<Vector3d> normals(rows.size(), Vector3d::Zero());  // none at poles
  parallel_for(std::ssize(rows), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (!is_at_pole(before, i, surface.local_length[rows[i]])) normals[i] = normal_at(before, i);
  });
  for (const FacetId f : facets) {
    facets_.push_back({.facet = f,
                       .inward_corners = surface.corners[f] > 3
                                             ? inward_corners(surface, before.points, f, kStraight)
                                             : 0,
                       .first = static_cast<int>(witnesses_.size())});
    const Vector3d area = area_vector(surface, before.points, f);
    for (const RowId n : surface.facets[f]) {
      const auto it = std::ranges::lower_bound(rows, n);
      if (it == rows.end() || *it != n) continue;
      const auto node = static_cast<int>(it - rows.begin());
      const double facing = area.dot(normals[node]);
      if (facing != 0) witnesses_.push_back({node, facing > 0});
    }
  }
}

std::vector<FacetId> FaceFolds::find(const SurfaceMesh& surface, const FaceSide& after) const {
  std::vector<FacetId> turned, kept, dented;
  std::vector<std::optional<Vector3d>> normals(after.uv.rows());
  for (std::size_t i = 0; i < facets_.size(); ++i) {
    const Facet& facet = facets_[i];
    if (surface.corners[facet.facet] > 3 &&
        inward_corners(surface, after.points, facet.facet) > facet.inward_corners)
      dented.push_back(facet.facet);
    const Vector3d area = area_vector(surface, after.points, facet.facet);
    const std::size_t last = i + 1 < facets_.size() ? facets_[i + 1].first : witnesses_.size();
    for (std::size_t w = facet.first; w < last; ++w) {
      std::optional<Vector3d>& normal = normals[witnesses_[w].node];
      if (!normal) normal = normal_at(after, witnesses_[w].node);
      const double facing = area.dot(*normal);
      if (facing == 0) continue;
      ((facing > 0) != witnesses_[w].looks_out ? turned : kept).push_back(facet.facet);
      break;
    }
  }
  // The mesh's own orientation may be that of the complement: what counts is a mixed sign.
  std::vector<FacetId> folds = 2 * turned.size() <= facets_.size() ? turned : kept;
  folds.insert(folds.end(), dented.begin(), dented.end());
  std::ranges::sort(folds);
  folds.erase(std::unique(folds.begin(), folds.end()), folds.end());
  return folds;
}

}  // namespace cadmorph
