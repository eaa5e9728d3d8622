#include "surface/face_folds.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace cadmorph {
namespace {

using Eigen::Vector2d;

// At a pole one parameter is arbitrary, and so is the normal that it gives.
bool is_at_pole(const FaceSide& side, Index i, double local_length) {
  const CadFace& f = side.model.faces()[side.face];
  const SurfacePoint s = side.model.evaluate(side.face, side.uv.row(i));
  const Vector2d size = f.upper - f.lower;
  return std::min(s.du.norm() * size[0], s.dv.norm() * size[1]) < 0.1 * local_length;
}

// Of a facet's area with the face's normal at its node i.
double facing(const SurfaceMesh& surface, const FaceSide& side, int facet, Index i) {
  return area_vector(surface, side.points, facet).dot(side.model.normal(side.face, side.uv.row(i)));
}

}  // namespace

std::vector<Index> find_folds(const SurfaceMesh& surface, const std::vector<int>& facets,
                              const std::vector<int>& rows, const FaceSide& before,
                              const FaceSide& after) {
  std::vector<Index> turned, kept, dented;
  for (const int f : facets) {
    if (surface.corners[f] > 3 &&
        inward_corners(surface, after.points, f) > inward_corners(surface, before.points, f))
      dented.push_back(f);
    for (const int n : surface.facets[f]) {
      const auto it = std::ranges::lower_bound(rows, n);
      if (it == rows.end() || *it != n) continue;
      const Index i = it - rows.begin();
      if (is_at_pole(before, i, surface.local_length[n])) continue;
      const double was = facing(surface, before, f, i), is = facing(surface, after, f, i);
      if (was == 0 || is == 0) continue;
      ((was > 0) != (is > 0) ? turned : kept).push_back(f);
      break;
    }
  }
  // The mesh's own orientation may be that of the complement: what counts is a mixed sign.
  std::vector<Index> folds = 2 * turned.size() <= facets.size() ? turned : kept;
  folds.insert(folds.end(), dented.begin(), dented.end());
  std::ranges::sort(folds);
  folds.erase(std::unique(folds.begin(), folds.end()), folds.end());
  return folds;
}

}  // namespace cadmorph
