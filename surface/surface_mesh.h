#pragma once

#include <array>
#include <vector>

#include "core/boundary.h"
#include "core/mesh.h"

namespace cadmorph {

/// The boundary with its own node numbering (rows of Boundary::nodes), in millimetres.
struct SurfaceMesh {
  Points points;                                       ///< millimetres
  std::vector<std::vector<int>> facets;                ///< rows, corners first
  std::vector<int> corners;                            ///< corner count of each facet
  std::vector<int> incident_offsets, incident_facets;  ///< facets of each node
  Eigen::VectorXd local_length;  ///< shortest incident facet edge of each node, millimetres
  /// Of a node that is no facet's corner: the ends of its edge, or the corners of its facet; -1.
  std::vector<std::array<int, 4>> between;
  Eigen::VectorXd own_length;  ///< of a mid-side node: its edge's length; else local_length

  bool is_corner(int node) const { return between[node][0] < 0; }
  /// Mean of the nodes that a node without a corner lies between, at `at`.
  Eigen::Vector3d middle(int node, const Points& at) const;
};

SurfaceMesh make_surface_mesh(const Mesh& mesh, const Boundary& boundary, double unit_mm);

/// Area vector of a facet's corner polygon (its direction: the facet's normal).
Eigen::Vector3d area_vector(const SurfaceMesh& surface, const Points& points, Index facet);

/// Number of a facet's corners that turn against its area vector, or with it by `sine` at most;
/// without, none in a convex facet.
int inward_corners(const SurfaceMesh& surface, const Points& points, Index facet, double sine = 0);

/// Mean of a facet's corners.
Eigen::Vector3d centroid(const SurfaceMesh& surface, const Points& points, Index facet);

}  // namespace cadmorph
