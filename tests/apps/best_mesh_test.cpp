#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <GC_MakeArcOfCircle.hxx>
#include <TopoDS_Face.hxx>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Pln.hxx>
#include <utility>

#include "cad_variants.h"
#include "core/mesh_file.h"
#include "core/parallel.h"
#include "family_steps.h"
#include "surface/node_slide.h"

namespace cadmorph {
namespace {

using namespace testing;

const WorstCells& best(const MorphResult& result) { return result.report.best_mesh->best; }

// A method as the others are compared: one step, nothing repaired.
WorstCells alone(const std::string& mesh, const VolumeMorphOptions& volume, double change) {
  PipelineOptions options;
  options.volume = volume;
  options.stepping.steps = 1;
  options.untangle = UntangleMode::Never;
  const MorphResult result = family_job("bore", mesh, options).morph(family_cad("bore", change));
  CHECK_FALSE(result.report.best_mesh);
  return worst_cells(result.quality);
}

// A strip in the plane with a notch, an arc, in its upper side, `at` along it, and a mesh that has
// 3 cells between the notch and the lower side.
struct Strip {
  static constexpr double kLength = 60, kHeight = 8, kHalf = 8, kDepth = 5;
  double at;

  gp_Pnt top(double t) const {  // t of the notch from -1 to 1
    const double radius = (kHalf * kHalf + kDepth * kDepth) / (2 * kDepth);
    const double angle = t * std::asin(kHalf / radius);
    return {at + radius * std::sin(angle), kHeight + radius - kDepth - radius * std::cos(angle), 0};
  }
  CadModel cad() const {
    const gp_Pnt corners[] = {{0, 0, 0}, {kLength, 0, 0}, {kLength, kHeight, 0},
                              top(1),    top(-1),         {0, kHeight, 0}};
    BRepBuilderAPI_MakeWire wire;
    for (const auto& [a, b] : {std::pair(0, 1), {1, 2}, {2, 3}, {4, 5}, {5, 0}})
      wire.Add(BRepBuilderAPI_MakeEdge(corners[a], corners[b]).Edge());
    wire.Add(BRepBuilderAPI_MakeEdge(GC_MakeArcOfCircle(top(-1), top(0), top(1)).Value()).Edge());
    return to_model(BRepBuilderAPI_MakeFace(gp_Pln(), wire.Wire()).Face());
  }
  Mesh mesh(bool is_second_order) const {
    constexpr Index kSide = 22, kArc = 12, kUp = 3, kColumns = 2 * kSide + kArc;
    const Index step = is_second_order ? 2 : 1, columns = step * kColumns, rows = step * kUp;
    Mesh mesh;
    mesh.points.resize((columns + 1) * (rows + 1), 3);
    for (Index i = 0; i <= columns; ++i) {
      const double column = double(i) / double(step), from_arc = column - kSide;
      const double left = at - kHalf, right = at + kHalf;
      gp_Pnt high, low;
      if (from_arc < 0)
        high = {left * column / kSide, kHeight, 0};
      else if (from_arc <= kArc)
        high = top(2 * from_arc / kArc - 1);
      else
        high = {right + (kLength - right) * (from_arc - kArc) / kSide, kHeight, 0};
      low = {from_arc < 0 || from_arc > kArc ? high.X() : left + 2 * kHalf * from_arc / kArc, 0, 0};
      for (Index k = 0; k <= rows; ++k) {
        const double up = double(k) / double(rows);
        mesh.points.row(i * (rows + 1) + k) << low.X() + up * (high.X() - low.X()), up * high.Y(),
            0;
      }
    }
    for (Index i = 0; i < columns; i += step)
      for (Index k = 0; k < rows; k += step) {
        const auto node = [&](Index right, Index up) { return (i + right) * (rows + 1) + k + up; };
        if (is_second_order)
          add_cell(mesh, CellType::BiquadraticQuad,
                   std::array{node(0, 0), node(2, 0), node(2, 2), node(0, 2), node(1, 0),
                              node(2, 1), node(1, 2), node(0, 1), node(1, 1)});
        else
          add_cell(mesh, CellType::Quad,
                   std::array{node(0, 0), node(1, 0), node(1, 1), node(0, 1)});
      }
    return mesh;
  }
  static MorphResult morphed(double by, bool is_second_order, QualityMode quality) {
    const Strip from{26}, to{26 + by};
    PipelineOptions options;
    options.quality = quality;
    return MorphJob(std::make_shared<const CadModel>(from.cad()),
                    std::make_shared<const MeshFile>(from.mesh(is_second_order), "strip"), options)
        .morph(to.cad());
  }
};

WorstCells faces_of(const MorphResult& result) {
  const BaseSide& base = *result.base;
  const FiniteVolumes volumes(base.mesh(), base.mesh().points, base.neighbours, base.orientation);
  return worst_faces(volumes, result.positions);
}

}  // namespace

TEST_CASE("No other method or kernel has a better mesh than the default", "[apps][families]") {
  std::vector<VolumeMorphOptions> others(3);
  others[0].method = MorphMethod::Femwarp;
  others[1].method = MorphMethod::Lbwarp;
  others[2].kernel = Kernel::biharmonic_3d();
  for (const std::string mesh : {"hex", "tet"}) {
    const MorphJob job = family_job("bore", mesh);
    for (const double change : {0.5, 1.0}) {
      const MorphResult result = job.morph(family_cad("bore", change));
      REQUIRE(result.report.best_mesh);
      CHECK(invalid_cells(job.base().mesh(), result.positions) == 0);
      for (std::size_t i = 0; i < others.size(); ++i) {
        INFO(mesh << ' ' << change << ", other " << i);
        const WorstCells other = alone(mesh, others[i], change);
        CHECK(best(result).min >= other.min);
        // The hexahedra at 50 % lost too little for surface nodes to leave their places, and all
        // poor cells lie on the surface.
        CHECK(best(result).worst_twentieth >= 0.99 * other.worst_twentieth);
      }
    }
  }
}

TEST_CASE("For finite volumes the faces are raised", "[apps][families]") {
  for (const std::string mesh : {"hex", "tet"}) {
    INFO(mesh);
    PipelineOptions plain, elements, volumes;
    plain.quality = QualityMode::Fast;
    elements.mesh_use = MeshUse::FiniteElements;
    volumes.mesh_use = MeshUse::FiniteVolumes;
    const CadModel full = family_cad("bore", 1);
    const auto morphed = [&](const PipelineOptions& options) {
      return family_job("bore", mesh, options).morph(full);
    };
    const MorphResult without = morphed(plain), by_elements = morphed(elements),
                      by_faces = morphed(volumes);
    CHECK_FALSE(by_elements.report.best_mesh->is_by_faces);
    CHECK(by_faces.report.best_mesh->is_by_faces);
    CHECK(by_faces.report.after.invalid == 0);
    const WorstCells fast = faces_of(without), fe = faces_of(by_elements), fv = faces_of(by_faces);
    CHECK(fv.min == Approx(best(by_faces).min));
    CHECK(fv.worst_twentieth == Approx(best(by_faces).worst_twentieth));
    CHECK(fv.min > fast.min);
    CHECK(fv.worst_twentieth > fast.worst_twentieth);
    CHECK(fv.min + fv.worst_twentieth > fe.min + fe.worst_twentieth);
    // checkMesh's own figure of the worst face.
    const QualityChecks checks = by_faces.report.after.checks;
    const double as_angle =
        face_angle(1 / std::hypot(1, finite_volume::kSkewnessSlope * checks.max_skewness));
    CHECK(face_angle(fv.min) == Approx(std::max(checks.max_non_orthogonality_deg, as_angle)));
  }
}

TEST_CASE(
    "For finite volumes flat cells are raised after the faces, where that costs these nothing",
    "[apps][families]") {
  PipelineOptions plain, volumes;
  plain.quality = QualityMode::Fast;
  volumes.mesh_use = MeshUse::FiniteVolumes;
  int raised = 0;
  const std::pair<const char*, double> cases[] = {
      {"hex", 1.4}, {"tet_quadratic", 1.3}, {"tet", 1.3}};
  for (const auto& [mesh, change] : cases) {
    INFO(mesh << ' ' << change);
    const CadModel variant = family_cad("bore", change);
    const MorphResult without = family_job("bore", mesh, plain).morph(variant),
                      with = family_job("bore", mesh, volumes).morph(variant);
    REQUIRE(with.report.best_mesh);
    const BestMeshReport& report = *with.report.best_mesh;
    CHECK(with.report.after.invalid == 0);
    CHECK(faces_of(with).min > faces_of(without).min);
    const WorstCells shapes = worst_cells(with.quality);
    if (report.is_by_faces) {
      CHECK(report.best.min == Approx(faces_of(with).min));
    } else {
      ++raised;
      CHECK(report.best.min == Approx(shapes.min));
      CHECK(sum_of_shares(shapes, report.base) > sum_of_shares(report.plain, report.base));
    }
  }
  CHECK(raised > 0);
}

TEST_CASE("Shells are raised by nodes that slide on the CAD", "[apps][families]") {
  // The faces of the hexahedra, as a mesh of their own.
  const MeshFile solid(model_file("bore/hex.vtu"));
  const Boundary boundary = extract_boundary(solid.mesh());
  Mesh shell;
  shell.points.resize(std::ssize(boundary.nodes), 3);
  for (std::size_t row = 0; row < boundary.nodes.size(); ++row)
    shell.points.row(static_cast<Index>(row)) = solid.mesh().points.row(boundary.nodes[row]);
  std::vector<Index> nodes;
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    nodes.clear();
    for (const Index node : boundary.facet(f))
      nodes.push_back(std::ranges::lower_bound(boundary.nodes, node) - boundary.nodes.begin());
    add_cell(shell, CellType::Quad, nodes);
  }
  PipelineOptions fast;
  fast.quality = QualityMode::Fast;
  const auto morphed = [&](const PipelineOptions& options) {
    return MorphJob(std::make_shared<const CadModel>(family_cad("bore", 0)),
                    std::make_shared<const MeshFile>(shell, "shell"), options)
        .morph(family_cad("bore", 1));
  };
  const MorphResult plain = morphed(fast), raised = morphed({});
  REQUIRE(raised.report.best_mesh);
  CHECK(raised.report.best_mesh->slid_nodes > 0);
  CHECK(raised.quality.min > 1.2 * plain.quality.min);
  CHECK(worst_cells(raised.quality).worst_twentieth > worst_cells(plain.quality).worst_twentieth);
  CHECK(raised.report.after.max_distance < 1e-9 * raised.variant->diagonal());
}

TEST_CASE("Nodes on edges of a plane mesh slide and stay evenly spaced", "[apps]") {
  for (const double by : {4.0, 8.0})
    for (const bool is_second_order : {false, true}) {
      INFO("by " << by << ", order " << 1 + is_second_order);
      const MorphResult fast = Strip::morphed(by, is_second_order, QualityMode::Fast),
                        best = Strip::morphed(by, is_second_order, QualityMode::Best);
      const double base = best.base->quality.min;
      CHECK(fast.quality.min < 0.5 * base);
      // The arc turns cells over that straight edges would not.
      CHECK((fast.quality.inverted > 0) == (by == 8 && is_second_order));
      CHECK(best.quality.inverted == 0);
      CHECK(best.quality.min > 0.55 * base);
      CHECK(best.report.best_mesh->slid_nodes > 0);
      CHECK(best.report.best_mesh->plain.min == fast.quality.min);
      CHECK(best.report.after.max_distance < 1e-12 * best.variant->diagonal());
      CHECK(best.positions.col(2).isZero(0));
      const Boundary& boundary = best.base->boundary;
      double least = 1, most = 1;
      for (const EdgeSegment& segment :
           slide_on_cad(*best.variant, best.base->association(), boundary, fast.surface).segments) {
        const double length =
            (best.positions.row(segment.a) - best.positions.row(segment.b)).norm();
        least = std::min(least, length / segment.length);
        most = std::max(most, length / segment.length);
      }
      CHECK(most > 1.01);
      CHECK(most / least < 3);
    }
}

TEST_CASE("Raised cells are the same alone, together and on any number of threads",
          "[apps][families]") {
  const MorphJob job = family_job("bore", "hex");
  const std::vector<CadModel> variants = {family_cad("bore", 0.6), family_cad("bore", 1)};
  set_thread_count(1);
  const MorphResult alone = job.morph(variants[1]);
  set_thread_count(0);
  const std::vector<MorphAttempt> together = job.morph_each(variants);
  CHECK_FALSE(alone.report.best_mesh->attempts.empty());
  CHECK(alone.positions == together[1].result.positions);
}

TEST_CASE("A morph that costs no shape, and one asked to be fast, are left as they are",
          "[apps][families]") {
  PipelineOptions options;
  options.quality = QualityMode::Fast;
  const CadModel same = family_cad("bore", 0), full = family_cad("bore", 1);
  const MorphJob best = family_job("bore", "hex"), fast = family_job("bore", "hex", options);
  const MorphResult still = best.morph(same);
  REQUIRE(still.report.best_mesh);
  CHECK(still.report.best_mesh->attempts.empty());
  CHECK(still.positions == fast.morph(same).positions);
  const MorphResult quick = fast.morph(full), raised = best.morph(full);
  CHECK_FALSE(quick.report.best_mesh);
  CHECK(raised.report.best_mesh->plain.min == quick.quality.min);
  CHECK(raised.quality.min > quick.quality.min);
}

TEST_CASE("Cells are judged against the mesh file's after a morph, too", "[apps][families]") {
  const MorphJob there = family_job("bore", "hex");
  const MorphResult full = there.morph(family_cad("bore", 1));
  CHECK(full.report.best_mesh->base.min == there.base().quality.min);
  // Back again: what counts is the file's mesh, not the one that went on this way.
  const MorphJob back(std::make_shared<const CadModel>(family_cad("bore", 1)),
                      std::make_shared<const MeshFile>(model_file("bore/hex.vtu")), {},
                      full.positions);
  const MorphResult again = back.morph(family_cad("bore", 0));
  CHECK(again.report.best_mesh->base.min == there.base().quality.min);
  // Three quarters are what raising goes on for.
  CHECK(again.report.best_mesh->plain.min < there.base().quality.min);
  CHECK(again.quality.min >= 0.75 * there.base().quality.min);
}

}  // namespace cadmorph
