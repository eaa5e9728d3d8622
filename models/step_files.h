#pragma once

#include <TopoDS_Shape.hxx>
#include <filesystem>
#include <memory>
#include <string>

#include "core/types.h"

class BRepExtrema_DistShapeShape;

namespace cadmorph::models {

/// Numbers of distinct faces, edges and vertices of a shape.
struct EntityCounts {
  int faces = 0;
  int edges = 0;
  int vertices = 0;
  bool operator==(const EntityCounts&) const = default;
};

/// Counts the entities of `shape`.
EntityCounts count_entities(const TopoDS_Shape& shape);

/// Writes `shape` as STEP AP214 in millimetres under the product name `name`. The header is fixed,
/// so that the same shape always gives the same bytes. Throws IoError.
void write_step(const std::filesystem::path& path, const TopoDS_Shape& shape,
                const std::string& name);

/// Reads a STEP file back, in millimetres. Throws IoError.
TopoDS_Shape read_step(const std::filesystem::path& path);

/// Finds the nearest points on a shape's faces. About 1 ms a point.
class NearestOnShape {
 public:
  explicit NearestOnShape(const TopoDS_Shape& shape);
  ~NearestOnShape();
  Eigen::Vector3d operator()(const Eigen::Vector3d& point) const;

 private:
  std::unique_ptr<BRepExtrema_DistShapeShape> extrema_;
};

/// Returns the largest distance of a point (N x 3) to the surface of `shape`. About 1 ms a point.
double largest_distance(const Points& points, const TopoDS_Shape& shape);

/// Throws CadError, naming `name`, unless BRepCheck_Analyzer finds `shape` valid.
void check_valid(const TopoDS_Shape& shape, const std::string& name);

}  // namespace cadmorph::models
