#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/mesh.h"
#include "core/mesh_file.h"

namespace cadmorph {

class Hdf5File;

/// Writes copies of a mesh file with other coordinates.
class MeshCopier {
 public:
  virtual ~MeshCopier() = default;

  /// Writes a copy of the file to `target`, whole or not at all. `before` (N x 3) are the
  /// coordinates as they were read, `after` those of the copy: a coordinate that is the same in
  /// both keeps its bytes, and so does all else. Throws IoError, leaving nothing behind;
  /// InvalidInputError for coordinates that the format can't hold.
  virtual void write(const std::filesystem::path& target, const Points& before,
                     const Points& after) const = 0;

  /// Throws InvalidInputError where no copy can be written to `target`, before a morph is begun.
  virtual void check_target(const std::filesystem::path& /*target*/) const {}

  /// Whether copies have other files with the coordinates, of names that are the same for all: each
  /// copy needs a folder of its own.
  virtual bool needs_folder() const { return false; }

  /// The coordinates that a reader of such a copy will find, where the file has too few digits for
  /// some of `after`; empty where it holds them all, and where write_accepted finds them itself.
  virtual Points readable(const Points& /*before*/, const Points& /*after*/) const { return {}; }

  /// Writes a copy as `write` does. Before it appears `accept` is given what a reader will find, as
  /// of readable; where it throws, nothing is left behind.
  virtual void write_accepted(const std::filesystem::path& target, const Points& before,
                              const Points& after,
                              const std::function<void(const Points&)>& accept) const {
    accept(readable(before, after));
    write(target, before, after);
  }

  /// Whether a copy can carry extra arrays: write_arrays then takes the place of write.
  virtual bool takes_arrays() const { return false; }
  virtual void write_arrays(const std::filesystem::path& /*target*/, const Points& /*after*/,
                            const ExtraArrays& /*extra*/) const {}

  /// Copies of the file's arrays, where the format has arrays of nodes and cells.
  virtual std::vector<DataArray> arrays() const { return {}; }
};

/// A mesh file read.
struct ReadMesh {
  Mesh mesh;                            ///< not yet checked (see check_mesh)
  std::vector<std::string> remarks;     ///< what its user should know, a sentence each
  std::vector<std::string> notes = {};  ///< the same where there is nothing to do about it
  std::unique_ptr<const MeshCopier> copier;
};

/// What tells the format of a file.
struct FileStart {
  std::filesystem::path path;
  bool is_folder = false;
  std::string extension;  ///< lower case, with the dot, that of a compressed file without ".gz"
  std::string bytes;      ///< the first 64 KiB, uncompressed; empty for a folder
  /// The file as HDF5, from when a format asks for it: opening it costs a process.
  mutable std::shared_ptr<const Hdf5File> hdf5 = {};
};

enum class Recognition {
  No,
  Possible,  ///< nothing speaks against it: the extension decides
  Sure,
};

/// A format of mesh files: one source in core/formats, one line in the table of formats.cpp.
struct MeshFormat {
  std::string_view name;                     ///< "SU2"
  std::vector<std::string_view> extensions;  ///< lower case, with the dot, the usual one first
  Recognition (*recognise)(const FileStart&);
  /// Throws IoError for a file that is damaged, truncated or holds what can't be read: what, where
  /// (line or byte), what was expected.
  ReadMesh (*read)(const std::filesystem::path&);
  bool is_of_finite_volumes = false;  ///< whether its solvers work by finite volumes, the cells
};

/// All formats.
std::span<const MeshFormat> mesh_formats();

/// The format of a file or folder, by its content; by its name where the content leaves a choice.
/// Throws IoError when there is no such file, or it is of no known format.
const MeshFormat& format_of(const std::filesystem::path& path);

/// The extension of a mesh file that tells its format, in its own spelling: ".su2", ".b8.ugrid",
/// ".msh.gz"; empty for a folder or a name without one.
std::string mesh_extension(const std::filesystem::path& path);

/// Whether the name is one of VTK's formats, which any mesh can be written in.
bool is_vtk_name(const std::filesystem::path& path);

/// Whether the extension is that of a mesh format.
bool is_mesh_name(const std::filesystem::path& path);

/// Whether a path is a folder that holds a mesh: an output folder of an earlier run.
bool is_mesh_folder(const std::filesystem::path& path);

/// Throws InvalidInputError where a copy of the mesh file `mesh` can't have the name `target`,
/// since that says another format: all but VTK's. Throws as format_of.
void check_copy_name(const std::filesystem::path& mesh, const std::filesystem::path& target);

/// Throw IoError: "can't read the mesh PATH: WHY".
[[noreturn]] void fail_reading(const std::filesystem::path& path, const std::string& why);
[[noreturn]] void fail_writing(const std::filesystem::path& path, const std::string& why);

}  // namespace cadmorph
