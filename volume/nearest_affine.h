#pragma once

#include "core/mesh.h"

namespace cadmorph {

/// The affine map nearest to a motion of a mesh's nodes.
struct NearestAffine {
  Points image;           ///< N x 3: where it takes the nodes
  double farthest = 0;    ///< largest distance of a node from there
  bool is_whole = false;  ///< it tells of most of the motion, and turns nothing inside out
};

/// By least squares over all nodes, which move from `from` to `to` (N x 3 each). The normal of a
/// plane mesh stays.
NearestAffine nearest_affine(const Mesh& mesh, const Points& from, const Points& to);

}  // namespace cadmorph
