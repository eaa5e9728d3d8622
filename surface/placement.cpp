#include "surface/placement.h"

#include <utility>

namespace cadmorph {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Placement::Placement(Points base_feet)
    : feet(std::move(base_feet)),
      offsets(Points::Zero(feet.rows(), 3)),
      uv(Parameters::Zero(feet.rows(), 2)),
      entity(feet.rows(), -1),
      is_crossing(feet.rows(), 0) {}

Placement Placement::rows(const std::vector<RowId>& nodes) const {
  Placement result(feet(nodes, Eigen::all));
  result.offsets = offsets(nodes, Eigen::all);
  result.uv = uv(nodes, Eigen::all);
  return result;
}

void Placement::set_rows(const std::vector<RowId>& nodes, const Placement& values) {
  feet(nodes, Eigen::all) = values.feet;
  offsets(nodes, Eigen::all) = values.offsets;
  uv(nodes, Eigen::all) = values.uv;
}

void Placement::cross(RowId row, const Vector3d& to) {
  feet.row(row) = to;
  is_crossing[row] = 1;
}

Matrix3d surface_frame(const SurfacePoint& s) {
  const Vector3d cross = s.du.cross(s.dv);
  Matrix3d f = Matrix3d::Identity();
  if (cross.norm() <= 1e-12 * s.du.norm() * s.dv.norm() || cross.norm() == 0) return f;
  f.col(0) = s.du.normalized();
  f.col(2) = cross.normalized();
  f.col(1) = f.col(2).cross(f.col(0));
  return f;
}

}  // namespace cadmorph
