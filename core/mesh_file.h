#pragma once

#include <filesystem>
#include <map>
#include <memory>

#include "core/mesh.h"

namespace cadmorph {

/// Extra arrays to write beside those of the file; rows are nodes or cells.
struct ExtraArrays {
  std::map<std::string, RowMatrix> point_arrays;
  std::map<std::string, RowMatrix> cell_arrays;
  std::map<std::string, std::vector<int>> point_integers;
  std::map<std::string, std::vector<int>> cell_integers;
};

enum class ArrayLocation { Point, Cell, Field };

/// An array of a mesh file.
struct DataArray {
  std::string name;
  ArrayLocation location = ArrayLocation::Point;
  std::string type;  ///< as VTK names it: double, int, vtktypeint64, string, ...
  bool is_integral = false;
  RowMatrix values = {};  ///< tuples x components; empty for texts
  /// Bits of 64-bit integers, which `values` may round, tuple after tuple; empty for other types.
  std::vector<std::int64_t> wide_integers = {};
  std::vector<std::string> texts = {};  ///< of an array of strings
};

/// A mesh file held open: its mesh, and everything else in it (arrays, field data, names, types),
/// so that a copy with other coordinates loses nothing.
class MeshFile {
 public:
  /// Reads a .vtu (ascii, binary, appended, compressed; XML) or legacy .vtk unstructured grid.
  /// Throws IoError when the file is missing, no mesh, truncated or damaged (what, where, remedy);
  /// InvalidInputError when its contents are invalid (see check_mesh). VTK prints nothing
  /// meanwhile; its logger on stderr stays off from then on.
  explicit MeshFile(const std::filesystem::path& path);
  ~MeshFile();
  MeshFile(MeshFile&&) noexcept;
  MeshFile& operator=(MeshFile&&) noexcept;

  const Mesh& mesh() const;
  const std::filesystem::path& path() const;

  /// Copies of all arrays.
  std::vector<DataArray> arrays() const;

  /// Writes a copy with only the coordinates replaced (N x 3, as float64) and `extra` added (in
  /// place of arrays of the same names), in the input's own encoding and compressor; where `path`
  /// ends in .vtu or .vtk, in that format. Legacy files come out binary, for VTK's legacy ascii
  /// keeps 11 digits only, and have no node order of polyhedra, only their faces. The file appears
  /// whole or not at all: written beside `path` (beside its target, if that is a link), flushed to
  /// disk, then renamed. Throws IoError, leaving nothing behind; InvalidInputError for wrong sizes
  /// or coordinates that are not finite.
  void write(const std::filesystem::path& path, const Points& points,
             const ExtraArrays& extra = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes `mesh` as a new .vtu (appended binary, zlib-compressed) or .vtk, its regions as an
/// integer cell array (`RegionId` if `region_array` is empty): for generators and tests. Throws as
/// above.
void write_mesh(const std::filesystem::path& path, const Mesh& mesh, const ExtraArrays& extra = {});

}  // namespace cadmorph
