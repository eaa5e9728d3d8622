#include "core/formats/formats.h"

#include <algorithm>
#include <cctype>
#include <system_error>

#include "core/byte_order_mark.h"
#include "core/errors.h"
#include "core/formats/source_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

// Of a file, to tell its format by: comments may come first, as in decks and text meshes.
constexpr std::size_t kStartBytes = 1 << 16;

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return text;
}

/// Names with two extensions that tell more than the last alone.
bool is_prefix_extension(const std::string& extension) {
  return extension == ".b8" || extension == ".lb8" || extension == ".b4" || extension == ".lb4" ||
         extension == ".r8" || extension == ".lr8" || extension == ".r4" || extension == ".lr4" ||
         extension == ".cas" || extension == ".msh";
}

std::string format_names() {
  std::string names;
  for (const MeshFormat& format : mesh_formats())
    names += (names.empty() ? "" : ", ") + std::string(format.name);
  return names;
}

FileStart start_of(const fs::path& path) {
  FileStart start;
  start.path = path;
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) fail_reading(path, "there is no such file");
  if (fs::is_fifo(status) || fs::is_socket(status))
    fail_reading(path, "it is a pipe, which can be read but once; write it into a file first");
  start.is_folder = fs::is_directory(status);
  if (start.is_folder) return start;
  start.bytes = read_start(path, kStartBytes);
  start.bytes.erase(0, byte_order_mark_size(start.bytes));
  if (start.bytes.empty()) fail_reading(path, "it is empty; write or copy it again");
  std::string extension = lower(mesh_extension(path));
  if (extension.ends_with(".gz")) extension.resize(extension.size() - 3);
  start.extension = std::move(extension);
  return start;
}

bool has_extension(const MeshFormat& format, const std::string& extension) {
  return std::ranges::find(format.extensions, extension) != format.extensions.end();
}

}  // namespace

std::span<const MeshFormat> mesh_formats() {
  static const MeshFormat formats[] = {
      abaqus_format(),      ansys_format(),   cgns_format(),    exodus_format(),   fluent_format(),
      fluent_hdf5_format(), gmsh_format(),    ls_dyna_format(), med_format(),      medit_format(),
      mfem_format(),        nastran_format(), netgen_format(),  openfoam_format(), su2_format(),
      ugrid_format(),       unv_format(),     vtk_format(),     vtkhdf_format(),   xdmf_format(),
  };
  return formats;
}

const MeshFormat& format_of(const fs::path& path) {
  const FileStart start = start_of(path);
  const MeshFormat* possible = nullptr;
  const MeshFormat* named = nullptr;
  for (const MeshFormat& format : mesh_formats()) {
    const Recognition recognition = format.recognise(start);
    if (recognition == Recognition::Sure) return format;
    if (!has_extension(format, start.extension)) continue;
    named = &format;
    if (recognition == Recognition::Possible && !possible) possible = &format;
  }
  if (possible) return *possible;
  if (start.is_folder)
    fail_reading(path, "it is a folder without a mesh of OpenFOAM (constant/polyMesh)");
  if (named)
    fail_reading(path, "its name ends as that of a " + std::string(named->name) +
                           " file, but it does not begin as one: it is damaged or of another kind");
  fail_reading(path, "it is of no format that is known: " + format_names());
}

std::string mesh_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  fs::path stem = path.stem();
  const auto take = [&] {
    extension = stem.extension().string() + extension;
    stem = stem.stem();
  };
  if (lower(extension) == ".gz" || lower(extension) == ".h5") take();
  if (is_prefix_extension(lower(stem.extension().string()))) take();
  return extension;
}

bool is_vtk_name(const fs::path& path) { return has_extension(vtk_format(), path.extension()); }

bool is_mesh_name(const fs::path& path) {
  const std::string extension = lower(mesh_extension(path));
  return std::ranges::any_of(
      mesh_formats(), [&](const MeshFormat& format) { return has_extension(format, extension); });
}

bool is_mesh_folder(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return false;
  FileStart start;
  start.path = path;
  start.is_folder = true;
  return std::ranges::any_of(mesh_formats(), [&](const MeshFormat& format) {
    return format.recognise(start) != Recognition::No;
  });
}

void check_copy_name(const fs::path& mesh, const fs::path& target) {
  if (is_vtk_name(target)) return;
  const MeshFormat& own = format_of(mesh);
  const std::string extension = lower(mesh_extension(target));
  const auto refuse = [&](const std::string& other) {
    const std::string spelling = mesh_extension(mesh);
    throw InvalidInputError("can't write " + target.string() + ": a copy keeps the format of " +
                            mesh.string() + ", " + std::string(own.name) + ", and this is " +
                            other + ". Name it " +
                            (spelling.empty() ? "a folder" : "*" + spelling) +
                            (spelling == ".vtu" ? "" : ", or *.vtu to look at it"));
  };
  std::error_code error;
  const bool is_folder = fs::is_directory(mesh, error);
  if (!is_folder && fs::is_directory(target, error)) refuse("a folder");
  if (extension.empty() || extension == lower(mesh_extension(mesh))) return;
  for (const MeshFormat& format : mesh_formats())
    if (has_extension(format, extension) && (is_folder || !has_extension(own, extension)))
      refuse("a name of " + std::string(format.name));
  if (own.name == vtk_format().name) refuse("a name of another");
}

void fail_reading(const fs::path& path, const std::string& why) {
  throw IoError("can't read the mesh " + path.string() + ": " + why);
}

void fail_writing(const fs::path& path, const std::string& why) {
  throw IoError("can't write the mesh " + path.string() + ": " + why);
}

}  // namespace cadmorph
