#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/mesh.h"

namespace cadmorph::testing {

/// What a run of the program came to.
struct RunResult {
  int exit_code;
  std::string out, err;
};

/// Runs `cadmorph ARGUMENTS` by the shell, in `folder`; `setup` is put before it ("ulimit -f 8;").
RunResult run_cadmorph(const std::filesystem::path& folder, const std::string& arguments,
                       const std::string& setup = "");

/// A folder of its own for a test, with box.step, box_moved.step, box_chamfer.step, box_inch.step
/// and box.vtu (hexahedra) in it; gone when the object is.
class Workplace {
 public:
  Workplace();
  ~Workplace();
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  RunResult run(const std::string& arguments, const std::string& setup = "") const {
    return run_cadmorph(folder_, arguments, setup);
  }
  /// Writes sphere_moved.step: the sphere of models/shapes/sphere_in_box.step moved along x.
  void make_moved_sphere(double shift) const;
  /// Writes v0.step, v1.step, ...: boxes of length 10, 10.1, ...; returns their names in a line.
  std::string make_boxes(int count) const;

  void write(const std::string& name, const std::string& text) const;
  std::string read(const std::string& name) const;
  bool has(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

  /// Names of all files, hidden ones included.
  std::set<std::string> files() const;

 private:
  std::filesystem::path folder_;
};

/// The box [0, 10] x [0, 20] x [0, 30] in n x 2n x 3n hexahedra.
Mesh box_mesh(int n);

/// Lines of a text.
std::size_t line_count(const std::string& text);

/// A file of the repository.
std::filesystem::path source_file(const std::string& path);

}  // namespace cadmorph::testing
