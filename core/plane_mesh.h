#pragma once

#include <optional>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// Returns the axis (0, 1 or 2) along which a mesh of shell cells has no extent, to 1e-12 of its
/// size at `points` (N x 3); -1 where there is none, or where the mesh has solid cells.
int flat_axis(const Mesh& mesh, const Points& points);

/// The normal of a plane mesh (flat_axis), of length 1, about which most of its area at `points`
/// (N x 3) turns to the left; zero for other meshes.
Eigen::Vector3d plane_normal(const Mesh& mesh, const Points& points);

/// The same where it is that of the mesh at `before` and `after` (N x 3 each); zero where the mesh
/// is not in one plane, or not in the same.
Eigen::Vector3d plane_normal(const Mesh& mesh, const Points& before, const Points& after);

/// The cells of a plane mesh that are turned over: they go round the other way than most of its
/// area does at `points` (N x 3); ids, ascending. `mesh`: in one sense.
std::vector<Index> turned_cells(const Mesh& mesh, const Points& points);

/// The mesh with cells that all go round the same way, where it is in a plane and patches of it go
/// round the other way than most of its area: mesh generators take the sense of each face of the
/// CAD. A patch is what cells make up that go round the edges they share in opposite senses; cells
/// of it that are turned over stay so. Nothing where all go round the same way already.
std::optional<Mesh> in_one_sense(const Mesh& mesh);

/// A plane mesh as one layer of solid cells 1 thick, as finite-volume programs take it: wedges,
/// hexahedra and polyhedra in the place of its triangles, quads and polygons (corners alone), its
/// other cells as they are. Node n of N lies at `points` (N x 3), node N + n off the plane. Volumes
/// are positive where the mesh's cells turn the way that most of its area does.
Mesh one_layer(const Mesh& mesh, const Points& points);

/// Marks the nodes (N) of a plane mesh on its border, between its regions, and of its cells of
/// lower dimension. `points` as in one_layer.
std::vector<char> border_nodes(const Mesh& mesh, const Points& points);

}  // namespace cadmorph
