#include "tests/core/formats/format_checks.h"

#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <random>

#include "core/errors.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

bool is_plane(const Points& points) { return (points.col(2).array() == points(0, 2)).all(); }

std::string contents_of(const fs::path& path) {
  return fs::is_directory(path) ? tree_of(path) : bytes_of(path);
}

/// Reads a file that may be damaged; true when it was taken.
bool is_taken(const fs::path& path) {
  try {
    const MeshFile file(path);
    return true;
  } catch (const Error& error) {
    INFO(error.what());
    CHECK(std::string(error.what()).find(path.filename().string()) != std::string::npos);
    return false;
  }
}

/// Tries the bytes cut off and changed.
void require_robust(const std::string& bytes,
                    const std::function<bool(std::string_view damaged)>& is_taken) {
  Index refused = 0;
  // Those that need a process each are more the fuzzers' (scripts/fuzz).
  const bool is_hdf5 = bytes.starts_with("\x89HDF");
  const std::size_t cuts = is_hdf5 ? 20 : 60;
  for (std::size_t i = 0; i < cuts; ++i) {
    const std::size_t size = bytes.size() * i / cuts;
    INFO("cut off after " << size << " bytes");
    if (!is_taken(std::string_view(bytes).substr(0, size))) ++refused;
  }
  CHECK(refused > 0);
  std::mt19937 random(5489);
  for (int i = 0; i < (is_hdf5 ? 60 : 200); ++i) {
    std::string damaged = bytes;
    const std::size_t place = random() % bytes.size();
    const bool is_digit = std::isdigit(static_cast<unsigned char>(bytes[place])) != 0;
    damaged[place] = is_digit && i % 2 ? char('0' + random() % 10) : char(random() % 256);
    INFO("byte " << place << " changed to " << int(damaged[place]));
    is_taken(damaged);
  }
}

}  // namespace

FormatFolder::FormatFolder() {
  std::string name = (fs::temp_directory_path() / "cadmorph-formats-XXXXXX").string();
  REQUIRE(mkdtemp(name.data()));
  path_ = name;
}

FormatFolder::~FormatFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

fs::path FormatFolder::put(const std::string& name, std::string_view bytes) const {
  const fs::path path = path_ / name;
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary).write(bytes.data(), std::ssize(bytes));
  return path;
}

std::string bytes_of(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  REQUIRE(stream);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::string tree_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), folder).string()] = bytes_of(entry.path());
  std::string all;
  for (const auto& [name, bytes] : files) all += name + "\n" + bytes + "\n";
  return all;
}

Points affine(const Points& points) {
  Eigen::Matrix3d map;
  map << 1.01, 0.0203, -0.0104, 0.0107, 0.98, 0.0301, -0.0211, 0.0113, 1.03;
  const double size = points.cwiseAbs().maxCoeff();
  return (points * map.transpose()).rowwise() +
         size * Eigen::RowVector3d(0.1 / 3, 0.2 / 7, -0.1 / 9);
}

Points plane_affine(const Points& points) {
  Points result = points;
  Eigen::Matrix2d map;
  map << 1.01, 0.0203, 0.0107, 0.98;
  const double size = points.cwiseAbs().maxCoeff();
  result.leftCols<2>() = (points.leftCols<2>() * map.transpose()).rowwise() +
                         size * Eigen::RowVector2d(0.1 / 3, 0.2 / 7);
  return result;
}

void require_same_contents(const Mesh& a, const Mesh& b) {
  REQUIRE(a.types == b.types);
  REQUIRE(a.offsets == b.offsets);
  REQUIRE(a.connectivity == b.connectivity);
  REQUIRE(a.polyhedron_offsets == b.polyhedron_offsets);
  REQUIRE(a.polyhedron_faces == b.polyhedron_faces);
  REQUIRE(a.regions == b.regions);
  REQUIRE(a.groups.size() == b.groups.size());
  for (std::size_t i = 0; i < a.groups.size(); ++i) {
    CHECK(a.groups[i].name == b.groups[i].name);
    CHECK(a.groups[i].kind == b.groups[i].kind);
    CHECK(a.groups[i].nodes == b.groups[i].nodes);
  }
  CHECK(a.ties == b.ties);
}

void require_promise(const fs::path& path, const FormatFolder& folder, const std::string& out,
                     double tolerance) {
  const MeshFile file(path);
  const Mesh& mesh = file.mesh();
  const fs::path copy = folder / out;
  INFO(path << " as " << file.format());
  const double size = mesh.points.cwiseAbs().maxCoeff();
  const auto is_there = [&](const Points& found, const Points& wanted) {
    return (found - wanted).cwiseAbs().maxCoeff() <= tolerance * size;
  };

  file.write(copy, mesh.points);
  REQUIRE(contents_of(copy) == contents_of(path));

  Points one = mesh.points;
  const Index node = mesh.node_count() / 2;
  one(node, 0) += 1e-3 * size / 3;
  file.write(copy, one);
  const MeshFile read_one(copy);
  REQUIRE(is_there(read_one.mesh().points, one));
  for (Index n = 0; n < mesh.node_count(); ++n) {
    if (n == node) continue;
    REQUIRE(read_one.mesh().points.row(n) == mesh.points.row(n));
  }

  const Points moved = is_plane(mesh.points) ? plane_affine(mesh.points) : affine(mesh.points);
  file.write(copy, moved);
  const MeshFile read_moved(copy);
  REQUIRE(read_moved.format() == file.format());
  REQUIRE(is_there(read_moved.mesh().points, moved));
  require_same_contents(read_moved.mesh(), mesh);
  const fs::path back = folder / ("back-" + out);
  read_moved.write(back, mesh.points);
  const MeshFile read_back(back);
  REQUIRE(is_there(read_back.mesh().points, mesh.points));
  require_same_contents(read_back.mesh(), mesh);

  if (fs::is_directory(copy) || bytes_of(copy).find('\0') != std::string::npos) return;
  const std::string marked = "\xef\xbb\xbf" + bytes_of(copy);
  folder.put(out, marked);
  const MeshFile read_marked(copy);
  REQUIRE(read_marked.mesh().points == read_moved.mesh().points);
  require_same_contents(read_marked.mesh(), mesh);
  read_marked.write(back, read_marked.mesh().points);
  REQUIRE(bytes_of(back) == marked);
}

void require_robust(const fs::path& path, const FormatFolder& folder) {
  const std::string name = "damaged" + path.extension().string();
  require_robust(bytes_of(path),
                 [&](std::string_view damaged) { return is_taken(folder.put(name, damaged)); });
}

void require_robust_folder(const fs::path& path, const std::string& file,
                           const FormatFolder& folder) {
  const fs::path damaged = folder / "damaged";
  fs::remove_all(damaged);
  fs::copy(path, damaged, fs::copy_options::recursive);
  require_robust(bytes_of(path / file), [&](std::string_view bytes) {
    folder.put("damaged/" + file, bytes);
    return is_taken(damaged);
  });
}

void require_refused(const fs::path& path, std::initializer_list<std::string> parts) {
  try {
    const MeshFile file(path);
  } catch (const Error& error) {
    for (const std::string& part : parts) CHECK_THAT(error.what(), Catch::Contains(part));
    return;
  }
  FAIL(path << " was taken");
}

}  // namespace cadmorph::test
