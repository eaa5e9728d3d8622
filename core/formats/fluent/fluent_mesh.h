#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/face_cells.h"
#include "core/mesh.h"

namespace cadmorph {

/// A zone of faces or cells.
struct FluentZone {
  Index id = 0;
  Index first = 0, end = 0;  ///< its faces, or cells, counted from 0
  Index type = 0;            ///< Fluent's number
  std::string name = {};     ///< empty: the file has none
  std::string word = {};     ///< for the type; empty: that of the number
};

/// A mesh as Fluent keeps it, in text, binary sections or HDF5.
struct FluentMesh {
  int dimension = 3;
  Points points;
  FaceList faces;
  std::vector<FluentZone> face_zones, cell_zones;
  std::vector<std::pair<Index, Index>> periodic_zones = {};  ///< ids of face zones a period apart

  /// Adds a face of the cells c0 and c1, counted from 1; 0: there is none.
  void add_face(std::span<const Index> nodes, Index c0, Index c1);
};

/// The mesh: zones of faces inside the mesh apart, all become groups, several zones of cells
/// regions too. Cells that adaption has divided are left out, so are their faces. Where there are
/// no cells, the faces are. Throws IoError, naming `path`.
Mesh to_mesh(FluentMesh&& fluent, const std::filesystem::path& path);

}  // namespace cadmorph
