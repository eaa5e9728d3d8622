#include "apps/pipeline/output_file.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "core/temporary_file.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

[[noreturn]] void refuse(const fs::path& output, const std::string& why) {
  throw OutputError("can't write " + output.string() + ": " + why);
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
  if (fs::exists(output, error) && !fs::is_regular_file(output, error))
    refuse(output, "it exists and is no regular file");
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

fs::path default_output(const fs::path& mesh) {
  return mesh.parent_path() / (mesh.stem().string() + ".morphed" + mesh.extension().string());
}

fs::path failed_path(const fs::path& output) {
  return folder_of(output) / (output.stem().string() + ".failed" + output.extension().string());
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
