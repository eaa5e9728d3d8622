#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <array>
#include <catch2/catch.hpp>
#include <map>
#include <memory>

#include "apps/pipeline/morph_job.h"
#include "cad_variants.h"

namespace cadmorph {
namespace {

using namespace testing;

constexpr int kWidth = 8, kRibWide = 2, kRibFrom = 2, kRibTo = 6, kRibTop = 5;

// A plate one thick with a rib on it that ends before the plate's sides.
struct Plate {
  int length, rib_at;
};

CadModel cad_of(const Plate& plate, double by) {
  const auto box = [](double x, double y, double z, double dx, double dy, double dz) {
    return BRepPrimAPI_MakeBox(gp_Pnt(x, y, z), dx, dy, dz).Shape();
  };
  return to_model(BRepAlgoAPI_Fuse(
                      box(0, 0, 0, plate.length, kWidth, 1),
                      box(plate.rib_at + by, kRibFrom, 1, kRibWide, kRibTo - kRibFrom, kRibTop - 1))
                      .Shape());
}

// Cubes.
Mesh mesh_of(const Plate& plate) {
  Mesh mesh;
  std::map<std::array<int, 3>, Index> numbers;
  std::vector<Eigen::RowVector3d> points;
  const auto node = [&](int x, int y, int z) {
    const auto [found, is_new] = numbers.try_emplace({x, y, z}, std::ssize(points));
    if (is_new) points.emplace_back(x, y, z);
    return found->second;
  };
  for (int x = 0; x < plate.length; ++x)
    for (int y = 0; y < kWidth; ++y)
      for (int z = 0; z < kRibTop; ++z) {
        const bool is_rib =
            x >= plate.rib_at && x < plate.rib_at + kRibWide && y >= kRibFrom && y < kRibTo;
        if (z > 0 && !is_rib) continue;
        add_cell(mesh, CellType::Hexahedron,
                 std::array{node(x, y, z), node(x + 1, y, z), node(x + 1, y + 1, z),
                            node(x, y + 1, z), node(x, y, z + 1), node(x + 1, y, z + 1),
                            node(x + 1, y + 1, z + 1), node(x, y + 1, z + 1)});
      }
  mesh.points.resize(std::ssize(points), 3);
  for (Index n = 0; n < mesh.points.rows(); ++n) mesh.points.row(n) = points[n];
  return mesh;
}

MorphResult moved(const Plate& plate, double by, QualityMode quality) {
  PipelineOptions options;
  options.quality = quality;
  return MorphJob(std::make_shared<const CadModel>(cad_of(plate, 0)),
                  std::make_shared<const MeshFile>(mesh_of(plate), "plate"), options)
      .morph(cad_of(plate, by));
}

}  // namespace

TEST_CASE("Where a rib moves far, the plate's edges and both its sides follow", "[apps][rib]") {
  // By 12 of the plate's cells, beside sides of two cells.
  const MorphResult result = moved({60, 28}, 12, QualityMode::Best);
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.report.followed_nodes > 0);
  CHECK(result.quality.min > 0.7);
}

}  // namespace cadmorph
