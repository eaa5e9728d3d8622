#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <gp_Pln.hxx>
#include <memory>

#include "apps/pipeline/pipeline.h"
#include "cad_variants.h"
#include "command_line.h"

namespace cadmorph {
namespace {

using namespace testing;

constexpr double kPitch = 3;
constexpr int kAlong = 20, kAcross = 13, kHigh = 4, kFinRow = 6;

/// A plate of 60 x 39 mm with a fin on it at y, which cuts its face only where it is imprinted.
TopoDS_Shape plate_with_fin(double y, bool is_imprinted) {
  TopoDS_Compound sheets;
  BRep_Builder builder;
  builder.MakeCompound(sheets);
  const auto add = [&](const gp_Pln& plane, double width) {
    builder.Add(sheets, BRepBuilderAPI_MakeFace(plane, 0, kAlong * kPitch, 0, width).Face());
  };
  const auto flat = [](double from) {
    return gp_Pln(gp_Ax3(gp_Pnt(0, from, 0), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0)));
  };
  const double width = kAcross * kPitch;
  add(flat(0), is_imprinted ? y : width);
  if (is_imprinted) add(flat(y), width - y);
  add(gp_Pln(gp_Ax3(gp_Pnt(0, y, 0), gp_Dir(0, -1, 0), gp_Dir(1, 0, 0))), kHigh * kPitch);
  return sheets;
}

/// Quads on the plate and on the fin, joined.
Mesh finned_mesh() {
  Mesh mesh;
  const int rows = kAcross + 1 + kHigh;
  mesh.points.resize((kAlong + 1) * rows, 3);
  const auto id = [](int i, int row) { return static_cast<Index>(row * (kAlong + 1) + i); };
  for (int row = 0; row < rows; ++row)
    for (int i = 0; i <= kAlong; ++i) {
      const int level = std::max(0, row - kAcross);
      mesh.points.row(id(i, row)) << i * kPitch, (level > 0 ? kFinRow : row) * kPitch,
          level * kPitch;
    }
  mesh.offsets.push_back(0);
  for (int row = 0; row + 1 < rows; ++row)
    for (int i = 0; i < kAlong; ++i) {
      const int from = row == kAcross ? kFinRow : row;
      for (const Index node : {id(i, from), id(i + 1, from), id(i + 1, row + 1), id(i, row + 1)})
        mesh.connectivity.push_back(node);
      mesh.types.push_back(CellType::Quad);
      mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
    }
  return mesh;
}

MorphResult move_fin(double by, bool is_imprinted) {
  const Workplace place;
  write_mesh(place.folder() / "shell.vtu", finned_mesh());
  const double y = kFinRow * kPitch;
  const MorphJob job(std::make_shared<const CadModel>(to_model(plate_with_fin(y, is_imprinted))),
                     std::make_shared<const MeshFile>(place.folder() / "shell.vtu"));
  return job.morph(to_model(plate_with_fin(y + by, is_imprinted)));
}

}  // namespace

TEST_CASE("A shell mesh that folds is refused, and what to do is said", "[apps][shell]") {
  const MorphResult result = move_fin(4, false);  // further than the next row of nodes
  REQUIRE(result.report.outcome == Outcome::Inverted);
  CHECK(result.report.diagnosis->bad_cells >= kAlong);
  CHECK(result.report.diagnosis->folded_shells == result.report.diagnosis->bad_cells);
  CHECK(result.report.after.invalid == result.report.diagnosis->bad_cells);
  CHECK(std::ranges::any_of(result.report.diagnosis->advice, [](const std::string& line) {
    return line.find("split the face") != std::string::npos;
  }));
}

TEST_CASE("A shell mesh follows a fin whose joint is imprinted", "[apps][shell]") {
  const MorphResult result = move_fin(4, true);
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.quality.min > 0.5);
}

}  // namespace cadmorph
