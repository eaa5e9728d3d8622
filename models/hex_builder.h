#pragma once

#include <array>
#include <map>

#include "core/mesh.h"

namespace cadmorph::models {

/// Collects hexahedra given by the positions of their corners; corners closer than 1e-6 become one
/// node, at the position it was first given.
class HexBuilder {
 public:
  using Point = Eigen::Vector3d;

  /// Adds one hexahedron, corners in VTK's order.
  void add(const std::array<Point, 8>& corners);

  /// Returns all of them as a mesh.
  Mesh mesh() const;

 private:
  Index node(const Point& position);

  std::map<std::array<std::int64_t, 3>, Index> ids_;
  std::vector<Point> points_;
  std::vector<Index> connectivity_;
};

/// Makes a mesh of one cell type from node positions and node ids.
Mesh make_mesh(const std::vector<Eigen::Vector3d>& points, CellType type, int nodes_per_cell,
               const std::vector<Index>& connectivity);

}  // namespace cadmorph::models
