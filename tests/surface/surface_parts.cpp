#include "surface_parts.h"

#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <Eigen/Geometry>
#include <algorithm>

namespace cadmorph::testing {

using Eigen::Vector3d;

Points moved_by(const MorphCase& c, const std::function<Vector3d(const Vector3d&)>& map) {
  return images(surface_points(c.boundary, c.mesh.points), map);
}

TopoDS_Shape cylinder(double radius, double height) {
  return BRepPrimAPI_MakeCylinder(radius, height).Solid();
}

TopoDS_Shape sphere_at(const Vector3d& centre, double radius) {
  return BRepPrimAPI_MakeSphere(gp_Pnt(centre.x(), centre.y(), centre.z()), radius).Solid();
}

gp_Trsf turn_about_z(double angle) {
  gp_Trsf turn;
  turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), angle);
  return turn;
}

double largest_tolerance(const CadModel& model) {
  double tolerance = 1e-7;
  for (const auto& f : model.faces()) tolerance = std::max(tolerance, f.tolerance);
  for (const auto& e : model.edges()) tolerance = std::max(tolerance, e.tolerance);
  for (const auto& v : model.vertices()) tolerance = std::max(tolerance, v.tolerance);
  return tolerance;
}

OnCad judge(const MorphCase& c, const Points& surface, const TopologyMatch& match,
            const CadModel& variant, const TopoDS_Shape& shape) {
  const FaceOracle oracle(shape);
  Points points = c.mesh.points;
  points(c.boundary.nodes, Eigen::all) = surface;
  OnCad result;
  for (Index t = 0; t < c.mesh.cell_count(); ++t) {
    const auto n = c.mesh.cell(t);
    const int face = match.faces[FaceId(c.mesh.region(t))];
    const Vector3d a = points.row(n[0]), b = points.row(n[1]), d = points.row(n[2]);
    for (const Vector3d& x : {a, b, d})
      result.farthest = std::max(result.farthest, oracle.distance(face, x));
    const Vector3d middle = (a + b + d) / 3;
    const Vector3d normal = variant.normal(FaceId(face), oracle.parameters(face, middle));
    result.folded += (b - a).cross(d - a).dot(normal) <= 0;
  }
  return result;
}

}  // namespace cadmorph::testing
