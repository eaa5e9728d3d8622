#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "api.h"
#include "types.h"

namespace cadmorph::CADMORPH_V1 {

/// A named part of a mesh: a marker, a patch, a physical group, a set.
struct MeshGroup {
  std::string name;
  std::vector<Index> nodes;
  std::string kind = "group";  ///< in the words of its format
};

/// A mesh as arrays.
struct MeshArrays {
  Points points;  ///< N x 3, in the mesh's own unit
  std::vector<std::uint8_t>
      types;                   ///< C numbers of VTK cell types: shells, solids, of order 1 and 2
  std::vector<Index> offsets;  ///< C + 1 positions in `connectivity`, from 0
  std::vector<Index> connectivity;  ///< node ids from 0, cell after cell, in VTK's order
  std::vector<int> regions = {};    ///< C numbers, or empty; faces between regions are surface, too
  std::vector<MeshGroup> groups = {};
};

/// Elements of one of gmsh's types: gmsh::model::mesh::getElements.
struct GmshElements {
  int type;
  std::vector<std::size_t> node_tags;  ///< element after element, in gmsh's order
};

/// Coordinates rounded to the digits that a file's format holds.
struct WrittenMesh {
  std::filesystem::path path = {};       ///< empty: nothing was written
  double largest_rounding = 0;           ///< in the mesh's unit; 0: none
  double largest_rounding_per_edge = 0;  ///< in the node's shortest edge
};

/// A mesh. Copies share the data; it does not change, so threads may share it.
class Mesh {
 public:
  /// Reads a file or folder of any format in docs/formats.md. Throws IoError where it is missing,
  /// no mesh, truncated or damaged; InvalidInputError where its contents are invalid.
  static Mesh read(const std::filesystem::path& path);

  /// Takes arrays. `name` stands for a path in messages. Throws InvalidInputError for sizes that do
  /// not fit, ids out of range, values that are not finite, types that are none, polyhedra (which a
  /// file can bring).
  explicit Mesh(const MeshArrays& arrays, const std::string& name = "mesh in memory");

  /// Takes what gmsh's API gives: the tags of the nodes, their coordinates (N x 3, in that order)
  /// and the elements. Nodes keep their order. Throws InvalidInputError as above, and for tags and
  /// types that are not known.
  static Mesh from_gmsh(std::span<const std::size_t> node_tags, const Points& coordinates,
                        std::span<const GmshElements> elements,
                        const std::string& name = "mesh of gmsh");

  /// The same mesh at other positions (N x 3): where a morph begins that goes on from another one.
  /// Its file, and what `write` copies, is the one read. Throws InvalidInputError.
  Mesh at(const Points& positions) const;

  const Points& points() const;  ///< N x 3, in the mesh's own unit
  std::vector<std::uint8_t> types() const;
  const std::vector<Index>& offsets() const;
  const std::vector<Index>& connectivity() const;
  const std::vector<int>& regions() const;
  std::vector<MeshGroup> groups() const;
  Index node_count() const { return points().rows(); }
  Index cell_count() const { return static_cast<Index>(offsets().size()) - 1; }
  const std::string& format() const;                ///< "SU2", "VTK", ...; "memory"
  std::string name() const;                         ///< path, or the name given
  const std::vector<std::string>& remarks() const;  ///< what the file's user should know

  /// Writes a copy with other positions (N x 3): of a file to the byte as it was but for
  /// coordinates that changed, in its own format or as .vtu and .vtk; of arrays as .vtu and .vtk.
  /// It appears whole or not at all. Throws OutputError; InvalidInputError for a wrong size, what
  /// is not finite, a name of another format, numbers too coarse for the mesh.
  WrittenMesh write(const std::filesystem::path& path, const Points& positions) const;

  struct Impl;
  explicit Mesh(std::shared_ptr<const Impl> impl);
  const Impl& impl() const { return *impl_; }

 private:
  std::shared_ptr<const Impl> impl_;
};

}  // namespace cadmorph::CADMORPH_V1
