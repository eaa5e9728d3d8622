#pragma once

#include <array>

#include "core/mesh.h"

namespace cadmorph {

/// A kind of gmsh's elements.
struct GmshElement {
  CellType type;
  int nodes;                                ///< in the file
  std::array<std::uint8_t, 27> order = {};  ///< place in the file of each of VTK's nodes
};

inline constexpr GmshElement gmsh_linear(CellType type, int nodes) {
  GmshElement kind{.type = type, .nodes = nodes};
  for (int i = 0; i < nodes; ++i) kind.order[std::size_t(i)] = std::uint8_t(i);
  return kind;
}

/// The elements by gmsh's numbers, from 1.
inline constexpr GmshElement kGmshElements[] = {
    gmsh_linear(CellType::Line, 2),
    gmsh_linear(CellType::Triangle, 3),
    gmsh_linear(CellType::Quad, 4),
    gmsh_linear(CellType::Tetra, 4),
    gmsh_linear(CellType::Hexahedron, 8),
    gmsh_linear(CellType::Wedge, 6),
    gmsh_linear(CellType::Pyramid, 5),
    gmsh_linear(CellType::QuadraticEdge, 3),
    gmsh_linear(CellType::QuadraticTriangle, 6),
    gmsh_linear(CellType::BiquadraticQuad, 9),
    {CellType::QuadraticTetra, 10, {0, 1, 2, 3, 4, 5, 6, 7, 9, 8}},
    {CellType::TriquadraticHexahedron, 27, {0,  1,  2,  3,  4,  5,  6,  7,  8,  11, 13, 9,  16, 18,
                                            19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26}},
    {CellType::BiquadraticQuadraticWedge,
     18,
     {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16}},
    {CellType::BiquadraticQuadraticPyramid, 14, {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12, 13}},
    gmsh_linear(CellType::Vertex, 1),
    gmsh_linear(CellType::QuadraticQuad, 8),
    {CellType::QuadraticHexahedron, 20, {0,  1, 2,  3,  4,  5,  6,  7,  8,  11,
                                         13, 9, 16, 18, 19, 17, 10, 12, 14, 15}},
    {CellType::QuadraticWedge, 15, {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11}},
    {CellType::QuadraticPyramid, 13, {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12}},
};

}  // namespace cadmorph
