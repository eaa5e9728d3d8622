#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

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

/// How far the coordinates in a file are from those that were to be written, where the file has
/// too few digits for them.
struct CoordinateRounding {
  double largest = 0;   ///< in the mesh's unit
  double relative = 0;  ///< the largest in the node's shortest edge
  Index node = -1;      ///< where; -1: nothing was rounded
};

/// A mesh file held open: its mesh, and everything else in it, so that a copy with other
/// coordinates loses nothing.
class MeshFile {
 public:
  /// Reads a file (or folder) of any format in docs/formats.md, known by its content. Throws
  /// IoError when it is missing, no mesh, truncated or damaged (what, where, remedy);
  /// InvalidInputError when its contents are invalid (see check_mesh). VTK prints nothing
  /// meanwhile; its logger on stderr stays off from then on.
  explicit MeshFile(const std::filesystem::path& path);

  /// A mesh that comes from no file: copies of it are new VTK files (.vtu, .vtk). `name` stands for
  /// the path in messages. Throws InvalidInputError (see check_mesh).
  MeshFile(Mesh mesh, std::string name);
  ~MeshFile();
  MeshFile(MeshFile&&) noexcept;
  MeshFile& operator=(MeshFile&&) noexcept;

  const Mesh& mesh() const;
  const std::filesystem::path& path() const;
  /// "SU2", "VTK", ...
  const std::string& format() const;
  /// What the file's user should know, a sentence each: what in it is of the base, what was left
  /// out.
  const std::vector<std::string>& remarks() const;
  /// What asks for nothing.
  const std::vector<std::string>& notes() const;

  /// Copies of all arrays; none of formats that have no arrays of nodes and cells.
  std::vector<DataArray> arrays() const;

  /// Whether a copy at `path` holds extra arrays: one in a format of VTK does.
  bool takes_arrays(const std::filesystem::path& path) const;

  /// Throws InvalidInputError where no copy can be written to `path`: its name says another format
  /// (VTK's apart), or files that belong to the mesh would have to lie elsewhere.
  void check_target(const std::filesystem::path& path) const;

  /// Whether a copy at `path` needs a folder of its own: a deck includes files that hold nodes.
  bool needs_folder(const std::filesystem::path& path) const;

  /// Writes a copy with only the coordinates replaced (N x 3): a coordinate that is as it was keeps
  /// its bytes. It appears whole or not at all: written beside `path` (beside its target, if that
  /// is a link), flushed to disk, then renamed. Returns how far coordinates were rounded to the
  /// digits that the file has; throws InvalidInputError above a thousandth of the shortest edge.
  ///
  /// VTK's formats hold float64 always, in the input's own encoding and compressor, and `extra` (in
  /// place of arrays of the same names). Legacy files come out binary, for VTK's legacy ascii keeps
  /// 11 digits only, and have no node order of polyhedra, only their faces. A path that ends in
  /// .vtu or .vtk makes such a file of any input; of one that is not VTK's, with its groups as
  /// point arrays and without its other contents.
  ///
  /// Throws IoError, leaving nothing behind; InvalidInputError for wrong sizes, coordinates that
  /// are not finite, extra arrays for a format without, and as check_target.
  CoordinateRounding write(const std::filesystem::path& path, const Points& points,
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
