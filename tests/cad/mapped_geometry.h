#pragma once

#include <BRepTools_Modification.hxx>
#include <BRep_Tool.hxx>
#include <Eigen/Core>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Vertex.hxx>
#include <functional>
#include <gp_Pnt.hxx>
#include <utility>

namespace cadmorph::testing {

using PointMap = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

/// What modifications that map a shape point by point have in common: vertices go to their images;
/// parameters on edges, continuity and tolerances stay.
class MappedGeometry : public BRepTools_Modification {
 public:
  Standard_Boolean NewPoint(const TopoDS_Vertex& vertex, gp_Pnt& point,
                            Standard_Real& tolerance) override {
    const gp_Pnt old = BRep_Tool::Pnt(vertex);
    const Eigen::Vector3d x = map_({old.X(), old.Y(), old.Z()});
    point = gp_Pnt(x.x(), x.y(), x.z());
    tolerance = BRep_Tool::Tolerance(vertex);
    return true;
  }

  Standard_Boolean NewParameter(const TopoDS_Vertex& vertex, const TopoDS_Edge& edge,
                                Standard_Real& parameter, Standard_Real& tolerance) override {
    tolerance = BRep_Tool::Tolerance(vertex);
    parameter = BRep_Tool::Parameter(vertex, edge);
    return true;
  }

  GeomAbs_Shape Continuity(const TopoDS_Edge& edge, const TopoDS_Face& a, const TopoDS_Face& b,
                           const TopoDS_Edge&, const TopoDS_Face&, const TopoDS_Face&) override {
    return BRep_Tool::Continuity(edge, a, b);
  }

 protected:
  explicit MappedGeometry(PointMap map) : map_(std::move(map)) {}

  PointMap map_;
};

}  // namespace cadmorph::testing
