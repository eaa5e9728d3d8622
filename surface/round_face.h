#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "surface/curve_map.h"

namespace cadmorph {

/// Carries points of a base face onto its variant's surface (millimetres).
using FaceCarry = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

/// Of two spheres, or two tori, whose parameters don't run alike under the match's alignment:
/// the map of the one onto the other that owes nothing to them. Where a kernel puts the poles of a
/// sphere or the seams of a torus tells nothing of the part. A sphere turns as its marks do, `from`
/// and `to` (millimetres), or without them as the alignment. Nothing for other faces.
std::optional<FaceCarry> carry_round_face(const ModelPair& pair, FaceId base_face,
                                          const std::vector<Eigen::Vector3d>& from = {},
                                          const std::vector<Eigen::Vector3d>& to = {});

}  // namespace cadmorph
