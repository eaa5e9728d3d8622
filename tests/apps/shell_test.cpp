#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRep_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Pln.hxx>
#include <map>
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

// Rectangles of cells, nodes at one place joined.
class Patchwork {
 public:
  /// From `corner` over `along` and `across`, in so many cells.
  void add_quads(const Eigen::Vector3d& corner, const Eigen::Vector3d& along, int m,
                 const Eigen::Vector3d& across, int n) {
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j) {
        const auto at = [&](int a, int b) {
          return node(corner + along * (i + a) / m + across * (j + b) / n);
        };
        add(CellType::Quad, {at(0, 0), at(1, 0), at(1, 1), at(0, 1)});
      }
  }
  /// A box of cells.
  void add_bricks(const Eigen::Vector3d& corner, const Eigen::Vector3d& size,
                  const std::array<int, 3>& n) {
    for (int i = 0; i < n[0]; ++i)
      for (int j = 0; j < n[1]; ++j)
        for (int k = 0; k < n[2]; ++k) {
          const auto at = [&](int a, int b, int c) {
            return node(corner + Eigen::Vector3d(size[0] * (i + a) / n[0], size[1] * (j + b) / n[1],
                                                 size[2] * (k + c) / n[2]));
          };
          add(CellType::Hexahedron, {at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0),
                                     at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)});
        }
  }
  Mesh mesh() {
    mesh_.points.resize(std::ssize(points_), 3);
    for (Index n = 0; n < mesh_.points.rows(); ++n) mesh_.points.row(n) = points_[n];
    return mesh_;
  }

 private:
  Index node(const Eigen::Vector3d& x) {
    const auto key =
        std::array{std::lround(1e6 * x[0]), std::lround(1e6 * x[1]), std::lround(1e6 * x[2])};
    const auto [found, is_new] = ids_.try_emplace(key, std::ssize(points_));
    if (is_new) points_.push_back(x);
    return found->second;
  }
  void add(CellType type, const std::vector<Index>& nodes) {
    if (mesh_.offsets.empty()) mesh_.offsets.push_back(0);
    mesh_.types.push_back(type);
    mesh_.connectivity.insert(mesh_.connectivity.end(), nodes.begin(), nodes.end());
    mesh_.offsets.push_back(std::ssize(mesh_.connectivity));
  }

  Mesh mesh_;
  std::vector<Eigen::Vector3d> points_;
  std::map<std::array<long, 3>, Index> ids_;
};

TopoDS_Shape together(const std::vector<TopoDS_Shape>& parts) {
  TopoDS_Compound compound;
  BRep_Builder builder;
  builder.MakeCompound(compound);
  for (const TopoDS_Shape& part : parts) builder.Add(compound, part);
  return compound;
}

/// A sheet from y = `from` to `to`, upright at x, with its foot at z = 0.
TopoDS_Shape upright(double x, double from, double to, double high) {
  const gp_Ax3 at(gp_Pnt(x, 0, 0), gp_Dir(1, 0, 0), gp_Dir(0, 1, 0));
  return BRepBuilderAPI_MakeFace(gp_Pln(at), from, to, 0, high).Face();
}

TopoDS_Shape block(double width, double depth) {
  return BRepPrimAPI_MakeBox(gp_Pnt(0, 0, -depth), gp_Pnt(width, 42, 0)).Solid();
}

MorphResult move_mesh(const Mesh& mesh, const TopoDS_Shape& base, const TopoDS_Shape& variant) {
  const Workplace place;
  write_mesh(place.folder() / "mesh.vtu", mesh);
  const MorphJob job(std::make_shared<const CadModel>(to_model(base)),
                     std::make_shared<const MeshFile>(place.folder() / "mesh.vtu"));
  return job.morph(to_model(variant));
}

}  // namespace

TEST_CASE("Sheets beside solids and on them go to their CAD", "[apps][shell]") {
  Patchwork work;
  work.add_bricks({0, 0, -12}, {60, 42, 12}, {20, 14, 4});
  const Index of_block = work.mesh().node_count();
  const double foot = GENERATE(0.0, 5.0);  // on the block, or above it
  work.add_quads({18, 6, foot}, {0, 30, 0}, 10, {0, 0, 12 - foot}, 4);
  const Mesh mesh = work.mesh();
  const auto model = [&](double width, double depth, double x, double high) {
    const gp_Ax3 at(gp_Pnt(x, 0, foot), gp_Dir(1, 0, 0), gp_Dir(0, 1, 0));
    return together(
        {block(width, depth), BRepBuilderAPI_MakeFace(gp_Pln(at), 6, 36, 0, high - foot).Face()});
  };
  const MorphResult result = move_mesh(mesh, model(60, 12, 18, 12), model(66, 15, 25, 16));
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.report.run.warnings.empty());
  CHECK(result.report.mesh.loose_nodes == 0);
  Index on_sheet = 0;
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const Eigen::Vector3d before = mesh.points.row(n), after = result.positions.row(n);
    if (before.z() > 0 || n >= of_block) {
      ++on_sheet;
      CHECK(after.x() == Approx(25));
      CHECK(after.y() == Approx(before.y()));
      CHECK(after.z() == Approx(foot + (before.z() - foot) * (16 - foot) / (12 - foot)));
    } else if (before.z() == 0) {
      CHECK(std::abs(after.z()) < 1e-9);
    } else if (before.z() == -12) {
      CHECK(after.z() == Approx(-15));
    }
  }
  CHECK(on_sheet == (foot == 0 ? 44 : 55));
}

TEST_CASE("A sheet inside of a solid goes to its CAD, one that no CAD tells of follows",
          "[apps][shell]") {
  Patchwork work;
  work.add_bricks({0, 0, -12}, {60, 42, 12}, {20, 14, 4});
  work.add_quads({0, 0, -6}, {60, 0, 0}, 20, {0, 42, 0}, 14);
  const Mesh mesh = work.mesh();
  const bool is_in_cad = GENERATE(true, false);
  const auto model = [&](double depth, double z) {
    std::vector<TopoDS_Shape> parts = {block(60, depth)};
    if (is_in_cad)
      parts.push_back(
          BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, z), gp_Dir(0, 0, 1)), 0, 60, 0, 42).Face());
    return together(parts);
  };
  const MorphResult result = move_mesh(mesh, model(12, -6), model(12.5, -4));
  CHECK(result.report.outcome == Outcome::Done);
  CHECK(result.report.mesh.loose_nodes == 0);
  int on_sheet = 0;
  for (Index n = 0; n < mesh.node_count(); ++n) {
    if (mesh.points(n, 2) != -6) continue;
    ++on_sheet;
    CHECK(result.positions(n, 2) == Approx(is_in_cad ? -4 : -6.25).epsilon(1e-3));
  }
  CHECK(on_sheet == 21 * 15);
}

TEST_CASE("Nodes where ribs cross without an edge stay on both when cells are raised",
          "[apps][shell]") {
  Patchwork work;
  work.add_quads({0, 0, 0}, {60, 0, 0}, 20, {0, 42, 0}, 14);
  work.add_quads({0, 18, 0}, {60, 0, 0}, 20, {0, 0, 9}, 3);
  work.add_quads({18, 6, 0}, {0, 30, 0}, 10, {0, 0, 12}, 4);
  const Mesh mesh = work.mesh();
  const auto model = [&](double x) {
    const gp_Ax3 along(gp_Pnt(0, 18, 0), gp_Dir(0, -1, 0), gp_Dir(1, 0, 0));
    return together(
        {BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 0, 60, 0, 42).Face(),
         BRepBuilderAPI_MakeFace(gp_Pln(along), 0, 60, 0, 9).Face(), upright(x, 6, 36, 12)});
  };
  const MorphResult result = move_mesh(mesh, model(18), model(29));
  CHECK(result.report.outcome == Outcome::Done);
  REQUIRE(result.report.best_mesh);
  CHECK(result.report.best_mesh->slid_nodes > 0);
  Index joint = 0, on_plate = 0, along = 0, across = 0;
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const Eigen::Vector3d before = mesh.points.row(n), after = result.positions.row(n);
    const bool is_on_plate = before.z() == 0, is_along = before.y() == 18;
    const bool is_across = before.x() == 18 && before.y() >= 6 && before.y() <= 36;
    joint += is_on_plate + is_along + is_across > 1;
    if (is_on_plate) CHECK(std::abs(after.z()) < 1e-9);
    if (is_along && before.z() <= 9) CHECK(after.y() == Approx(18));
    on_plate += is_on_plate;
    along += is_along && before.z() <= 9;
    across += is_across;
    if (is_across) CHECK(after.x() == Approx(29));
  }
  CHECK(joint > 30);
  CHECK(on_plate == 21 * 15);
  CHECK(along == 21 * 4);
  CHECK(across == 11 * 5);
}

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
  CHECK(result.report.run.warnings.empty());
  CHECK(result.quality.min > 0.5);
  for (int i = 0; i <= kAlong; ++i) {
    const Eigen::Vector3d expected(i * kPitch, kFinRow * kPitch + by, 0);
    CHECK((result.positions.row(kFinRow * (kAlong + 1) + i).transpose() - expected).norm() < 1e-9);
  }
}

}  // namespace cadmorph
