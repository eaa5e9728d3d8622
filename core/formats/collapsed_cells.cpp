#include "core/formats/collapsed_cells.h"

#include <algorithm>
#include <array>
#include <initializer_list>
#include <span>

namespace cadmorph {
namespace {

using enum CellType;

/// Corners that are equal, and what is left: corners, then mid-side nodes.
struct Collapse {
  std::initializer_list<std::initializer_list<int>> equal;
  CellType linear, quadratic;
  std::size_t corners;
  std::initializer_list<int> nodes;  ///< corners alone: there is no quadratic form
};

const Collapse kHexahedra[] = {
    {{{2, 3}, {4, 5, 6, 7}}, Tetra, QuadraticTetra, 4, {0, 1, 2, 4, 8, 9, 11, 16, 17, 18}},
    {{{3, 4, 5, 6, 7}}, Tetra, QuadraticTetra, 4, {0, 1, 2, 3}},
    {{{4, 5, 6, 7}}, Pyramid, QuadraticPyramid, 5, {0, 1, 2, 3, 4, 8, 9, 10, 11, 16, 17, 18, 19}},
    {{{2, 3}, {6, 7}},
     Wedge,
     QuadraticWedge,
     6,
     {0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18}},
    // The edges between 4 and 5, and between 6 and 7, have no length.
    {{{4, 5}, {6, 7}},
     Wedge,
     QuadraticWedge,
     6,
     {0, 4, 1, 3, 6, 2, 16, 17, 8, 19, 18, 10, 11, 13, 9}},
};

const Collapse kQuads[] = {
    {{{2, 3}}, Triangle, QuadraticTriangle, 3, {0, 1, 2, 4, 5, 7}},
};

bool is_collapsed(const Collapse& collapse, const std::vector<Index>& nodes) {
  return std::ranges::all_of(collapse.equal, [&](const std::initializer_list<int>& equal) {
    return std::ranges::all_of(
        equal, [&](int i) { return nodes[std::size_t(i)] == nodes[std::size_t(*equal.begin())]; });
  });
}

}  // namespace

CellType reduce_collapsed(CellType type, std::vector<Index>& nodes) {
  const bool is_quadratic = type == QuadraticHexahedron || type == QuadraticQuad;
  std::span<const Collapse> collapses;
  if (type == Hexahedron || type == QuadraticHexahedron) collapses = kHexahedra;
  if (type == Quad || type == QuadraticQuad) collapses = kQuads;
  for (const Collapse& collapse : collapses) {
    const bool has_form = !is_quadratic || collapse.nodes.size() > collapse.corners;
    if (!has_form || !is_collapsed(collapse, nodes)) continue;
    std::array<Index, 20> kept;
    std::size_t count = 0;
    for (const int i : collapse.nodes)
      if (is_quadratic || count < collapse.corners) kept[count++] = nodes[std::size_t(i)];
    nodes.assign(kept.begin(), kept.begin() + count);
    return is_quadratic ? collapse.quadratic : collapse.linear;
  }
  return type;
}

}  // namespace cadmorph
