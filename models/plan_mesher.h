#pragma once

#include <array>
#include <vector>

#include "models/plan_curve.h"

namespace cadmorph::models {

/// Quadrangles in a plane, corners counter-clockwise.
struct PlanMesh {
  std::vector<Point2> points;
  std::vector<std::array<int, 4>> quads;
};

/// A closed loop of boundary nodes.
using Loop = std::vector<Point2>;

/// The nodes of `cells[i]` equal parts of curve `i`, curve after curve; each must begin where the
/// one before ends, the first where the last ends.
Loop sample_loop(const std::vector<PlanCurve>& curves, const std::vector<int>& cells);

/// `cells` equal parts of a full circle, from angle `first` on.
Loop sample_circle(const Point2& centre, double radius, int cells, double first = 0);

/// Meshes the region inside `outline` (counter-clockwise) and outside `holes` with an unstructured
/// mesh of quadrangles as large as the loops' edges. The boundary nodes are those of the loops,
/// unchanged; each loop has an even number of them. Throws InvalidInputError when gmsh can't mesh
/// it.
PlanMesh mesh_plan(const Loop& outline, const std::vector<Loop>& holes);

}  // namespace cadmorph::models
