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

/// A mesh file held open: its mesh, and everything else in it (arrays, field data, names, types),
/// so that a copy with other coordinates loses nothing.
class MeshFile {
 public:
  /// Reads a .vtu (ascii, binary, appended, compressed; XML) or legacy .vtk unstructured grid.
  /// Throws IoError when the file is missing, no mesh, truncated or damaged (what, where, remedy);
  /// InvalidInputError when its contents are invalid (see check_mesh).
  explicit MeshFile(const std::filesystem::path& path);
  ~MeshFile();
  MeshFile(MeshFile&&) noexcept;
  MeshFile& operator=(MeshFile&&) noexcept;

  const Mesh& mesh() const;
  const std::filesystem::path& path() const;

  /// Writes a copy with only the coordinates replaced (as float64) and `extra` added, in the
  /// input's own format and compressor. The file appears whole or not at all: written beside
  /// `path`, flushed to disk, then renamed. Throws IoError, leaving nothing behind.
  void write(const std::filesystem::path& path, const Points& points,
             const ExtraArrays& extra = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes `mesh` as a new .vtu (appended binary, zlib-compressed): for generators and tests.
void write_mesh(const std::filesystem::path& path, const Mesh& mesh, const ExtraArrays& extra = {});

}  // namespace cadmorph
