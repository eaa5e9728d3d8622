#pragma once

#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS_Shape.hxx>
#include <filesystem>
#include <functional>
#include <gp_GTrsf.hxx>
#include <gp_Trsf.hxx>
#include <memory>
#include <string>
#include <vector>

#include "cad/brep.h"

namespace cadmorph::testing {

/// Path of a file below models/.
std::filesystem::path model_file(const std::string& name);

/// Reads a STEP file with OCCT alone, in millimetres.
TopoDS_Shape read_shape(const std::filesystem::path& path);

/// The CadModel of a shape, without a STEP file in between.
CadModel to_model(const TopoDS_Shape& shape);

/// The CadModel after a trip through a STEP file.
CadModel through_step(const TopoDS_Shape& shape);

void write_step(const std::filesystem::path& path, const TopoDS_Shape& shape);

/// A file name in the temporary folder that is removed with the object.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& suffix);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Rotation by `angle` about (1, 2, 3), uniform scale, translation.
gp_Trsf similarity(double angle, double scale, const gp_Vec& translation);

/// A general affine map with shear, unequal scales and positive determinant.
gp_GTrsf general_affine();

Eigen::Vector3d apply(const gp_Trsf& map, const Eigen::Vector3d& x);
Eigen::Vector3d apply(const gp_GTrsf& map, const Eigen::Vector3d& x);

TopoDS_Shape transformed(const TopoDS_Shape& shape, const gp_Trsf& map);
TopoDS_Shape transformed(const TopoDS_Shape& shape, const gp_GTrsf& map);
TopoDS_Shape to_nurbs(const TopoDS_Shape& shape);

/// Closed faces cut in halves, as some exporters write them.
TopoDS_Shape with_cut_faces(const TopoDS_Shape& shape);

/// Moves all control points of a NURBS-converted shape (after refining each to degree 3 in `spans`
/// spans when that is not 0). Pcurves stay, so S'(u, v) is the place of S(u, v). The map must carry
/// shared edges consistently.
TopoDS_Shape with_moved_poles(const TopoDS_Shape& nurbs,
                              const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map,
                              int spans = 0);

/// Twists, scales and shifts the planes z = const of a part of height `height`, each one as a
/// whole: carries extruded and turned NURBS parts consistently.
std::function<Eigen::Vector3d(const Eigen::Vector3d&)> twist_and_taper(double height, double angle);

struct ShuffleOptions {
  unsigned seed = 1;
  bool is_order_shuffled = true;       ///< solids, faces, wires, and the first edge of each wire
  bool has_reversed_planes = false;    ///< planes turned over, with the orientation of their faces
  bool has_reversed_edges = false;     ///< edges whose parameter runs the other way
  bool has_reversed_surfaces = false;  ///< curved surfaces whose u runs the other way
  bool has_split_seams = false;        ///< seams cut in two by a vertex
  bool has_split_edges = false;        ///< physical edges cut in two by a vertex of no meaning
  double probability = 0.5;            ///< of each change
};

struct Shuffled {
  TopoDS_Shape shape;
  IdVector<FaceId, FaceId>
      faces;  ///< face of the base (in the order of its CadModel) -> face of the shape
};

/// The same part as another exporter may write it.
Shuffled shuffle(const TopoDS_Shape& shape, const ShuffleOptions& options);

/// Turned parts of models/shapes with all seams turned by `angle` about the axis: "cylinder",
/// "cone", "cone_frustum", "sphere", "torus", "stepped_shaft".
TopoDS_Shape with_turned_seams(const std::string& name, double angle);

/// A block with through-holes, drilled in the order of `centres`.
TopoDS_Shape drilled_plate(double length, double width, double height, double radius,
                           const std::vector<Eigen::Vector2d>& centres);

/// The faces of a shape in the order of its CadModel, judged by OCCT's own algorithms.
class FaceOracle {
 public:
  explicit FaceOracle(const TopoDS_Shape& shape);
  ~FaceOracle();
  int face_count() const;
  /// Distance of x to the trimmed face, millimetres.
  double distance(int face, const Eigen::Vector3d& x) const;
  bool is_near(int face, const Eigen::Vector3d& x, double limit) const;
  /// Parameters of the nearest point of the untrimmed surface.
  Eigen::Vector2d parameters(int face, const Eigen::Vector3d& x) const;
  Eigen::Vector3d point(int face, const Eigen::Vector2d& uv) const;
  /// Distance to the nearest of all faces, and which.
  std::pair<int, double> nearest(const Eigen::Vector3d& x) const;
  /// 1 inside the wires, 0 on them, -1 outside.
  int side(int face, const Eigen::Vector2d& uv) const;

 private:
  double distance_to_box(int face, const Eigen::Vector3d& x) const;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph::testing
