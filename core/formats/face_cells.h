#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// A mesh as its faces and the cells on both sides of each, which is how OpenFOAM and Fluent store
/// one. The faces of a plane mesh are its edges.
struct FaceList {
  std::vector<Index> offsets = {0};  ///< faces + 1 positions in `nodes`
  std::vector<Index> nodes;          ///< face after face; the normal points out of the owner
  std::vector<Index> owner;          ///< cell of each face; -1: it has none
  std::vector<Index> neighbour;      ///< the other cell; -1: the face is of the boundary

  Index count() const { return std::ssize(offsets) - 1; }
  std::span<const Index> face(Index f) const {
    return {nodes.data() + offsets[f], std::size_t(offsets[f + 1] - offsets[f])};
  }
  void add_face(std::span<const Index> face) {
    nodes.insert(nodes.end(), face.begin(), face.end());
    offsets.push_back(std::ssize(nodes));
  }
};

/// Gives a mesh, of points alone so far, the solid cells 0 to `cells` - 1 that the faces bound:
/// tetrahedra, pyramids, wedges and hexahedra where the faces are those of one and the map of such
/// an element is valid, polyhedra else: finite volumes need no map, and warped hexahedra are sound
/// to them. What is turned inside out stays an element, which tells it. The order of the faces
/// alone decides the order of nodes in a cell. Throws IoError, naming `path`, for a cell of less
/// than four faces.
void add_solid_cells(Mesh& mesh, const FaceList& faces, Index cells,
                     const std::filesystem::path& path);

/// Appends the plane cells that edges bound, each with its owner at the left: triangles,
/// quadrilaterals, polygons. Throws IoError, naming `path`, for a cell whose edges form no ring.
void add_plane_cells(Mesh& mesh, const FaceList& edges, Index cells,
                     const std::filesystem::path& path);

}  // namespace cadmorph
