#include "apps/pipeline/output_file.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "core/formats/mesh_format.h"
#include "core/temporary_file.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

/// Without a final slash.
fs::path trimmed(const fs::path& path) { return path.has_filename() ? path : path.parent_path(); }

fs::path folder_of(const fs::path& file) {
  const fs::path folder = trimmed(file).parent_path();
  return folder.empty() ? fs::path(".") : folder;
}

[[noreturn]] void refuse(const fs::path& output, const std::string& why) {
  throw OutputError("can't write " + output.string() + ": " + why);
}

// That tells the mesh's format; the name of a folder may hold a point.
std::string extension_of(const fs::path& path) {
  std::error_code error;
  return is_mesh_name(path) || fs::is_regular_file(path, error) ? mesh_extension(path) : "";
}

/// The suffix before the extension.
fs::path with_suffix(fs::path path, const std::string& suffix) {
  path = trimmed(path);
  if (path.filename() == "." || path.filename() == "..") path = fs::canonical(path);
  const std::string name = path.filename().string(), extension = extension_of(path);
  return path.parent_path() / (name.substr(0, name.size() - extension.size()) + suffix + extension);
}

}  // namespace

void check_output(const fs::path& output, const std::vector<fs::path>& inputs) {
  std::error_code error;
  for (const fs::path& input : inputs)
    if (is_same_file(output, input))
      throw InvalidInputError("the output " + output.string() +
                              " is one of the inputs; name another file");
  const fs::path folder = folder_of(output);
  if (!fs::exists(folder, error)) refuse(output, "there is no folder " + folder.string());
  if (!fs::is_directory(folder, error)) refuse(output, folder.string() + " is no folder");
  if (access(folder.c_str(), W_OK | X_OK) != 0)
    refuse(output, "no permission to write in the folder " + folder.string());
  // A stream that leads to a file would have this replaced.
  const std::string place = fs::absolute(output, error).lexically_normal().string();
  const bool is_stream = place == "/dev/stdout" || place == "/dev/stderr" ||
                         place.starts_with("/dev/fd/") || place.starts_with("/proc/");
  if (is_stream ||
      (fs::exists(output, error) && !fs::is_regular_file(output, error) && !is_mesh_folder(output)))
    refuse(output, "it exists and is no regular file");
  if (fs::is_regular_file(output, error) && access(output.c_str(), W_OK) != 0)
    refuse(output, "it is write-protected");
}

void check_mesh_output(const fs::path& output, const std::vector<fs::path>& inputs) {
  check_output(output, inputs);
  check_output(failed_path(output), inputs);
}

bool is_same_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error)) return true;
  const auto full = [&](const fs::path& path) {
    return fs::weakly_canonical(fs::absolute(path, error), error);
  };
  const fs::path full_a = full(a);
  return !full_a.empty() && full_a == full(b);
}

fs::path default_output(const fs::path& mesh) { return with_suffix(mesh, ".morphed"); }

fs::path failed_path(const fs::path& output) {
  if (!is_vtk_name(output)) return vtu_path(output, ".failed");
  return with_suffix(output, ".failed");
}

fs::path vtu_path(const fs::path& output, const std::string& suffix) {
  const fs::path path = with_suffix(output, suffix);
  const std::string name = path.filename().string();
  return path.parent_path() / (name.substr(0, name.size() - extension_of(output).size()) + ".vtu");
}

std::string read_bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes;
  std::array<char, 1 << 16> block;
  while (file.read(block.data(), block.size()), file.gcount() > 0)
    bytes.append(block.data(), static_cast<std::size_t>(file.gcount()));
  if (!file.is_open() || file.bad())
    throw IoError(path.string() + ": can't be read (" + std::strerror(errno) + ")");
  return bytes;
}

void write_text(const fs::path& path, const std::string& text) {
  as_output([&] {
    TemporaryFile file(path);
    file.write(text.data(), text.size(), 0);
    file.commit();
  });
}

}  // namespace cadmorph
