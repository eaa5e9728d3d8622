#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <gp_Pln.hxx>
#include <memory>

#include "apps/pipeline/morph_job.h"
#include "cad_variants.h"
#include "command_line.h"

namespace cadmorph {
namespace {

using namespace testing;

constexpr double kPitch = 3;
constexpr int kAlong = 20, kAcross = 13, kHigh = 4, kFinRow = 6;

/// How the fin meets the plate in the CAD.
enum class Joint {
  Imprinted,  ///< the plate is split there
  Touching,   ///< an edge of the fin lies within the plate
  Crossing    ///< the fin passes through the plate, no edge lies there
};

/// A plate of 60 x 39 mm and a fin on it at y.
TopoDS_Shape plate_with_fin(double y, Joint joint) {
  TopoDS_Compound sheets;
  BRep_Builder builder;
  builder.MakeCompound(sheets);
  const auto add = [&](const gp_Pln& plane, double low, double high) {
    builder.Add(sheets, BRepBuilderAPI_MakeFace(plane, 0, kAlong * kPitch, low, high).Face());
  };
  const gp_Pln flat(gp_Ax3(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(1, 0, 0)));
  const double width = kAcross * kPitch, height = kHigh * kPitch;
  add(flat, 0, joint == Joint::Imprinted ? y : width);
  if (joint == Joint::Imprinted) add(flat, y, width);
  add(gp_Pln(gp_Ax3(gp_Pnt(0, y, 0), gp_Dir(0, -1, 0), gp_Dir(1, 0, 0))),
      joint == Joint::Crossing ? -height : 0, height);
  return sheets;
}

/// Quads on the plate and on the fin, joined.
Mesh finned_mesh(Joint joint) {
  std::vector<Eigen::Vector2d> rows;        // y, z
  std::vector<std::pair<int, int>> strips;  // of cells, from row to row
  const auto extend = [&](int from, int count, const Eigen::Vector2d& step) {
    for (int k = 0; k < count; ++k) {
      const int last = k == 0 ? from : static_cast<int>(rows.size()) - 1;
      strips.emplace_back(last, static_cast<int>(rows.size()));
      rows.push_back(rows[static_cast<std::size_t>(last)] + kPitch * step);
    }
  };
  rows.emplace_back(0, 0);
  extend(0, kAcross, {1, 0});
  extend(kFinRow, kHigh, {0, 1});
  if (joint == Joint::Crossing) extend(kFinRow, kHigh, {0, -1});

  Mesh mesh;
  mesh.points.resize((kAlong + 1) * std::ssize(rows), 3);
  const auto id = [](int i, int row) { return static_cast<Index>(row * (kAlong + 1) + i); };
  for (int row = 0; row < std::ssize(rows); ++row)
    for (int i = 0; i <= kAlong; ++i)
      mesh.points.row(id(i, row)) << i * kPitch, rows[static_cast<std::size_t>(row)].transpose();
  mesh.offsets.push_back(0);
  for (const auto& [from, to] : strips)
    for (int i = 0; i < kAlong; ++i) {
      for (const Index node : {id(i, from), id(i + 1, from), id(i + 1, to), id(i, to)})
        mesh.connectivity.push_back(node);
      mesh.types.push_back(CellType::Quad);
      mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
    }
  return mesh;
}

MorphResult move_fin(double by, Joint joint) {
  const Workplace place;
  write_mesh(place.folder() / "shell.vtu", finned_mesh(joint));
  const double y = kFinRow * kPitch;
  const MorphJob job(std::make_shared<const CadModel>(to_model(plate_with_fin(y, joint))),
                     std::make_shared<const MeshFile>(place.folder() / "shell.vtu"));
  return job.morph(to_model(plate_with_fin(y + by, joint)));
}

}  // namespace

TEST_CASE("A shell mesh that folds is refused, and what to do is said", "[apps][shell]") {
  const MorphResult result = move_fin(25, Joint::Touching);  // beyond the plate's rim
  REQUIRE(result.report.outcome == Outcome::Inverted);
  CHECK(result.report.diagnosis->bad_cells >= kAlong);
  CHECK(result.report.diagnosis->folded_shells == result.report.diagnosis->bad_cells);
  CHECK(result.report.after.invalid == result.report.diagnosis->bad_cells);
  CHECK(std::ranges::any_of(result.report.diagnosis->advice, [](const std::string& line) {
    return line.find("still meet") != std::string::npos;
  }));
}

TEST_CASE("A shell mesh follows a fin whether an edge lies at its joint or not", "[apps][shell]") {
  const Joint joint = GENERATE(Joint::Imprinted, Joint::Touching, Joint::Crossing);
  const double by = 4;  // further than the next row of nodes
  const MorphResult result = move_fin(by, joint);
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.report.warnings.empty());
  CHECK(result.quality.min > 0.5);
  for (int i = 0; i <= kAlong; ++i) {
    const Eigen::Vector3d expected(i * kPitch, kFinRow * kPitch + by, 0);
    CHECK((result.positions.row(kFinRow * (kAlong + 1) + i).transpose() - expected).norm() < 1e-9);
  }
}

}  // namespace cadmorph
