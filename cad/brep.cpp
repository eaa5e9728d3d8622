#include "cad/brep.h"

#include <cmath>
#include <gp_Pnt.hxx>
#include <gp_Vec.hxx>

#include "cad/brep_impl.h"
#include "cad/skeleton.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInSeam = 2e-5;    // of a period: the slivers that seams leave
constexpr double kOnBounds = 1e-6;  // of the domain: far above the rounding of a projection

// Moves a point on the bounds of the domain, such as on a seam or a pole, a little inward.
Vector2d off_bounds(const CadFace& face, Vector2d uv) {
  for (int a = 0; a < 2; ++a) {
    const double margin = kOnBounds * (face.upper[a] - face.lower[a]);
    if (std::abs(uv[a] - face.lower[a]) < margin) uv[a] = face.lower[a] + margin;
    if (std::abs(uv[a] - face.upper[a]) < margin) uv[a] = face.upper[a] - margin;
  }
  return uv;
}

// Whether a point outside the wires lies in them a period further, or a little to the side of a
// seam: the two pcurves of a seam waver within the tolerance of its edge.
bool is_in_seam(const TrimLoops& loops, const CadFace& face, const Vector2d& at) {
  for (int a = 0; a < 2; ++a)
    for (const double shift :
         {face.period[a], -face.period[a], kInSeam * face.period[a], -kInSeam * face.period[a]}) {
      Vector2d q = at;
      q[a] += shift;
      if (shift == 0 || q[a] < face.lower[a] || q[a] > face.upper[a]) continue;
      if (loops.contains(q)) return true;
    }
  return false;
}

}  // namespace

const char* to_string(SurfaceType type) {
  switch (type) {
    case SurfaceType::Plane:
      return "plane";
    case SurfaceType::Cylinder:
      return "cylinder";
    case SurfaceType::Cone:
      return "cone";
    case SurfaceType::Sphere:
      return "sphere";
    case SurfaceType::Torus:
      return "torus";
    case SurfaceType::BSpline:
      return "B-spline";
    case SurfaceType::Other:
      break;
  }
  return "surface";
}

CadModel::CadModel(std::shared_ptr<const Impl> impl)
    : impl_(std::move(impl)),
      skeleton_(std::make_shared<CadSkeleton>(build_skeleton(*this, JoinEdges::AtSeams))) {}

CadModel CadModel::with_joined_edges() const {
  CadModel joined = *this;
  joined.skeleton_ = std::make_shared<CadSkeleton>(build_skeleton(*this, JoinEdges::WhereSmooth));
  return joined;
}

CadModel CadModel::with_corners(std::size_t count) const {
  CadModel result = *this;
  result.skeleton_ =
      std::make_shared<CadSkeleton>(build_skeleton(*this, JoinEdges::AtSeams, count));
  return result;
}

const IdVector<FaceId, CadFace>& CadModel::faces() const { return impl_->faces; }
const IdVector<EdgeId, CadEdge>& CadModel::edges() const { return impl_->edges; }
const IdVector<VertexId, CadVertex>& CadModel::vertices() const { return impl_->vertices; }
const IdVector<CoedgeId, CadCoedge>& CadModel::coedges() const { return impl_->coedges; }
const CadSkeleton& CadModel::skeleton() const { return *skeleton_; }
int CadModel::solid_count() const { return impl_->solids; }
int CadModel::merged_face_count() const { return impl_->merged_faces; }
int CadModel::edges_as_points() const { return impl_->edges_as_points; }
const std::string& CadModel::file_name() const { return impl_->file_name; }
const std::string& CadModel::file_unit() const { return impl_->file_unit; }
const Vector3d& CadModel::lower() const { return impl_->lower; }
const Vector3d& CadModel::upper() const { return impl_->upper; }

SurfacePoint CadModel::evaluate(FaceId face, const Vector2d& uv) const {
  gp_Pnt p;
  gp_Vec du, dv;
  guarded(impl_->file_name, [&] { impl_->surfaces[face]->D1(uv.x(), uv.y(), p, du, dv); });
  return {to_eigen(p), to_eigen(du), to_eigen(dv)};
}

SurfaceCurvature CadModel::evaluate_second(FaceId face, const Vector2d& uv) const {
  gp_Pnt p;
  gp_Vec du, dv, duu, dvv, duv;
  guarded(impl_->file_name,
          [&] { impl_->surfaces[face]->D2(uv.x(), uv.y(), p, du, dv, duu, dvv, duv); });
  return {{to_eigen(p), to_eigen(du), to_eigen(dv)}, to_eigen(duu), to_eigen(duv), to_eigen(dvv)};
}

CurvePoint CadModel::evaluate_edge(EdgeId edge, double t) const {
  if (impl_->curves[edge].IsNull())
    return {vertices()[edges()[edge].start].point, Vector3d::Zero()};
  gp_Pnt p;
  gp_Vec dt;
  guarded(impl_->file_name, [&] { impl_->curves[edge]->D1(t, p, dt); });
  return {to_eigen(p), to_eigen(dt)};
}

Vector2d CadModel::pcurve(CoedgeId coedge, double t) const {
  Vector2d uv;
  guarded(impl_->file_name, [&] { uv = impl_->pcurves[coedge](t); });
  return uv;
}

Vector3d CadModel::normal(FaceId face, const Vector2d& uv) const {
  const SurfacePoint s = evaluate(face, uv);
  const Vector3d cross = s.du.cross(s.dv);
  const double size = cross.norm();
  if (size <= 1e-12 * s.du.norm() * s.dv.norm() || size == 0) return Vector3d::Zero();
  return (faces()[face].is_reversed ? -1.0 : 1.0) / size * cross;
}

Vector2d CadModel::into_domain(FaceId face, const Vector2d& uv) const {
  const CadFace& f = faces()[face];
  Vector2d shifted = uv;
  for (int a = 0; a < 2; ++a) {
    const double period = f.period[a] > 0 ? f.period[a] : impl_->natural_period[face][a];
    if (period <= 0 || (uv[a] >= f.lower[a] && uv[a] <= f.upper[a])) continue;
    const double middle = 0.5 * (f.lower[a] + f.upper[a]);
    shifted[a] -= period * std::round((uv[a] - middle) / period);
  }
  return shifted;
}

bool CadModel::is_inside(FaceId face, const Vector2d& uv) const {
  const TrimLoops& loops = impl_->loops[face];
  if (loops.empty()) return true;
  const CadFace& f = faces()[face];
  const Vector2d q = off_bounds(f, into_domain(face, uv));
  return loops.contains(q) || is_in_seam(loops, f, q);
}

std::vector<double> CadModel::crossings(FaceId face, double v) const {
  return impl_->loops[face].crossings(v);
}

}  // namespace cadmorph
