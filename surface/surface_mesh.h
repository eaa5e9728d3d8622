#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/boundary.h"
#include "core/mesh.h"
#include "surface/ids.h"

namespace cadmorph {

/// The boundary with its own node numbering (rows of Boundary::nodes), in millimetres.
struct SurfaceMesh {
  Points points;                                 ///< millimetres
  IdVector<FacetId, std::vector<RowId>> facets;  ///< rows, corners first
  IdVector<FacetId, int> corners;                ///< corner count of each facet
  std::vector<int> incident_offsets;             ///< nodes + 1 positions in `incident_facets`
  std::vector<FacetId> incident_facets;          ///< ascending at each node
  Eigen::VectorXd local_length;  ///< shortest incident facet edge of each node, millimetres
  /// Of a node that is no facet's corner: the ends of its edge, or the corners of its facet; -1.
  IdVector<RowId, std::array<RowId, 4>> between;
  Eigen::VectorXd own_length;  ///< of a mid-side node: its edge's length; else local_length

  std::span<const FacetId> facets_at(RowId node) const {
    return {incident_facets.data() + incident_offsets[node],
            incident_facets.data() + incident_offsets[node + 1]};
  }
  bool is_corner(RowId node) const { return between[node][0] < 0; }
  /// Mean of the nodes that a node without a corner lies between, at `at`.
  Eigen::Vector3d middle(RowId node, const Points& at) const;
};

SurfaceMesh make_surface_mesh(const Mesh& mesh, const Boundary& boundary, double unit_mm);

/// The row of a mesh node that is one of Boundary::nodes.
RowId row_of(const Boundary& boundary, Index node);

/// Area vector of a facet's corner polygon (its direction: the facet's normal).
Eigen::Vector3d area_vector(const SurfaceMesh& surface, const Points& points, FacetId facet);

/// Number of a facet's corners that turn against its area vector, or with it by `sine` at most;
/// without, none in a convex facet.
int inward_corners(const SurfaceMesh& surface, const Points& points, FacetId facet,
                   double sine = 0);

/// Mean of a facet's corners.
Eigen::Vector3d centroid(const SurfaceMesh& surface, const Points& points, FacetId facet);

}  // namespace cadmorph
