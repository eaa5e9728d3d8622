#include "volume/deformation_field.h"

#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <random>

#include "../core/sample_meshes.h"
#include "core/archive_types.h"
#include "core/boundary.h"
#include "core/checked_file.h"
#include "core/errors.h"
#include "volume/field_file.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;
namespace fs = std::filesystem;

Vector3d bent(const Vector3d& x) {
  return {x(0) + 0.1 * x(2) * x(2), x(1) + 0.05 * std::sin(3 * x(0)), x(2) * (1 + 0.2 * x(1))};
}

Vector3d affine(const Vector3d& x) {
  return {1 + 2 * x(0) - x(1), 0.5 * x(1) + x(2), 3 - x(2) + 0.2 * x(0)};
}

// The morph of a cube of tetrahedra by its surface.
struct CubeMorph {
  explicit CubeMorph(const std::function<Vector3d(const Vector3d&)>& map, int n = 5)
      : mesh(cube(CellType::Tetra, n)), volume(mesh, extract_boundary(mesh).nodes) {
    target = mapped(rows_of(mesh.points, volume.surface_nodes()), map);
  }

  Points in_steps(int steps) const {
    return morph_in_steps(mesh, volume, target, detect_orientation(mesh), {.steps = steps})
        .positions;
  }

  DeformationField field(int steps = 1) const {
    return DeformationField(record_deformation(mesh, volume, target, steps));
  }

  Mesh mesh;
  VolumeMorph volume;
  Points target;
};

// A file name of its own, removed in the end.
struct ScratchFile {
  ScratchFile()
      : path(fs::temp_directory_path() / ("field-" + std::to_string(getpid()) + ".cmf")) {}
  ~ScratchFile() { fs::remove(path); }
  std::string contents() const {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void fill(const std::string& text) const { std::ofstream(path, std::ios::binary) << text; }
  std::string refusal() const {
    try {
      read_field(path);
    } catch (const IoError& error) {
      return error.what();
    }
    return "";
  }
  fs::path path;
};

}  // namespace

TEST_CASE("A field moves the nodes of its mesh as the morph does", "[volume][field]") {
  const CubeMorph morph(bent);
  for (const int steps : {1, 3}) {
    const Points expected = morph.in_steps(steps);
    const MovedPoints moved = morph.field(steps).apply(morph.mesh.points);
    CHECK(moved.at_nodes == morph.target.rows());
    CHECK(moved.outside == 0);
    for (const Index node : morph.volume.surface_nodes())
      REQUIRE(moved.positions.row(node) == expected.row(node));
    // Rounding of sums with large weights of both signs.
    CHECK((moved.positions - expected).cwiseAbs().maxCoeff() < 1e-10);
  }
}

TEST_CASE("An affine field moves any point by the affine map", "[volume][field]") {
  const DeformationField field = CubeMorph(affine).field();
  std::srand(2);
  const Points anywhere = 3 * Points::Random(500, 3);
  const MovedPoints moved = field.apply(anywhere);
  const auto is_outside = [](const auto& x) { return x.minCoeff() < 0 || x.maxCoeff() > 1; };
  Index outside = 0;
  for (Index i = 0; i < anywhere.rows(); ++i) outside += is_outside(anywhere.row(i));
  CHECK(moved.outside == outside);
  CHECK((moved.positions - mapped(anywhere, affine)).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE("Pieces of a finer mesh agree on their common nodes bit for bit", "[volume][field]") {
  const CubeMorph morph(bent);
  const Mesh fine = cube(CellType::Tetra, 13);
  for (const int steps : {1, 2}) {
    const DeformationField field = morph.field(steps);
    const Points whole = field.apply(fine.points).positions;
    std::mt19937 random(3);
    constexpr int kPieces = 7;
    std::vector<std::vector<Index>> pieces(kPieces);  // nodes, each in the order its cells name it
    std::vector<int> uses(static_cast<std::size_t>(fine.node_count()), 0);
    for (Index c = 0; c < fine.cell_count(); ++c) {
      auto& piece = pieces[random() % kPieces];
      for (const Index node : fine.cell(c)) piece.push_back(node);
    }
    for (auto& piece : pieces) {
      std::shuffle(piece.begin(), piece.end(), random);
      const Points moved = field.apply(rows_of(fine.points, piece)).positions;
      REQUIRE(moved == rows_of(whole, piece));
      std::sort(piece.begin(), piece.end());
      piece.erase(std::unique(piece.begin(), piece.end()), piece.end());
      for (const Index node : piece) ++uses[node];
    }
    CHECK(std::count_if(uses.begin(), uses.end(), [](int n) { return n > 1; }) > 1000);
  }
}

TEST_CASE("A shell, all of whose nodes are prescribed, has a field", "[volume][field]") {
  Mesh shell;
  shell.points.resize(4, 3);
  shell.points << 0, 0, 0, 1, 0, 0, 1, 1, 0.2, 0, 1, 0.5;
  shell.types = {CellType::Quad};
  shell.offsets = {0, 4};
  shell.connectivity = {0, 1, 2, 3};
  const VolumeMorph volume(shell, {0, 1, 2, 3});
  const DeformationField field(record_deformation(shell, volume, mapped(shell.points, affine), 1));
  const Points centre = shell.points.colwise().mean();
  const Points expected = mapped(centre, affine);
  CHECK((field.apply(centre).positions - expected).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE("The surface of a part with a cavity gives the field of the part", "[volume][field]") {
  Mesh solid = cube(CellType::Hexahedron, 5);
  Mesh hollow = solid;
  hollow.types.clear();
  hollow.connectivity.clear();
  hollow.offsets = {0};
  for (Index c = 0; c < solid.cell_count(); ++c) {
    Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
    for (const Index node : solid.cell(c)) centre += solid.points.row(node) / 8;
    if ((centre.array() - 0.5).abs().maxCoeff() < 0.1) continue;
    hollow.types.push_back(CellType::Hexahedron);
    for (const Index node : solid.cell(c)) hollow.connectivity.push_back(node);
    hollow.offsets.push_back(static_cast<Index>(hollow.connectivity.size()));
  }
  const Boundary boundary = extract_boundary(hollow);
  Mesh shell;
  shell.points = rows_of(hollow.points, boundary.nodes);
  shell.types = boundary.types;
  shell.offsets = boundary.offsets;
  for (const Index node : boundary.connectivity)
    shell.connectivity.push_back(std::ranges::lower_bound(boundary.nodes, node) -
                                 boundary.nodes.begin());
  std::vector<Index> all(boundary.nodes.size());
  std::iota(all.begin(), all.end(), Index{0});
  const VolumeMorph surface(shell, all), part(hollow, boundary.nodes);
  CHECK(surface.field_count() == 1);
  const Points target = mapped(shell.points, bent);
  const DeformationField field(record_deformation(shell, surface, target, 1));
  CHECK((field.apply(hollow.points).positions - part.morph(target)).cwiseAbs().maxCoeff() < 1e-10);
}

TEST_CASE("What is no function of the position has no field", "[volume][field]") {
  Mesh halves = cube(CellType::Tetra, 4);
  set_regions_by_x(halves, 0.5);
  const VolumeMorph two(halves, extract_boundary(halves).nodes);
  const Points same = rows_of(halves.points, two.surface_nodes());
  CHECK_THROWS_AS(record_deformation(halves, two, same, 1), InvalidInputError);

  CubeMorph morph(bent);
  morph.mesh.points.row(morph.volume.surface_nodes()[1]) =
      morph.mesh.points.row(morph.volume.surface_nodes()[0]);
  CHECK_THROWS_AS(record_deformation(morph.mesh, morph.volume, morph.target, 1), InvalidInputError);

  const CubeMorph sound(bent, 2);
  const VolumeMorph other(sound.mesh, sound.volume.surface_nodes(),
                          {.method = MorphMethod::Femwarp});
  CHECK_THROWS_AS(record_deformation(sound.mesh, other, sound.target, 1), InvalidInputError);
}

TEST_CASE("A field comes back from its file bit for bit", "[volume][field]") {
  const ScratchFile file;
  const CubeMorph morph(bent, 10);
  DeformationTerms terms = record_deformation(morph.mesh, morph.volume, morph.target, 2);
  terms.base_cad = "base.step";
  terms.mesh_unit_mm = 25.4;
  // A tree and a correction, which small sets lack: any numbers will do here.
  FieldTerms& step = terms.steps.back();
  step.tree.nodes.push_back({{0.1, 0.2, 0.3}, 2, -1, 0, 0, step.centres.rows(), 0, 1});
  step.tree.separation = 0.6;
  step.tree.skeleton_points = Eigen::MatrixXd::Random(1, 3);
  step.tree.skeleton_weights = Eigen::MatrixXd::Random(1, 3);
  step.correction.push_back({0.1, RowMatrix::Random(4, 3), RowMatrix::Random(4, 3)});
  write_field(file.path, terms);
  const DeformationTerms back = read_field(file.path);
  CHECK(back.base_cad == "base.step");
  CHECK(back.mesh_unit_mm == 25.4);
  REQUIRE(back.steps.size() == 2);
  CHECK(back.steps.back().tree.skeleton_weights == step.tree.skeleton_weights);
  const Points points = cube(CellType::Hexahedron, 7).points;
  CHECK(DeformationField(back).apply(points).positions ==
        DeformationField(terms).apply(points).positions);
}

TEST_CASE("A damaged field file is refused", "[volume][field]") {
  const ScratchFile file;
  const CubeMorph morph(bent, 2);
  write_field(file.path, record_deformation(morph.mesh, morph.volume, morph.target, 1));
  const std::string sound = file.contents();
  REQUIRE(file.refusal().empty());
  for (std::size_t i = 0; i < sound.size(); i += 1 + i / 40) {
    std::string damaged = sound;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    file.fill(damaged);
    INFO("byte " << i);
    CHECK(!file.refusal().empty());
    file.fill(sound.substr(0, i));
    CHECK(!file.refusal().empty());
  }
  file.fill(sound + "x");
  CHECK(file.refusal().find("in place of the") != std::string::npos);
  std::string newer = sound;
  newer[sound.find('\n') + 2] = 2;  // after the byte that tells the byte order
  file.fill(newer);
  CHECK(file.refusal().find("a newer cadmorph wrote it") != std::string::npos);
  file.fill("ISO-10303-21;\n");
  CHECK(file.refusal().find("it is no field file") != std::string::npos);
  CHECK_THROWS_AS(read_field(fs::temp_directory_path()), IoError);
  CHECK_THROWS_AS(read_field("no_such.cmf"), IoError);
}

TEST_CASE("A field file that claims more than it holds is refused", "[volume][field]") {
  const ScratchFile file;
  const FileKind kind{.mark = "cadmorph deformation field\n",
                      .format = kFieldFormat,
                      .name = "field file",
                      .remedy = ""};
  const auto refusal_of = [&](const auto&... contents) {
    write_checked_file(file.path, kind, [&](OutputArchive& archive) { archive(contents...); });
    return file.refusal();
  };
  using Catch::Matchers::Contains;
  const std::string name = "x";
  const Eigen::RowVector3d corner(1, 2, 3);
  const auto refusal_of_nodes = [&](std::int64_t rows, std::int64_t columns) {
    return refusal_of(name, name, name, 1.0, corner, corner, rows, columns);
  };
  CHECK_THAT(refusal_of(std::uint64_t{1} << 60), Contains("more than the file holds"));
  CHECK_THAT(refusal_of_nodes(std::int64_t{1} << 40, 3), Contains("more than the file holds"));
  CHECK_THAT(refusal_of_nodes(std::int64_t{1} << 62, 3), Contains("more than the file holds"));
  CHECK_THAT(refusal_of_nodes(-1, 3), Contains("another shape"));
  CHECK_THAT(refusal_of_nodes(2, 4), Contains("another shape"));
  const Points none(0, 3);
  CHECK_THAT(refusal_of(name, name, name, 1.0, corner, corner, none, none, std::uint64_t{1} << 60),
             Contains("more than the file holds"));
}

}  // namespace cadmorph
