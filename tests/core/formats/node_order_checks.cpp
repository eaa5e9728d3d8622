#include "tests/core/formats/node_order_checks.h"

#include <catch2/catch.hpp>
#include <map>
#include <vector>

namespace cadmorph::test {
namespace {

using enum CellType;
using Corners = std::vector<std::size_t>;
using Middles = std::vector<Corners>;

Middles first(const Middles& middles, std::size_t count) {
  return {middles.begin(), middles.begin() + std::ptrdiff_t(count)};
}

/// The corners in whose middle VTK has each further node of a cell: edges, faces, the inside.
const Middles& middles(CellType type) {
  static const Middles quad = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 1, 2, 3}};
  static const Middles hexahedron = {{0, 1},
                                     {1, 2},
                                     {2, 3},
                                     {3, 0},
                                     {4, 5},
                                     {5, 6},
                                     {6, 7},
                                     {7, 4},
                                     {0, 4},
                                     {1, 5},
                                     {2, 6},
                                     {3, 7},
                                     {0, 4, 7, 3},
                                     {1, 2, 6, 5},
                                     {0, 1, 5, 4},
                                     {3, 7, 6, 2},
                                     {0, 1, 2, 3},
                                     {4, 5, 6, 7},
                                     {0, 1, 2, 3, 4, 5, 6, 7}};
  static const Middles wedge = {{0, 1}, {1, 2}, {2, 0}, {3, 4},       {4, 5},       {5, 3},
                                {0, 3}, {1, 4}, {2, 5}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}};
  static const Middles pyramid = {{0, 1}, {1, 2}, {2, 3}, {3, 0},      {0, 4},
                                  {1, 4}, {2, 4}, {3, 4}, {0, 1, 2, 3}};
  static const std::map<CellType, Middles> all = {
      {QuadraticEdge, {{0, 1}}},
      {QuadraticTriangle, {{0, 1}, {1, 2}, {2, 0}}},
      {QuadraticQuad, first(quad, 4)},
      {BiquadraticQuad, quad},
      {QuadraticTetra, {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}},
      {QuadraticHexahedron, first(hexahedron, 12)},
      {TriquadraticHexahedron, hexahedron},
      {QuadraticLinearWedge, first(wedge, 6)},
      {QuadraticWedge, first(wedge, 9)},
      {BiquadraticQuadraticWedge, wedge},
      {QuadraticPyramid, first(pyramid, 8)},
      {BiquadraticQuadraticPyramid, pyramid}};
  return all.at(type);
}

}  // namespace

void require_middles(const Mesh& mesh, Index c) {
  const CellType type = mesh.types[std::size_t(c)];
  const auto cell = mesh.cell(c);
  const Middles& expected = middles(type);
  const std::size_t corners = cell.size() - expected.size();
  for (std::size_t i = 0; i < expected.size(); ++i) {
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (const std::size_t corner : expected[i]) middle += mesh.points.row(cell[corner]);
    middle /= double(expected[i].size());
    INFO("node " << corners + i << " of a cell of VTK type " << int(type));
    REQUIRE((mesh.points.row(cell[corners + i]) - middle).norm() < 1e-12);
  }
}

Points unit_cell(CellType type) {
  const bool is_wedge = type == QuadraticWedge;
  Points corners(is_wedge ? 6 : 8, 3);
  if (is_wedge)
    corners << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1;
  else
    corners << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1;
  const Middles& others = middles(type);
  Points result(corners.rows() + std::ssize(others), 3);
  result.topRows(corners.rows()) = corners;
  for (std::size_t i = 0; i < others.size(); ++i) {
    const std::vector<Index> ends(others[i].begin(), others[i].end());
    result.row(corners.rows() + Index(i)) = corners(ends, Eigen::all).colwise().mean();
  }
  return result;
}

}  // namespace cadmorph::test
