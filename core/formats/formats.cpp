#include "core/formats/formats.h"

#include <algorithm>
#include <cctype>
#include <system_error>

#include "core/errors.h"
#include "core/formats/source_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr std::size_t kStartBytes = 1 << 16;

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return text;
}

/// Names with two extensions that tell more than the last alone.
bool is_prefix_extension(const std::string& extension) {
  return extension == ".b8" || extension == ".lb8" || extension == ".b4" || extension == ".lb4" ||
         extension == ".r8" || extension == ".lr8" || extension == ".cas" || extension == ".msh";
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
  start.is_folder = fs::is_directory(status);
  if (start.is_folder) return start;
  start.bytes = read_start(path, kStartBytes);
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
      cgns_format(),
      exodus_format(),
      med_format(),
      su2_format(),
      vtk_format(),
      vtkhdf_format(),
      xdmf_format(),
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

void fail_reading(const fs::path& path, const std::string& why) {
  throw IoError("can't read the mesh " + path.string() + ": " + why);
}

void fail_writing(const fs::path& path, const std::string& why) {
  throw IoError("can't write the mesh " + path.string() + ": " + why);
}

}  // namespace cadmorph
