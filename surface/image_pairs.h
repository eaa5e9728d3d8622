#pragma once

#include <vector>

#include "surface/surface_mesh.h"

namespace cadmorph {

/// Part of the tolerance for images within which nodes are images after the motion: this is
/// computed, to rounding, and has no digits cut off as a mesh file has.
inline constexpr double kSameMotion = 1e-3;

/// A part of the surface whose nodes move along it.
struct Sheet {
  std::vector<RowId> inner;   ///< nodes whose motion follows from that of the border
  std::vector<RowId> border;  ///< the other nodes of its facets
  std::vector<FacetId> facets;
  bool is_planar = false;
};

/// x -> linear * x + shift: a turn, a shift, a reflection.
struct Isometry {
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const { return linear * x + shift; }
};

/// The turn and shift that fit paired points best, N x 3 each (least squares, Umeyama 1991).
Isometry fit_motion(const Points& from, const Points& to);

/// Whether the map carries each of these points onto the other one of its row, or nearly.
bool fits(const Points& from, const Points& to, const Isometry& map, double tolerance);

/// Two sheets that are images of each other, node by node, before and after: the sides of a mesh
/// that is one cell thick, of a wedge, of a periodic sector, passage or duct.
struct ImagePair {
  std::vector<RowId> from,
      to;                    ///< nodes of the first sheet, the inner ones first, and their images
  std::size_t inner = 0;     ///< how many are inner ones
  Isometry before, after;    ///< carry the first sheet's nodes onto those of the second
  std::size_t original = 0;  ///< the first sheet
  std::size_t image = 0;     ///< the second one

  /// Where to[i] has to be (millimetres) with from[i] at its row of `moved`: where it was off the
  /// image before, it stays off as far.
  Eigen::Vector3d place(const SurfaceMesh& surface, const Points& moved, std::size_t i) const;
};

/// The nodes of both sheets of all pairs, ascending.
std::vector<RowId> nodes_of(const std::vector<ImagePair>& pairs);

/// The pairs of sheets whose nodes are images of each other within `tolerance` (millimetres), at
/// the surface's points, and whose borders are at `moved` within a thousandth of that, by the same
/// isometry or, where the period changed, by another. Planes may be mirror images of each other;
/// other sheets are turned or shifted and have the inside of the mesh on opposite sides, as
/// periodic ones do. Of several copies of a sheet all follow the first.
std::vector<ImagePair> find_image_pairs(const SurfaceMesh& surface, const Points& moved,
                                        const std::vector<Sheet>& sheets, double tolerance);

}  // namespace cadmorph
