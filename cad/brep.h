#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cad/ids.h"
#include "core/types.h"

namespace cadmorph {

enum class SurfaceType { Plane, Cylinder, Cone, Sphere, Torus, BSpline, Other };

/// Name of a surface type, for messages ("plane", "cylinder", ...).
const char* to_string(SurfaceType type);

/// A B-Rep vertex.
struct CadVertex {
  Eigen::Vector3d point;  ///< millimetres
  double tolerance;
};

/// A B-Rep edge: a 3D curve c(t), t in [first, last].
struct CadEdge {
  double first, last;
  VertexId start, end;  ///< vertices at first and last; -1 when missing
  double tolerance;
  double length;
  bool is_degenerate;  ///< a point: a pole, an apex, or taken for one (with_points_for)
  bool is_seam;        ///< closes the parametrisation of its only face
  bool is_free_form;   ///< neither a line nor a conic: t is neither a length nor an angle
  bool is_rational;    ///< a free form that may be a conic, as exporters of B-splines write it
  std::vector<CoedgeId> coedges;  ///< its uses in faces
  bool is_physical() const { return !is_degenerate && !is_seam; }
};

/// The use of an edge by a face: its curve in the face's parameter domain (pcurve), by wire
/// occurrence.
struct CadCoedge {
  EdgeId edge;
  FaceId face;
  bool is_reversed;  ///< runs against the edge, when the face's material lies to the left seen from
                     ///< the outside of the solid
};

/// A B-Rep face: a trimmed surface S(u, v).
struct CadFace {
  SurfaceType type;
  bool is_reversed;              ///< the outward normal is -(S_u x S_v)
  Eigen::Vector2d lower, upper;  ///< bounds of the trimmed parameter domain
  Eigen::Vector2d period;        ///< period in u and v where the face closes on itself, else 0
  double tolerance;
  int solid;        ///< of the file, -1 for a face of no solid
  int other_solid;  ///< of a face between two solids: the later one in the file; else -1. The
                    ///< outside is that of `solid`: which one it is, is chance
  std::vector<std::vector<CoedgeId>> wires;  ///< coedges in the order of the file
  std::string name;                          ///< from the STEP file; may be empty
};

/// A link of a curve: one edge, run forward or backward.
struct CurveLink {
  EdgeId edge;
  bool is_reversed;
};

/// A physical curve: a chain of edges between corners, or closed.
struct CadCurve {
  std::vector<CurveLink> links;
  CornerId start, end;        ///< corners; -1 for a closed curve without one
  std::vector<FaceId> faces;  ///< adjacent faces, ascending, once a use
  double length;
  bool is_closed() const { return start < 0; }
};

/// The entities that exist physically. Seam edges, degenerate edges, and vertices that exist only
/// to end a seam or to cut a smooth curve between the same two faces are left out.
struct CadSkeleton {
  IdVector<CurveId, CadCurve> curves;
  IdVector<CornerId, VertexId> corners;           ///< vertex ids
  IdVector<VertexId, CornerId> corner_of_vertex;  ///< -1: not physical
  IdVector<EdgeId, CurveId> curve_of_edge;        ///< -1: not physical
};

/// S(u, v) with first derivatives, millimetres and millimetres per parameter.
struct SurfacePoint {
  Eigen::Vector3d point, du, dv;
};

/// S(u, v) with second derivatives.
struct SurfaceCurvature {
  SurfacePoint first;
  Eigen::Vector3d duu, duv, dvv;
};

/// c(t) with its first derivative.
struct CurvePoint {
  Eigen::Vector3d point, dt;
};

/// Which faces of one surface become one: all that touch, or those that touch where the parameters
/// of a surface of revolution begin, or opposite. Where they begin is up to the program that wrote
/// the file: the designer drew no such edge.
enum class FaceMerge { All, AcrossSeams };

/// A CAD model read from STEP: topology as plain data, geometry behind functions. All const
/// functions are thread-safe. Copies share the data. Lengths in millimetres.
class CadModel {
 public:
  struct Impl;
  explicit CadModel(std::shared_ptr<const Impl> impl);

  /// The same model whose skeleton chains smooth joints wherever they are, not at seams alone
  /// (build_skeleton): for pairs of which one exporter cut edges that the other did not. Cheap: the
  /// geometry is shared.
  CadModel with_joined_edges() const;

  /// The same model whose skeleton has so many corners, if other angles than usual make it so
  /// (build_skeleton): for pairs whose joints turn by a little more in one of them. Cheap.
  CadModel with_corners(std::size_t count) const;

  /// The same model with faces made one that touch and lie on one surface, for pairs of which one
  /// exporter cut faces that the other did not; merged faces have no name. Nothing when there are
  /// none, or OCCT can't merge them.
  std::optional<CadModel> with_merged_faces(FaceMerge merge = FaceMerge::All) const;

  /// The same model with faces on planes, cylinders, cones and spheres that the file has as
  /// B-splines, where these are exact; faces, edges, vertices and coedges keep their numbers.
  /// Nothing where none of the faces is such a one.
  std::optional<CadModel> with_analytic_faces(const std::vector<FaceId>& faces) const;
  int merged_face_count() const;  ///< faces of the file that became part of another one

  /// Edges with a corner at each end that are shorter than a thousandth of the diagonal, the
  /// shortest first: slivers between fillets and cuts, which come and go with the dimensions.
  std::vector<EdgeId> short_edges() const;
  /// The same model with edges taken for points, where they start.
  CadModel with_points_for(const std::vector<EdgeId>& edges) const;
  int edges_as_points() const;  ///< edges of the file that are taken for points

  const IdVector<FaceId, CadFace>& faces() const;
  const IdVector<EdgeId, CadEdge>& edges() const;
  const IdVector<VertexId, CadVertex>& vertices() const;
  const IdVector<CoedgeId, CadCoedge>& coedges() const;
  const CadSkeleton& skeleton() const;
  int solid_count() const;
  const std::string& file_name() const;
  const std::string& file_unit() const;  ///< length unit named in the file
  const Eigen::Vector3d& lower() const;  ///< bounding box of all edges and face samples
  const Eigen::Vector3d& upper() const;
  double diagonal() const { return (upper() - lower()).norm(); }

  SurfacePoint evaluate(FaceId face, const Eigen::Vector2d& uv) const;
  SurfaceCurvature evaluate_second(FaceId face, const Eigen::Vector2d& uv) const;
  CurvePoint evaluate_edge(EdgeId edge, double t) const;
  Eigen::Vector2d pcurve(CoedgeId coedge, double t) const;

  /// Outward unit normal (by the face's orientation), zero where the surface is singular.
  Eigen::Vector3d normal(FaceId face, const Eigen::Vector2d& uv) const;

  /// Shifts (u, v) by periods of the surface to lie as near the trimmed domain as possible; within
  /// its bounds, which may span several periods, it stays.
  Eigen::Vector2d into_domain(FaceId face, const Eigen::Vector2d& uv) const;

  /// Whether (u, v) lies inside the trimmed domain.
  bool is_inside(FaceId face, const Eigen::Vector2d& uv) const;

  /// Values of u, ascending, where the wires of a face cross the line v = const. Between the first
  /// and the second, the third and the fourth, ... the face lies; empty for a face without wires.
  std::vector<double> crossings(FaceId face, double v) const;

 private:
  std::shared_ptr<const Impl> impl_;
  std::shared_ptr<const CadSkeleton> skeleton_;
};

}  // namespace cadmorph
