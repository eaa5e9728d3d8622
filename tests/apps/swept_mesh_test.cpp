#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax2.hxx>
#include <numbers>
#include <optional>

#include "apps/pipeline/morph_job.h"
#include "cad_variants.h"
#include "volume/best_mesh.h"

namespace cadmorph {
namespace {

using namespace testing;
using std::numbers::pi;

// A disc with a hole, meshed by a section that is swept through it in slabs of unlike heights.
struct Disc {
  static constexpr double kRim = 10, kHole = 2;
  static constexpr int kAround = 40, kAcross = 12;
  static constexpr std::array<double, 5> kLevels = {0, 0.2, 0.8, 1.7, 2};
  double at;       // the hole's middle
  double stretch;  // of its height

  CadModel cad() const {
    const auto cylinder = [this](double x, double r) {
      return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, 0, 0), gp_Dir(0, 0, 1)), r,
                                      stretch * kLevels.back())
          .Shape();
    };
    return to_model(BRepAlgoAPI_Cut(cylinder(0, kRim), cylinder(at, kHole)).Shape());
  }

  static Index node(int level, int k, int i) {
    return (Index(level) * (kAcross + 1) + k) * kAround + i % kAround;
  }

  // Of a hole in the middle.
  static Mesh mesh(double stretch) {
    const int slabs = int(kLevels.size()) - 1;
    Mesh mesh;
    mesh.points.resize(node(slabs, kAcross, kAround - 1) + 1, 3);
    for (int level = 0; level <= slabs; ++level)
      for (int k = 0; k <= kAcross; ++k)
        for (int i = 0; i < kAround; ++i) {
          const double angle = 2 * pi * i / kAround, r = kHole + (kRim - kHole) * k / kAcross;
          mesh.points.row(node(level, k, i)) << r * std::cos(angle), r * std::sin(angle),
              stretch * kLevels[level];
        }
    for (int level = 0; level < slabs; ++level)
      for (int k = 0; k < kAcross; ++k)
        for (int i = 0; i < kAround; ++i)
          add_cell(
              mesh, CellType::Hexahedron,
              std::array{node(level, k, i), node(level, k + 1, i), node(level, k + 1, i + 1),
                         node(level, k, i + 1), node(level + 1, k, i), node(level + 1, k + 1, i),
                         node(level + 1, k + 1, i + 1), node(level + 1, k, i + 1)});
    return mesh;
  }

  static MorphResult moved(double by, double stretch, QualityMode quality,
                           std::optional<double> improve_below = {}) {
    PipelineOptions options;
    options.quality = quality;
    options.improve_below = improve_below;
    return MorphJob(std::make_shared<const CadModel>(Disc{0, stretch}.cad()),
                    std::make_shared<const MeshFile>(mesh(stretch), "disc"), options)
        .morph(Disc{by, stretch}.cad());
  }
};

}  // namespace

TEST_CASE("Raising slides both ends of a swept mesh alike, and keeps its rows and levels",
          "[apps][families]") {
  const double stretch = GENERATE(1.0, 20.0);  // a plate, a column
  CAPTURE(stretch);
  const MorphResult fast = Disc::moved(6, stretch, QualityMode::Fast),
                    best = Disc::moved(6, stretch, QualityMode::Best);
  REQUIRE(best.report.outcome == Outcome::Done);
  const WorstCells before = worst_cells(fast.quality), after = worst_cells(best.quality);
  CHECK(after.min > 1.2 * before.min);
  CHECK(after.worst_twentieth > 1.2 * before.worst_twentieth);
  const int top = int(Disc::kLevels.size()) - 1;
  double slid = 0, apart = 0, off_level = 0, off_row = 0;
  for (int k = 0; k <= Disc::kAcross; ++k)
    for (int i = 0; i < Disc::kAround; ++i) {
      const auto low = best.positions.row(Disc::node(0, k, i)),
                 high = best.positions.row(Disc::node(top, k, i));
      apart = std::max(apart, (low - high).head<2>().norm());
      slid = std::max(slid, (low - fast.positions.row(Disc::node(0, k, i))).norm());
      for (int level = 0; level <= top; ++level) {
        const auto here = best.positions.row(Disc::node(level, k, i));
        off_level = std::max(off_level, std::abs(here.z() - stretch * Disc::kLevels[level]));
        off_row = std::max(off_row, (here - low).head<2>().norm());
      }
    }
  CHECK(slid > 0.1);
  CHECK(apart < 1e-9);
  CHECK(off_level < 1e-9);
  CHECK(off_row < 1e-4 * stretch * Disc::kLevels.back());  // less bent ones are left
}

TEST_CASE("Improving puts single elements back that became worse than the worst",
          "[apps][families]") {
  const MorphResult improved = Disc::moved(6.5, 1, QualityMode::Fast, 0.4);
  REQUIRE(improved.report.outcome == Outcome::Done);
  REQUIRE(improved.report.improving);
  const ImproveReport& report = *improved.report.improving;
  CHECK(report.poor_before > 50);
  CHECK(report.poor_after < report.poor_before / 5);
  CHECK(report.min_after > report.min_before);
}

}  // namespace cadmorph
