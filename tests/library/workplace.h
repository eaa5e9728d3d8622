#pragma once

#include <filesystem>
#include <string>

namespace cadmorph::testing {

/// A file of the repository's models: "shapes/box.step".
std::filesystem::path model(const std::string& path);

/// The bytes of a file.
std::string read_file(const std::filesystem::path& path);

/// A folder of its own for a test; gone when the object is.
class Workplace {
 public:
  Workplace();
  ~Workplace();
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }
  /// Runs `cadmorph ARGUMENTS` there; returns its exit code.
  int run(const std::string& arguments) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace cadmorph::testing
