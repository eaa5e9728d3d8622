#include "apps/output_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

[[noreturn]] void refuse(const fs::path& output, const std::string& why) {
  throw OutputError("can't write " + output.string() + ": " + why);
}

// Removes the file unless it was renamed away.
struct TemporaryFile {
  fs::path path;
  ~TemporaryFile() {
    std::error_code ignored;
    if (!path.empty()) fs::remove(path, ignored);
  }
};

bool write_and_sync(std::FILE* file, const std::string& text) {
  return std::fwrite(text.data(), 1, text.size(), file) == text.size() && std::fflush(file) == 0 &&
         fsync(fileno(file)) == 0;
}

}  // namespace

void check_output(const fs::path& output, const std::vector<fs::path>& inputs) {
  std::error_code error;
  for (const fs::path& input : inputs)
    if (fs::equivalent(output, input, error))
      throw InvalidInputError("the output " + output.string() +
                              " is one of the inputs; name another file with -o");
  const fs::path folder = folder_of(output);
  if (!fs::exists(folder, error)) refuse(output, "there is no folder " + folder.string());
  if (!fs::is_directory(folder, error)) refuse(output, folder.string() + " is no folder");
  if (access(folder.c_str(), W_OK | X_OK) != 0)
    refuse(output, "no permission to write in the folder " + folder.string());
  if (fs::exists(output, error) && !fs::is_regular_file(output, error))
    refuse(output, "it exists and is no regular file");
}

fs::path failed_path(const fs::path& output) {
  return folder_of(output) / (output.stem().string() + ".failed" + output.extension().string());
}

void write_text(const fs::path& path, const std::string& text) {
  std::string name = path.filename().string();
  name.insert(0, 1, '.').append(1, '.').append(std::to_string(getpid())).append(".tmp");
  TemporaryFile beside{folder_of(path) / name};
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(
      std::fopen(beside.path.c_str(), "wb"), [](std::FILE* f) { return std::fclose(f); });
  if (!file || !write_and_sync(file.get(), text)) refuse(path, std::strerror(errno));
  std::error_code error;
  fs::rename(beside.path, path, error);
  if (error) refuse(path, error.message());
  beside.path.clear();
}

}  // namespace cadmorph
