#pragma once

#include <array>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// A term x^a y^b z^c / (1 - z)^d of the reference coordinates, as {a, b, c, d}; at z = 1 that is
/// the limit along the cell.
using ShapeTerm = std::array<int, 4>;

/// A sum of terms.
using ShapePolynomial = std::vector<ShapeTerm>;

double value(const ShapePolynomial& polynomial, const Eigen::Vector3d& x);
/// Returns its derivatives by x, y and z.
Eigen::Vector3d gradient(const ShapePolynomial& polynomial, const Eigen::Vector3d& x);

/// Returns where a cell type's nodes lie in its reference cell, right-handed for VTK's node order:
/// corners at 0 and 1, but a pyramid has the base [-1, 1]^2 and the apex (0, 0, 1). For types with
/// a map, not those whose number of nodes varies.
std::vector<Eigen::Vector3d> reference_nodes(CellType type);

/// Returns a basis of the space of a type's shape functions, as many as nodes. Pyramids: Bedrosian,
/// Shape functions and integration formulas for three-dimensional finite element analysis, 1992;
/// with 14 nodes Bergot, Cohen, Durufle: Higher-order finite elements for hybrid meshes using new
/// nodal pyramidal elements, 2010.
std::vector<ShapePolynomial> shape_space(CellType type);

}  // namespace cadmorph
