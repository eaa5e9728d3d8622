#pragma once

#include <memory>
#include <string>
#include <vector>

#include "surface/association.h"
#include "surface/own_surface.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// Part of the surface's size that nodes of a plane may lie off it: seven digits.
inline constexpr double kSamePlane = 1e-6;

/// Where two planar patches that slide meet: nodes of both, in their order along a straight line.
struct FreeLine {
  Eigen::Vector3d direction;
  std::vector<RowId> nodes;
  std::vector<char> is_free;  ///< one a node; others are on the CAD, on further patches, or ends
};

/// A connected part of the mesh's outside that lies on no CAD face: a side of a far field, a
/// symmetry plane.
struct FreePatch {
  std::vector<FacetId> facets;
  std::vector<RowId> inner;     ///< unmatched nodes of this patch alone
  std::vector<RowId> border;    ///< unmatched nodes shared with another patch
  std::vector<RowId> touched;   ///< nodes shared with the matched surface, or moved all the same
  std::vector<FreeLine> lines;  ///< of its border, those that the CAD touches
  Eigen::Vector3d origin, normal;
  bool is_planar;
  std::shared_ptr<const OwnSurface> form = nullptr;  ///< of a curved one that may slide
};

/// What the groups of the mesh say of its patches.
struct PatchMarks {
  IdVector<FacetId, int> group;      ///< patches end where it changes; empty: all alike
  IdVector<RowId, char> is_moved;    ///< moved, if on no CAD face, all the same; empty: none
  IdVector<FacetId, char> is_inner;  ///< inside of the mesh, but slides; empty: none

  bool is_one_group(FacetId facet, FacetId other) const {
    return group.empty() || group[facet] == group[other];
  }
};

/// Marks the facets of the outside that cancel: two at one place with opposite normals, whose nodes
/// lie two at a place, on no CAD face. They are a crack inside of the mesh, no surface of the part.
IdVector<FacetId, char> find_cracks(const SurfaceMesh& surface, const Boundary& boundary,
                                    const Association& association);

/// What to tell of a crack; empty where there is none.
std::string describe_cracks(const Mesh& mesh, const SurfaceMesh& surface, const Boundary& boundary,
                            const Association& association);

/// Splits the unmatched facets of the outside into patches: planar ones, and the curved rest where
/// its facets meet at more than 30 degrees.
std::vector<FreePatch> find_free_patches(const SurfaceMesh& surface, const Boundary& boundary,
                                         const Association& association,
                                         const PatchMarks& marks = {});

/// An unmatched node of the outside and those that hang together with it through unmatched ones
/// alone, over the facets that `is_open` marks. Marks them in `is_seen`.
std::vector<RowId> unmatched_around(const SurfaceMesh& surface, const Association& association,
                                    const IdVector<FacetId, char>& is_open, RowId seed,
                                    IdVector<RowId, char>& is_seen);

/// Marks unmatched nodes on interfaces between regions and on cracks as free, and throws
/// AssociationError where the unmatched outside can't be a far field or a symmetry plane: the mesh
/// covers less than a quarter of the CAD's faces by half their area, or, of nodes that are not
/// expected to be off the CAD (`options`): it reaches no further than
/// 1.2 times the CAD, or they lie by the CAD amid matched ones.
void check_unmatched(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                     const SurfaceMesh& surface, const AssociationOptions& options,
                     Association& association);

/// How far nodes of a plane may lie off it, millimetres: coordinates are rounded in proportion to
/// their size.
double plane_tolerance(const SurfaceMesh& surface);

}  // namespace cadmorph
