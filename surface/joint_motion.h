#pragma once

#include <map>
#include <string>
#include <vector>

#include "surface/curve_map.h"
#include "surface/joints.h"

namespace cadmorph {

/// Where crossings go, millimetres, by row of the surface mesh: to where the images of all their
/// entities meet; where they don't, along their curve, or as predicted.
using Crossings = std::map<int, Eigen::Vector3d>;

/// Leads the curves through what stands on them or crosses them, and returns where the crossings
/// go. `feet`: of all rows on the base. Parallel.
Crossings join_curves(const ModelPair& pair, const Joints& joints, const Association& association,
                      const Points& feet, std::vector<CurveMap>& curve_maps);

/// A remark on joints that the variant parts: nodes that went, at `placed`, off a face or a curve
/// on which they lay; empty when there are none.
std::string parted_joints(const ModelPair& pair, const std::vector<CurveMap>& curve_maps,
                          const Joints& joints, const SurfaceMesh& surface, const Points& placed);

}  // namespace cadmorph
