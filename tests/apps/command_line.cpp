#include "command_line.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "core/mesh_file.h"

namespace cadmorph::testing {
namespace {

namespace fs = std::filesystem;

std::string contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

fs::path new_folder() {
  std::string pattern = (fs::temp_directory_path() / "cadmorph-test-XXXXXX").string();
  if (!mkdtemp(pattern.data())) throw std::runtime_error("no folder for the test");
  return pattern;
}

int exit_code_of(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : -1; }

void make_fixtures(const fs::path& folder, const std::string& argument) {
  const std::string command = std::string("'") + CADMORPH_STEP_FIXTURES + "' '" + folder.string() +
                              "' " + argument + " > /dev/null";
  if (std::system(command.c_str()) != 0) throw std::runtime_error("no STEP files for the test");
}

}  // namespace

RunResult run_cadmorph(const fs::path& folder, const std::string& arguments,
                       const std::string& setup) {
  const fs::path aside = new_folder();
  const std::string command = "cd '" + folder.string() + "' && (" + setup + " '" +
                              CADMORPH_PROGRAM + "' " + arguments + ") > " +
                              (aside / "out").string() + " 2> " + (aside / "err").string();
  const int status = std::system(command.c_str());
  RunResult result{exit_code_of(status), contents(aside / "out"), contents(aside / "err")};
  fs::remove_all(aside);
  return result;
}

Workplace::Workplace() : folder_(new_folder()) {
  make_fixtures(folder_, "");
  write_mesh(folder_ / "box.vtu", box_mesh(3));
}

Workplace::~Workplace() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

void Workplace::make_moved_sphere(double shift) const {
  make_fixtures(folder_, std::to_string(shift));
}

std::string Workplace::make_boxes(int count) const {
  make_fixtures(folder_, "boxes " + std::to_string(count));
  std::string names;
  for (int i = 0; i < count; ++i) names += (i > 0 ? " v" : "v") + std::to_string(i) + ".step";
  return names;
}

void Workplace::write(const std::string& name, const std::string& text) const {
  std::ofstream(folder_ / name, std::ios::binary) << text;
}

std::string Workplace::read(const std::string& name) const { return contents(folder_ / name); }

std::set<std::string> Workplace::files() const {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_))
    names.insert(entry.path().filename().string());
  return names;
}

Mesh box_mesh(int n) {
  const Index nx = n, ny = 2 * n, nz = 3 * n;
  const auto id = [&](Index i, Index j, Index k) { return (k * (ny + 1) + j) * (nx + 1) + i; };
  Mesh mesh;
  mesh.points.resize((nx + 1) * (ny + 1) * (nz + 1), 3);
  for (Index k = 0; k <= nz; ++k)
    for (Index j = 0; j <= ny; ++j)
      for (Index i = 0; i <= nx; ++i)
        mesh.points.row(id(i, j, k)) << 10.0 * i / nx, 20.0 * j / ny, 30.0 * k / nz;
  mesh.offsets.push_back(0);
  for (Index k = 0; k < nz; ++k)
    for (Index j = 0; j < ny; ++j)
      for (Index i = 0; i < nx; ++i) {
        for (const Index node :
             {id(i, j, k), id(i + 1, j, k), id(i + 1, j + 1, k), id(i, j + 1, k), id(i, j, k + 1),
              id(i + 1, j, k + 1), id(i + 1, j + 1, k + 1), id(i, j + 1, k + 1)})
          mesh.connectivity.push_back(node);
        mesh.types.push_back(CellType::Hexahedron);
        mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
      }
  return mesh;
}

std::size_t line_count(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

fs::path source_file(const std::string& path) { return fs::path(CADMORPH_SOURCE_DIR) / path; }

}  // namespace cadmorph::testing
