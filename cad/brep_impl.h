#pragma once

#include <Geom_Curve.hxx>
#include <Geom_Surface.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS_Shape.hxx>
#include <gp_Pnt.hxx>
#include <gp_Vec.hxx>
#include <string>
#include <vector>

#include "cad/brep.h"
#include "cad/fault_guard.h"
#include "cad/pcurve.h"
#include "cad/trim_loops.h"

namespace cadmorph {

inline Eigen::Vector3d to_eigen(const gp_Pnt& p) { return {p.X(), p.Y(), p.Z()}; }
inline Eigen::Vector3d to_eigen(const gp_Vec& v) { return {v.X(), v.Y(), v.Z()}; }

/// What a CadModel holds; OCCT's geometry by entity.
struct CadModel::Impl {
  IdVector<FaceId, CadFace> faces;
  IdVector<EdgeId, CadEdge> edges;
  IdVector<VertexId, CadVertex> vertices;
  IdVector<CoedgeId, CadCoedge> coedges;
  int solids = 0;
  int merged_faces = 0, edges_as_points = 0;
  std::string file_name, file_unit;
  Eigen::Vector3d lower = Eigen::Vector3d::Constant(1e300),
                  upper = Eigen::Vector3d::Constant(-1e300);

  TopoDS_Shape shape;
  IdVector<FaceId, Handle(Geom_Surface)> surfaces;
  IdVector<EdgeId, Handle(Geom_Curve)> curves;       // null for degenerate edges
  IdVector<CoedgeId, Pcurve> pcurves;                // a coedge
  IdVector<FaceId, TrimLoops> loops;                 // a face
  IdVector<FaceId, Eigen::Vector2d> natural_period;  // of the untrimmed surface

  void extend_bounds(const Eigen::Vector3d& p) {
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
};

/// The faces of a shape that have a surface, in the order of CadModel::faces.
TopTools_IndexedMapOfShape usable_faces(const TopoDS_Shape& shape);

/// Calls `use` and returns what it returns; OCCT's failures become errors that name the file.
template <class Use>
decltype(auto) guarded(const std::string& file_name, const Use& use) {
  try {
    return use();
  } catch (const Standard_Failure& failure) {
    throw_as_error(failure, file_name + ": its geometry fails", "Export the part again.");
  }
}

}  // namespace cadmorph
