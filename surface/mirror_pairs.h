#pragma once

#include <vector>

#include "surface/surface_mesh.h"

namespace cadmorph {

/// A plane part of the surface whose nodes move in its plane.
struct PlaneSheet {
  std::vector<int> inner;   ///< nodes whose motion follows from that of the border
  std::vector<int> border;  ///< the other nodes of its facets
  Eigen::Vector3d origin, normal;
};

/// Nodes of two sheets that are images of each other in a mirror: the sides of a mesh that is one
/// cell thick, of a wedge, of a sector or a duct with periodic sides.
struct MirrorPair {
  std::vector<int> from, to;  ///< inner nodes of the first sheet, and their images in the second
  Eigen::Matrix3d mirror;     ///< carries displacements onto those of the images
  std::size_t original;       ///< the first sheet
  std::size_t image;          ///< the second one
};

/// The pairs of sheets all of whose nodes are images of each other, within `tolerance`
/// (millimetres), and whose borders' displacements (`moved` less the surface's points) are images
/// within a thousandth of that, too. Of several copies of a sheet all follow the first.
std::vector<MirrorPair> find_mirror_pairs(const SurfaceMesh& surface, const Points& moved,
                                          const std::vector<PlaneSheet>& sheets, double tolerance);

/// Gives the images the displacements of their originals: equal to rounding.
void mirror_motion(const SurfaceMesh& surface, const MirrorPair& pair, Points& moved);

}  // namespace cadmorph
