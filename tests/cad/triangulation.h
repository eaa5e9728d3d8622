#pragma once

#include <TopoDS_Shape.hxx>
#include <array>
#include <functional>

#include "core/mesh.h"

namespace cadmorph::testing {

/// A shell mesh of triangles over all faces of a shape (BRepMesh), nodes on the CAD, joined along
/// the edges. `deflection`: largest distance of a triangle's middle from the CAD, millimetres. Each
/// triangle's region is the number of its face.
Mesh triangulate(const TopoDS_Shape& shape, double deflection, double angle = 0.35);

/// Every triangle in four; new nodes halfway between old ones, off curved faces.
Mesh split_triangles(const Mesh& mesh);

/// Hexahedra in an n0 x n1 x n2 grid of the unit cube, mapped; the second direction may close.
Mesh hex_grid(const std::array<int, 3>& n,
              const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map,
              bool is_closed = false);

}  // namespace cadmorph::testing
