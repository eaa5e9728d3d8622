#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax1.hxx>
#include <gp_Ax2.hxx>
#include <numbers>
#include <vector>

#include "apps/pipeline/morph_job.h"
#include "cad_variants.h"
#include "core/layer_heights.h"
#include "volume/best_mesh.h"

namespace cadmorph {
namespace {

using namespace testing;
using std::numbers::pi;

// Air between a body, a cylinder that ends on two walls or a circle in the plane, and a rim round
// it; layers from the body on.
struct AirRound {
  static constexpr double kRim = 10, kHeight = 4;
  static constexpr int kAround = 48, kLayers = 20, kSlabs = 3;
  double radius, at = 0;
  bool is_flat = false;
  double growth = 1.25;

  CadModel cad() const {
    const auto cylinder = [](double x, double r) {
      return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, 0, 0), gp_Dir(0, 0, 1)), r, kHeight).Shape();
    };
    const TopoDS_Shape air = BRepAlgoAPI_Cut(cylinder(0, kRim), cylinder(at, radius)).Shape();
    if (!is_flat) return to_model(air);
    for (TopExp_Explorer face(air, TopAbs_FACE); face.More(); face.Next()) {
      const CadModel one = to_model(face.Current());
      if (one.faces()[FaceId(0)].type == SurfaceType::Plane &&
          std::abs(one.evaluate(FaceId(0), {0, 0}).point.z()) < 1e-9)
        return one;
    }
    throw std::runtime_error("no face of the air lies in the plane");
  }

  // Of node k of a column over the body.
  double height(int k) const {
    return (kRim - radius) * (std::pow(growth, k) - 1) / (std::pow(growth, kLayers) - 1);
  }

  Index node(int slab, int k, int i) const {
    return (Index(slab) * (kLayers + 1) + k) * kAround + i % kAround;
  }

  Mesh mesh() const {
    const int slabs = is_flat ? 0 : kSlabs;
    Mesh mesh;
    mesh.points.resize(node(slabs, kLayers, kAround - 1) + 1, 3);
    for (int slab = 0; slab <= slabs; ++slab)
      for (int k = 0; k <= kLayers; ++k)
        for (int i = 0; i < kAround; ++i) {
          const double angle = 2 * pi * i / kAround, r = radius + height(k);
          mesh.points.row(node(slab, k, i)) << r * std::cos(angle), r * std::sin(angle),
              is_flat ? 0 : kHeight * slab / kSlabs;
        }
    for (int k = 0; k < kLayers; ++k)
      for (int i = 0; i < kAround; ++i) {
        const auto quad = [&](int slab) {
          return std::array{node(slab, k, i), node(slab, k + 1, i), node(slab, k + 1, i + 1),
                            node(slab, k, i + 1)};
        };
        if (is_flat) add_cell(mesh, CellType::Quad, quad(0));
        for (int slab = 0; slab < slabs; ++slab) {
          const auto a = quad(slab), b = quad(slab + 1);
          add_cell(mesh, CellType::Hexahedron,
                   std::array{a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]});
        }
      }
    return mesh;
  }

  MorphResult morphed_to(const AirRound& variant, PipelineOptions options) const {
    return MorphJob(std::make_shared<const CadModel>(cad()),
                    std::make_shared<const MeshFile>(mesh(), "air"), std::move(options))
        .morph(variant.cad());
  }

  // The largest part by which nodes over the body are farther from it or nearer than in the base,
  // among those that are clearly of the layers.
  double largest_change(const MorphResult& result, const AirRound& variant) const {
    double largest = 0;
    for (int slab = 0; slab <= (is_flat ? 0 : kSlabs); ++slab)
      for (int k = 1; k <= kLayers && height(k) < 0.5; ++k)
        for (int i = 0; i < kAround; ++i) {
          const Eigen::RowVector3d x = result.positions.row(node(slab, k, i));
          const double now = std::hypot(x[0] - variant.at, x[1]) - variant.radius;
          largest = std::max(largest, std::abs(now / height(k) - 1));
        }
    return largest;
  }
};

// The inside of a pipe that is straight, then narrower: a square core, and layers from the wall
// to it.
struct Nozzle {
  static constexpr double kRadius = 10, kOutlet = 9, kLength = 40, kCore = 4, kGrowth = 1.25;
  static constexpr int kLayers = 12, kSide = 6, kAlong = 32;
  double straight;  // the straight part's length

  CadModel cad() const {
    BRepBuilderAPI_MakePolygon profile;
    for (const gp_Pnt& corner :
         {gp_Pnt(0, 0, 0), gp_Pnt(kRadius, 0, 0), gp_Pnt(kRadius, 0, straight),
          gp_Pnt(kOutlet, 0, kLength), gp_Pnt(0, 0, kLength)})
      profile.Add(corner);
    profile.Close();
    const TopoDS_Face section = BRepBuilderAPI_MakeFace(profile.Wire()).Face();
    return to_model(
        BRepPrimAPI_MakeRevol(section, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))).Shape());
  }

  // The section's quads, and its nodes: those of the core's grid, then those round it.
  struct Section {
    std::vector<std::array<Index, 4>> quads;
    std::vector<Eigen::Vector2d> core;  // of each node: where its way to the wall begins,
    std::vector<double> part;           // and how much of that it has gone
  };
  static Section section() {
    Section result;
    const auto grid = [](int i, int j) { return Index(i) * (kSide + 1) + j; };
    for (int i = 0; i <= kSide; ++i)
      for (int j = 0; j <= kSide; ++j) {
        result.core.emplace_back((2.0 * i / kSide - 1) * kCore, (2.0 * j / kSide - 1) * kCore);
        result.part.push_back(0);
        if (i < kSide && j < kSide)
          result.quads.push_back({grid(i, j), grid(i + 1, j), grid(i + 1, j + 1), grid(i, j + 1)});
      }
    std::vector<Index> round;  // the core's border, to the left
    for (int i = 0; i < kSide; ++i) round.push_back(grid(i, 0));
    for (int j = 0; j < kSide; ++j) round.push_back(grid(kSide, j));
    for (int i = kSide; i > 0; --i) round.push_back(grid(i, kSide));
    for (int j = kSide; j > 0; --j) round.push_back(grid(0, j));
    std::vector<Index> below = round;
    for (int k = kLayers - 1; k >= 0; --k) {
      std::vector<Index> next;
      for (const Index start : round) {
        next.push_back(std::ssize(result.core));
        result.core.push_back(result.core[start]);
        result.part.push_back(1 - (std::pow(kGrowth, k) - 1) / (std::pow(kGrowth, kLayers) - 1));
      }
      for (std::size_t i = 0; i < round.size(); ++i) {
        const std::size_t after = (i + 1) % round.size();
        result.quads.push_back({below[i], next[i], next[after], below[after]});
      }
      below = next;
    }
    return result;
  }

  Mesh mesh() const {
    const Section flat = section();
    const Index count = std::ssize(flat.core);
    Mesh mesh;
    mesh.points.resize((kAlong + 1) * count, 3);
    for (int j = 0; j <= kAlong; ++j) {
      const double way = 2.0 * j / kAlong;
      const double z = way <= 1 ? way * straight : straight + (way - 1) * (kLength - straight);
      const double wall = way <= 1 ? kRadius : kRadius + (way - 1) * (kOutlet - kRadius);
      for (Index n = 0; n < count; ++n) {
        const Eigen::Vector2d to = flat.part[n] * (wall * flat.core[n].normalized() - flat.core[n]);
        mesh.points.row(j * count + n) << (flat.core[n] + to).transpose(), z;
      }
    }
    for (Index j = 0; j < kAlong; ++j)
      for (const auto& q : flat.quads) {
        std::array<Index, 8> cell;
        for (int i = 0; i < 4; ++i) {
          cell[i] = q[i] + j * count;
          cell[4 + i] = q[i] + (j + 1) * count;
        }
        add_cell(mesh, CellType::Hexahedron, cell);
      }
    return mesh;
  }

  MorphResult morphed_to(const Nozzle& variant, PipelineOptions options) const {
    return MorphJob(std::make_shared<const CadModel>(cad()),
                    std::make_shared<const MeshFile>(mesh(), "nozzle"), std::move(options))
        .morph(variant.cad());
  }
};

}  // namespace

TEST_CASE("Layers keep their heights where that is asked for", "[apps][layers]") {
  const bool is_flat = GENERATE(false, true);
  const AirRound from{.radius = 2, .is_flat = is_flat}, to{.radius = 2.5, .is_flat = is_flat};
  CAPTURE(is_flat);
  PipelineOptions options;
  options.keep_layers = true;
  const MorphResult plain = from.morphed_to(to, {}), kept = from.morphed_to(to, options);
  CHECK_FALSE(plain.report.kept_layers);
  CHECK(from.largest_change(plain, to) > 0.03);
  REQUIRE(kept.report.outcome == Outcome::Done);
  REQUIRE(kept.report.kept_layers);
  const Index feet = AirRound::kAround * (is_flat ? 1 : AirRound::kSlabs + 1);
  CHECK(kept.report.kept_layers->columns == feet);
  CHECK(kept.report.kept_layers->kept == feet);
  // The weight that draws columns to the floors' turn has the same direction here.
  CHECK(from.largest_change(kept, to) < 1e-6);
  CHECK(kept.report.layers.share_kept == 1);
  // Nodes on walls and rim stay on them.
  for (int i = 0; i < AirRound::kAround; ++i)
    for (int k = 0; k <= AirRound::kLayers; ++k) {
      const Index top = from.node(is_flat ? 0 : AirRound::kSlabs, k, i);
      CHECK(kept.positions(from.node(0, k, i), 2) == 0);
      CHECK(std::abs(kept.positions(top, 2) - (is_flat ? 0 : AirRound::kHeight)) < 1e-12);
      if (k < AirRound::kLayers) continue;
      CHECK(kept.positions.row(top).head<2>().norm() == Approx(AirRound::kRim).epsilon(1e-12));
    }
}

TEST_CASE("Layers in a gap that closes keep what there is room for", "[apps][layers]") {
  const bool is_flat = GENERATE(false, true);
  CAPTURE(is_flat);
  const AirRound from{.radius = 2, .is_flat = is_flat},
      to{.radius = 2, .at = 7.3, .is_flat = is_flat};
  PipelineOptions options;
  options.keep_layers = true;
  const MorphResult kept = from.morphed_to(to, options);
  REQUIRE(kept.report.outcome == Outcome::Done);
  REQUIRE(kept.report.kept_layers);
  const KeptLayers& layers = *kept.report.kept_layers;
  CHECK(layers.kept > 0);
  CHECK(layers.partly > 0);
  CHECK(layers.kept + layers.partly == layers.columns);
  // The first cells have room everywhere.
  CHECK(kept.report.layers.share_kept == 1);
}

TEST_CASE("Layers stay as a morph leaves them where they would have a mesh refused",
          "[apps][layers]") {
  const bool is_flat = GENERATE(false, true);
  CAPTURE(is_flat);
  const AirRound from{.radius = 2, .is_flat = is_flat}, to{.radius = 2.5, .is_flat = is_flat};
  const MorphResult plain = from.morphed_to(to, {});
  PipelineOptions options;
  options.keep_layers = true;
  const MorphResult kept = from.morphed_to(to, options);
  REQUIRE(kept.report.after.min_scaled_jacobian < plain.report.after.min_scaled_jacobian);
  options.min_scaled_jacobian =
      (kept.report.after.min_scaled_jacobian + plain.report.after.min_scaled_jacobian) / 2;
  const MorphResult left = from.morphed_to(to, options);
  CHECK(left.report.outcome == Outcome::Done);
  CHECK(left.positions == plain.positions);
  REQUIRE(left.report.kept_layers);
  CHECK(left.report.kept_layers->kept == 0);
  CHECK(left.report.run.warnings.size() == plain.report.run.warnings.size() + 1);
}

TEST_CASE("Layers stay as a morph leaves them where it keeps their heights and more of the shape",
          "[apps][layers]") {
  const AirRound from{.radius = 2}, near{.radius = 2, .at = 0.1}, far{.radius = 2, .at = 3};
  PipelineOptions options;
  options.keep_layers = true;
  const MorphResult plain = from.morphed_to(near, {}), left = from.morphed_to(near, options);
  REQUIRE(plain.report.layers.share_kept == 1);
  CHECK(left.report.outcome == Outcome::Done);
  CHECK(left.positions == plain.positions);
  REQUIRE(left.report.kept_layers);
  CHECK(left.report.kept_layers->kept == 0);
  const MorphResult kept = from.morphed_to(far, options);
  CHECK(kept.report.layers.share_kept == 1);
  CHECK(kept.report.kept_layers->kept == kept.report.kept_layers->columns);
}

TEST_CASE("Layers that grow by less, up to another wall, keep the heights of their lower half",
          "[apps][layers]") {
  const bool is_flat = GENERATE(false, true);
  const double growth = GENERATE(1.06, 1.1);
  CAPTURE(is_flat, growth);
  const AirRound from{.radius = 5, .is_flat = is_flat, .growth = growth},
      to{.radius = 5.5, .is_flat = is_flat, .growth = growth};
  PipelineOptions options;
  options.keep_layers = true;
  const MorphResult plain = from.morphed_to(to, {}), kept = from.morphed_to(to, options);
  CHECK(from.largest_change(plain, to) > 0.03);
  REQUIRE(kept.report.outcome == Outcome::Done);
  REQUIRE(kept.report.kept_layers);
  const Index feet = AirRound::kAround * (is_flat ? 1 : AirRound::kSlabs + 1);
  CHECK(kept.report.kept_layers->columns == feet);
  CHECK(kept.report.kept_layers->partly == feet);
  CHECK(from.largest_change(kept, to) < 1e-6);
  CHECK(kept.report.layers.are_growing());
  // The gap loses a tenth, and no cell half as much of its shape: all that is beyond gives way.
  CHECK(kept.report.after.min_scaled_jacobian > 0.95 * kept.report.before.min_scaled_jacobian);
}

TEST_CASE("A mesh without layers is morphed as ever where they are to be kept, and that is told",
          "[apps][layers]") {
  const bool is_flat = GENERATE(false, true);
  CAPTURE(is_flat);
  const AirRound from{.radius = 5, .is_flat = is_flat, .growth = 1.001},
      to{.radius = 5.5, .is_flat = is_flat, .growth = 1.001};
  PipelineOptions options;
  options.keep_layers = true;
  const MorphResult plain = from.morphed_to(to, {}), asked = from.morphed_to(to, options);
  CHECK(asked.report.outcome == Outcome::Done);
  CHECK(asked.positions == plain.positions);
  REQUIRE(asked.report.kept_layers);
  CHECK(asked.report.kept_layers->columns == 0);
  CHECK(asked.report.run.warnings.size() == plain.report.run.warnings.size() + 1);
}

TEST_CASE("What inner nodes alone can't repair, those of the surface do by little work",
          "[apps][steps]") {
  const AirRound from{.radius = 2}, to{.radius = 2, .at = 7.6};
  const MorphResult morphed = from.morphed_to(to, {});
  CHECK(morphed.report.outcome == Outcome::Done);
  CHECK(morphed.report.stepping.steps <= 2);
  REQUIRE(morphed.report.untangling);
  CHECK(morphed.report.untangling->before > 0);
  CHECK(morphed.report.untangling->slid_nodes > 0);
  CHECK(check_validity(from.mesh(), morphed.positions, morphed.base->orientation).invalid == 0);
}

TEST_CASE("What two steps leave inverted and no repair mends, further steps may", "[apps][steps]") {
  const AirRound from{.radius = 1.5}, to{.radius = 1.5, .at = 8};
  PipelineOptions two_steps;
  two_steps.stepping.max_steps = 2;
  REQUIRE(from.morphed_to(to, two_steps).report.outcome == Outcome::Inverted);
  const MorphResult morphed = from.morphed_to(to, {});
  CHECK(morphed.report.outcome == Outcome::Done);
  CHECK(morphed.report.stepping.steps > 2);
  CHECK(check_validity(from.mesh(), morphed.positions, morphed.base->orientation).invalid == 0);
}

TEST_CASE("Layers that a morph sheared stand up again where that keeps more of the cells",
          "[apps][layers]") {
  const Nozzle from{10}, to{20};
  PipelineOptions options;
  options.quality = QualityMode::Fast;
  const MorphResult fast = from.morphed_to(to, options), best = from.morphed_to(to, {});
  REQUIRE(best.report.outcome == Outcome::Done);
  CHECK_FALSE(fast.report.kept_layers);
  REQUIRE(best.report.kept_layers);
  CHECK(best.report.kept_layers->kept == best.report.kept_layers->columns);
  CHECK(fast.report.layers.lean_after > 30);
  CHECK(best.report.layers.lean_after < 5);
  CHECK(best.report.layers.share_kept == 1);
  CHECK(worst_cells(best.quality).worst_twentieth >
        1.1 * worst_cells(fast.quality).worst_twentieth);
}

TEST_CASE("Columns stand on one node each, and end where layers of two walls meet",
          "[apps][layers]") {
  const AirRound air{.radius = 2};
  const Mesh mesh = air.mesh();
  std::vector<char> is_surface(mesh.node_count(), 0);
  for (int slab = 0; slab <= AirRound::kSlabs; ++slab)
    for (int i = 0; i < AirRound::kAround; ++i) is_surface[air.node(slab, 0, i)] = 1;
  const LayerColumns layers =
      find_layer_columns(mesh, find_cell_neighbours(mesh), is_surface, mesh.points);
  REQUIRE(layers.columns.size() == AirRound::kAround * (AirRound::kSlabs + 1));
  for (const LayerColumn& column : layers.columns) {
    CHECK(is_surface[column.foot]);
    REQUIRE(column.nodes.size() > 5);
    for (std::size_t k = 0; k < column.nodes.size(); ++k)
      CHECK(column.nodes[k] == column.foot + Index(k + 1) * AirRound::kAround);
  }
  // Turned and shifted they are carried as they are; where the floors are stretched in their own
  // surface heights stay.
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  Points after = mesh.points * turn.transpose();
  after.rowwise() += Eigen::RowVector3d(1, 2, 3);
  CHECK((carry_columns(layers, mesh.points, after) - after).cwiseAbs().maxCoeff() < 1e-12);
  Points longer = mesh.points;
  longer.col(2) *= 1.5;
  const Points carried = carry_columns(layers, mesh.points, longer);
  for (const LayerColumn& column : layers.columns)
    for (const Index node : column.nodes)
      CHECK((carried.row(node) - longer.row(node)).norm() < 1e-12);
}

}  // namespace cadmorph
