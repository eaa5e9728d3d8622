#pragma once

#include <string>
#include <vector>

#include "surface/parameter_warp.h"

namespace cadmorph {

/// Maps parameters of a base face to its variant.
struct FaceMapResult {
  Parameters uv;              ///< on the variant face
  bool is_projected = false;  ///< predicted positions were projected, no warp was possible
  std::string note = {};      ///< why; empty when all went well
};

/// Warps parameters `uv` of the domain's face with the images of its wires and joints, in one or
/// more steps (interpolate_in_steps; open faces only). `points` are the nodes' positions S(uv) on
/// the base. Falls back to projecting the predicted positions where the parametrisations don't
/// correspond.
FaceMapResult map_face(const FaceDomain& domain, const ModelPair& pair, const FaceMotion& motion,
                       const Parameters& uv, const Points& points, int steps = 1);

/// The fallback alone: predicted positions, corrected to meet the mapped curves and the joints,
/// projected.
FaceMapResult project_face(const FaceDomain& domain, const ModelPair& pair,
                           const FaceMotion& motion, const Points& points);

}  // namespace cadmorph
