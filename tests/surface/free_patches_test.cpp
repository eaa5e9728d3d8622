#include "surface/free_patches.h"

#include <BRepPrimAPI_MakeSphere.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "core/quality.h"
#include "morph_case.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr double kRadius = 5, kFar = 30;

/// The part of a ball with x and y positive, up to `angle` from y towards z.
TopoDS_Shape ball_sector(double radius, double angle) {
  const gp_Ax2 axes(gp_Pnt(0, 0, 0), gp_Dir(1, 0, 0), gp_Dir(0, 1, 0));
  return BRepPrimAPI_MakeSphere(axes, radius, 0, pi / 2, angle).Solid();
}

/// Wedges between a ball_sector and a sphere of radius kFar or, cutting its edges, the box round
/// it, the first layer 0.015 thick. Three symmetry planes meet in the three lines where the sector
/// has its corners.
Mesh around_sector(double angle, bool is_box = false) {
  constexpr int kSide = 10, kLayers = 12;
  const Vector3d a(1, 0, 0), b(0, 1, 0), c(0, std::cos(angle), std::sin(angle));
  std::vector<Vector3d> directions;
  std::vector<std::array<Index, 3>> triangles;
  const auto id = [](Index i, Index j) { return i * (2 * kSide + 3 - i) / 2 + j; };
  for (int i = 0; i <= kSide; ++i)
    for (int j = 0; i + j <= kSide; ++j) {
      const bool is_c = i == 0 && j == 0, is_edge = i == 0 && angle == pi / 2;
      const Vector3d sum = i * a + j * b + (kSide - i - j) * c;
      directions.push_back(is_c ? c : sum.normalized());
      if (is_edge) directions.back().x() = 0;
      if (i + j < kSide) triangles.push_back({id(i, j), id(i + 1, j), id(i, j + 1)});
      if (i + j + 1 < kSide) triangles.push_back({id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)});
    }
  const auto count = static_cast<Index>(directions.size());
  Mesh mesh;
  mesh.points.resize(count * (kLayers + 1), 3);
  mesh.offsets = {0};
  for (Index k = 0; k <= kLayers; ++k)
    for (Index n = 0; n < count; ++n) {
      const Vector3d& d = directions[n];
      const double far = is_box ? kFar / d.maxCoeff() : kFar;
      mesh.points.row(k * count + n) =
          (kRadius + (far - kRadius) * std::pow(double(k) / kLayers, 3)) * d;
    }
  for (Index k = 0; k < kLayers; ++k)
    for (const auto& t : triangles) {
      mesh.types.push_back(CellType::Wedge);
      for (const Index layer : {k, k + 1})
        for (const Index n : t) mesh.connectivity.push_back(layer * count + n);
      mesh.offsets.push_back(std::ssize(mesh.connectivity));
    }
  return mesh;
}

}  // namespace

TEST_CASE("nodes where symmetry planes meet slide along their line", "[surface][far-field]") {
  for (const auto& [degrees, is_box] :
       std::vector<std::pair<double, bool>>{{90, false}, {20, false}, {90, true}}) {
    DYNAMIC_SECTION(degrees << " degrees" << (is_box ? ", a box" : "")) {
      const double angle = degrees * pi / 180;
      const Vector3d oblique(0, std::cos(angle), std::sin(angle));
      const MorphCase c =
          mesh_case(to_model(ball_sector(kRadius, angle)), around_sector(angle, is_box));
      const Orientation orientation = detect_orientation(c.mesh);
      REQUIRE(measure_quality(c.mesh, c.mesh.points, orientation).inverted == 0);
      for (const double radius : {8.0, 4.0}) {
        CAPTURE(radius);
        const Morphed result = morph(c, to_model(ball_sector(radius, angle)));
        CHECK(measure_quality(c.mesh, result.points, orientation).inverted == 0);
        int on_lines = 0;
        for (Index n = 0; n < c.mesh.node_count(); ++n) {
          const Vector3d x = c.mesh.points.row(n), y = result.points.row(n);
          for (const Vector3d& line : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), oblique}) {
            if (x.cross(line).norm() > 1e-12 * kFar) continue;
            ++on_lines;
            // From the body's tip, linearly to nothing at the far field.
            const double part = (kFar - x.norm()) / (kFar - kRadius);
            const Vector3d expected = (x.norm() + part * (radius - kRadius)) * line;
            CHECK((y - expected).norm() <= 1e-9 * kFar);
            if (line == Vector3d(1, 0, 0)) CHECK((y - x).tail<2>().norm() <= 1e-30);
          }
        }
        CHECK(on_lines == 3 * 13);
      }
    }
  }
}

TEST_CASE("a line between planes takes of the CAD's motion what is along it",
          "[surface][far-field]") {
  const MorphCase c = mesh_case(to_model(ball_sector(kRadius, pi / 2)), around_sector(pi / 2));
  const SurfaceMorph morph(c.base, c.mesh, c.boundary);
  const SurfaceMesh surface = make_surface_mesh(c.mesh, c.boundary, 1);
  const auto patches = find_free_patches(surface, c.boundary, morph.association());
  const Vector3d step(0.5, 0.3, 0);
  Points moved = surface.points;
  for (const RowId n : morph.association().dimension.ids())
    if (morph.association().dimension[n] != CadDimension::None) moved.row(n) += step;
  for (const FreePatch& patch : patches)
    if (patch.is_planar) slide_patch(surface, patch, moved);
  int on_line = 0;
  for (Index n = 0; n < moved.rows(); ++n) {
    const Vector3d x = surface.points.row(n), y = moved.row(n);
    if (x.tail<2>().norm() > 0 || x.x() < kRadius + 1e-9) continue;
    ++on_line;
    CHECK(y.tail<2>() == x.tail<2>());
    CHECK(std::abs(y.x() - x.x() - 0.5 * (kFar - x.x()) / (kFar - kRadius)) <= 1e-9);
  }
  CHECK(on_line == 12);
}

TEST_CASE("the derivative of sliding planes is their motion's, and its adjoint its transpose",
          "[surface][far-field]") {
  const MorphCase c = mesh_case(to_model(ball_sector(kRadius, pi / 2)), around_sector(pi / 2));
  const SurfaceMorph morph(c.base, c.mesh, c.boundary);
  const Points base = c.mesh.points(c.boundary.nodes, Eigen::all);
  std::vector<Index> given, following;
  for (const RowId n : morph.association().dimension.ids()) {
    const bool is_far = base.row(n).norm() > kFar - 1e-9;
    const bool is_cad = morph.association().dimension[n] != CadDimension::None;
    (is_far || is_cad ? given : following).push_back(n);
  }
  REQUIRE(following.size() > 300);
  // Small motions leave the planes as they are, large ones take anchors: a ball that grows.
  for (const double growth : {0.01, 0.6}) {
    CAPTURE(growth);
    Points moved = base;
    for (const Index n : given)
      if (base.row(n).norm() < kFar - 1) moved.row(n) *= 1 + growth;
    const SlideDerivative map = morph.slide_derivative(moved);
    RowMatrix u = RowMatrix::Zero(base.rows(), 6), v(base.rows(), 6);
    for (Index i = 0; i < v.size(); ++i) v.data()[i] = std::sin(1e3 * double(i * i % 10007));
    for (const Index n : given)
      for (int d = 0; d < 6; ++d) u(n, d) = std::cos(0.2 * d + base(n, d % 3));
    const RowMatrix forward = map.forward(u), adjoint = map.adjoint(v);
    CHECK(std::abs(v.cwiseProduct(forward).sum() - adjoint.cwiseProduct(u).sum()) <
          1e-12 * v.norm() * forward.norm());
    CHECK(adjoint(following, Eigen::all).isZero(0));
    CHECK(forward(given, Eigen::all) == u(given, Eigen::all));
    RowMatrix other = u;
    other(following, Eigen::all).setOnes();
    CHECK(map.forward(other) == forward);
    // With the anchors held the motion is linear.
    Points slid = moved;
    slid(following, Eigen::all) = base(following, Eigen::all);
    const SurfaceMesh surface = make_surface_mesh(c.mesh, c.boundary, 1);
    for (const FreePatch& patch : find_free_patches(surface, c.boundary, morph.association()))
      if (patch.is_planar) slide_patch(surface, patch, slid);
    CHECK((base + Points(map.forward(moved - base)) - slid).cwiseAbs().maxCoeff() < 1e-9 * kFar);
  }
}
