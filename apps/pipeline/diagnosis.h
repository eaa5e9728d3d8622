#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "cad/ids.h"
#include "core/types.h"

namespace cadmorph {

struct BaseSide;

/// Why a morphed mesh was refused, and where to look.
struct Diagnosis {
  Index bad_cells = 0;     ///< inverted, or below the asked quality
  Index bad_in_base = 0;   ///< of these: inverted in the input already
  Index poor_in_base = 0;  ///< of these: below the asked quality in the input already
  Index misordered = 0;    ///< inverted in the input by the order of their nodes
  Index held_cells =
      0;  ///< inverted and held so by their surface nodes (is_held), not in the input
  Index parted_nodes = 0;     ///< see PartedJoints
  Index dragged_patches = 0;  ///< see SurfaceMorphResult
  Index folded_shells = 0;    ///< shell cells that lie folded on their CAD face
  Index worst_cell = -1;
  std::string worst_name;                              ///< with its number in the file
  Eigen::Vector3d location = Eigen::Vector3d::Zero();  ///< of its centroid, in the mesh's unit
  std::vector<std::pair<int, Index>> regions;  ///< region id and bad cells in it, most first
  FaceId face;                                 ///< base CAD face nearest to most bad cells
  std::string face_type, face_name;
  /// Share of the parameter change in (0, 1] at which a one-step morph first inverts an element; 1
  /// when only the quality was too low, 0 when the input has inverted elements.
  double first_inversion = 1;
  std::vector<std::string> advice;  ///< what to try, a line each
};

/// Node positions at a share of the parameter change.
using PositionsAt = std::function<Points(double share)>;

/// Locates `bad_cells` (at least one) on the CAD by the nearest facet of the base mesh's surface,
/// and finds by bisection to 1 % where the first inversion appears on the way `positions_at`
/// describes.
Diagnosis diagnose(const BaseSide& base, const std::vector<Index>& bad_cells,
                   const PositionsAt& positions_at);

}  // namespace cadmorph
