// A volume morph as one linear map.

#include <catch2/catch.hpp>
#include <cmath>

#include "../core/sample_meshes.h"
#include "core/errors.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Catch::Matchers::Contains;
using Eigen::Vector3d;

double largest(const RowMatrix& rows) { return rows.rowwise().norm().maxCoeff(); }

// A body in a far field, and two motions of it.
struct Body {
  explicit Body(int n, double far = 50)
      : field(far_field(n, far)),
        start(rows_of(field.mesh.points, field.surface)),
        grow(targets(field, [](const Vector3d& x) -> Vector3d { return 0.1 * x; }) - zero()),
        bend(targets(field,
                     [](const Vector3d& x) -> Vector3d {
                       return 0.1 *
                              Vector3d(std::sin(2 * x[2]), 0.3 * x[0] * x[1], std::cos(3 * x[0]));
                     }) -
             zero()) {}

  // targets() maps the body's nodes and leaves the others: these stay.
  Points zero() const {
    Points result = start;
    result.topRows(std::ssize(field.body)).setZero();
    return result;
  }

  FarField field;
  Points start, grow, bend;
};

}  // namespace

TEST_CASE("A linearised morph is linear in a far field, and keeps within the bound",
          "[volume][linear]") {
  for (const int n : {8, 19}) {  // few centres, and those that the adaptive solver takes
    const Body body(n);
    const VolumeMorph plain(body.field.mesh, body.field.surface);
    const VolumeMorph morph = plain.linearised({body.start + body.grow, body.start + body.bend});
    INFO(morph.report().reason);
    CHECK_THAT(morph.report().reason, Contains("a linear map of") && Contains("for 2 motions"));
    const auto displacement = [&](const Points& motion) {
      const Points result = morph.morph(body.start + motion);
      CHECK(rows_of(result, body.field.surface) == Points(body.start + motion));
      return Points(result - body.field.mesh.points);
    };
    const Points u = displacement(body.grow), v = displacement(body.bend);
    CHECK(largest(u) <= 1.21 * largest(body.grow));
    CHECK(largest(v) <= 1.21 * largest(body.bend));
    const double size = std::max(largest(u), largest(v));
    for (int k = 0; k < 20; k += n == 8 ? 1 : 6) {
      const double s = std::pow(10, -6 + 0.3 * k), t = std::sin(k) * s;
      const Points both = displacement(s * body.grow + t * body.bend);
      CHECK(largest(both - s * u - t * v) < 1e-10 * size);
    }
    // The derivative is the same anywhere, and the morph itself.
    const VolumeDerivative map = morph.derivative(body.start);
    CHECK(largest(map.forward(body.bend) - RowMatrix(v)) < 1e-12 * size);
    CHECK(morph.derivative(body.start + body.bend).forward(body.grow) == map.forward(body.grow));
    CHECK(!morph.hold_check().may_be_held(body.start + body.grow));
  }
}

TEST_CASE("Without it, the morph in a far field jumps", "[volume][linear]") {
  // What a linearised morph is for: held anew for each motion, twice a motion is not twice as far.
  const Body body(8);
  const VolumeMorph plain(body.field.mesh, body.field.surface);
  const auto displacement = [&](const Points& motion) {
    return Points(plain.morph(body.start + motion) - body.field.mesh.points);
  };
  const Points sum = displacement(body.grow) + displacement(body.bend);
  CHECK(largest(displacement(body.grow + body.bend) - sum) > 1e-3 * largest(sum));
}

TEST_CASE("A linearised morph for one motion is the plain morph of it", "[volume][linear]") {
  for (const int n : {8, 19}) {
    const Body body(n);
    const VolumeMorph plain(body.field.mesh, body.field.surface);
    // Not small beside the body: kernels for those are chosen for a larger motion.
    for (const Points& motion : {Points(4 * body.grow), Points(4 * body.bend)}) {
      const Points expected = plain.morph(body.start + motion);
      const Points found = plain.linearised({body.start + motion}).morph(body.start + motion);
      // The solver's tolerance, 1e-5 of an anchor's distance from the body.
      CHECK(largest(found - expected) < 2e-3 * largest(motion));
    }
  }
}

TEST_CASE("A small step linearises a morph for large motions, too", "[volume][linear]") {
  const Mesh mesh = cube(CellType::Hexahedron, 20);
  const std::vector<Index> surface = cube_surface(mesh);
  const Points start = rows_of(mesh.points, surface);
  const Points motion = mapped(start, [](const Vector3d& x) -> Vector3d {
    return 0.2 * Vector3d(std::sin(25 * x[1]), std::sin(25 * x[2]), std::cos(25 * x[0]));
  });
  const VolumeMorph plain(mesh, surface);
  const Points expected = plain.morph(start + motion);
  const Points found = plain.linearised({start + 1e-5 * motion}).morph(start + motion);
  CHECK(largest(found - expected) < 0.02 * largest(motion));
}

TEST_CASE("A linearised morph without anchors is the plain one", "[volume][linear]") {
  Mesh mesh = cube(CellType::Hexahedron, 20);  // 2,402 surface nodes
  const std::vector<Index> surface = cube_surface(mesh);
  mesh.points = shaken(mesh.points, 0.01, 7);
  const Points start = rows_of(mesh.points, surface);
  const Points moved = mapped(start, [](const Vector3d& x) -> Vector3d {
    return x + 0.1 * Vector3d(std::sin(3 * x[1]), x[0] * x[2], std::cos(2 * x[0]));
  });
  const VolumeMorph plain(mesh, surface);
  const VolumeMorph morph = plain.linearised({moved, start});
  CHECK_THAT(morph.report().reason, Contains("and 0 anchors"));
  CHECK(largest(morph.morph(moved) - plain.morph(moved)) < 1e-6);
  const auto affine = [](const Vector3d& x) -> Vector3d {
    return {1.3 * x[0] + 0.2 * x[1] - 1, 0.9 * x[1], x[2] + 0.1 * x[0]};
  };
  CHECK(largest(morph.morph(mapped(start, affine)) - mapped(mesh.points, affine)) < 1e-11);
}

TEST_CASE("Affine motions stay exact where anchors hold the map", "[volume][linear]") {
  const Body body(8);
  const VolumeMorph morph =
      VolumeMorph(body.field.mesh, body.field.surface).linearised({body.start + body.grow});
  CHECK_THAT(morph.report().reason, !Contains("and 0 anchors"));
  const auto affine = [](const Vector3d& x) -> Vector3d {
    return {1.3 * x[0] + 0.2 * x[1] - 1, 0.9 * x[1], x[2] + 0.1 * x[0]};
  };
  const Points result = morph.morph(mapped(body.start, affine));
  CHECK(largest(result - mapped(body.field.mesh.points, affine)) < 1e-9);
  const VolumeDerivative map = morph.derivative(body.start);
  const RowMatrix u = body.bend, v = body.field.mesh.points.array().sin();
  const double forward = v.cwiseProduct(map.forward(u)).sum();
  CHECK(std::abs(forward - map.adjoint(v).cwiseProduct(u).sum()) <
        1e-12 * v.norm() * map.forward(u).norm());
}

TEST_CASE("What a morph can't be linearised for is refused", "[volume][linear]") {
  const Body body(8);
  const VolumeMorph plain(body.field.mesh, body.field.surface);
  CHECK_THROWS_WITH(plain.linearised({}), Contains("no motion is given"));
  CHECK_THROWS_WITH(plain.linearised({body.start}), Contains("moves a node"));
  CHECK_THROWS_AS(plain.linearised({body.start.topRows(3)}), InvalidInputError);
  const VolumeMorph morph = plain.linearised({body.start + body.grow});
  CHECK_THROWS_WITH(morph.fields(body.start), Contains("has no fields"));
  CHECK_THROWS_AS(morph.morph(body.start.topRows(3)), InvalidInputError);
  CHECK_THROWS_AS(morph.derivative(body.start.topRows(3)), InvalidInputError);
  VolumeMorphOptions options;
  options.method = MorphMethod::Femwarp;
  CHECK_THROWS_WITH(VolumeMorph(body.field.mesh, body.field.surface, options)
                        .linearised({body.start + body.grow}),
                    Contains("no derivative"));
}

}  // namespace cadmorph
