#include "cad/curve_table.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

CadModel model(const std::string& name) {
  return to_model(read_shape(model_file("shapes/" + name + ".step")));
}

}  // namespace

TEST_CASE("length fractions on a circle are angles", "[cad][curve]") {
  const CadModel cylinder = model("cylinder");
  for (const CurveId c : {CurveId(0), CurveId(1)}) {
    const CurveTable table(cylinder, c);
    CHECK(table.is_closed());
    CHECK(std::abs(table.length() / (2 * pi * 15) - 1) < 1e-3);
    const Vector3d start = table.point(0);
    for (int i = 0; i < 50; ++i) {
      const double fraction = i / 50.0;
      const Vector3d p = table.point(fraction);
      CHECK(std::abs(std::hypot(p.x(), p.y()) - 15) < 1e-9);
      const double angle =
          std::acos(std::clamp((start.x() * p.x() + start.y() * p.y()) / (15 * 15), -1.0, 1.0));
      CHECK(std::abs(angle - 2 * pi * std::min(fraction, 1 - fraction)) < 1e-3);
      CHECK((table.point(fraction + 1) - p).norm() < 1e-9);
      CHECK((table.point(fraction - 2) - p).norm() < 1e-9);
    }
  }
}

TEST_CASE("fractions and locations are inverse", "[cad][curve]") {
  for (const std::string name : {"bracket", "blade", "cylinder", "plate_4_holes"}) {
    DYNAMIC_SECTION(name) {
      const CadModel part = model(name);
      for (const CurveId c : part.skeleton().curves.ids()) {
        const CurveTable table(part, c);
        for (const double fraction : {0.013, 0.25, 0.5001, 0.77, 0.99})
          CHECK(std::abs(table.fraction(table.locate(fraction)) - fraction) < 1e-9);
      }
    }
  }
}

TEST_CASE("the shape of a curve is measured alike wherever it points", "[cad][curve]") {
  for (const std::string name : {"blade", "cylinder", "plate_4_holes"}) {
    const TopoDS_Shape shape = read_shape(model_file("shapes/" + name + ".step"));
    const CadModel part = to_model(shape);
    for (int turn = 0; turn < 16; ++turn) {  // also chords of negative components alone
      gp_Trsf motion;
      motion.SetRotation(gp_Ax1({}, gp_Dir(1, turn % 3 - 1, turn % 5 - 2)), 0.4 * turn);
      const CadModel turned = to_model(transformed(shape, motion));
      INFO(name << ", turn " << turn);
      for (const CurveId c : part.skeleton().curves.ids()) {
        const CurveTable before(part, c), after(turned, c);
        for (const double fraction : {0.013, 0.25, 0.5001, 0.77, 0.99}) {
          const CurveLocation at = before.locate(fraction);
          CHECK(std::abs(before.fraction(at, CurveMeasure::Shape) -
                         after.fraction(at, CurveMeasure::Shape)) < 1e-6);
        }
      }
    }
  }
}

TEST_CASE("open curves clamp at their ends, which are their corners", "[cad][curve]") {
  const CadModel box = model("box");
  for (const CurveId c : box.skeleton().curves.ids()) {
    const CurveTable table(box, c);
    const CadCurve& curve = box.skeleton().curves[c];
    const auto corner = [&](CornerId i) { return box.vertices()[box.skeleton().corners[i]].point; };
    CHECK(!table.is_closed());
    CHECK((table.point(0) - corner(curve.start)).norm() < 1e-9);
    CHECK((table.point(1) - corner(curve.end)).norm() < 1e-9);
    CHECK((table.point(1.5) - corner(curve.end)).norm() < 1e-9);
    CHECK((table.point(-1) - corner(curve.start)).norm() < 1e-9);
    CHECK((table.point(0.25) - (0.75 * corner(curve.start) + 0.25 * corner(curve.end))).norm() <
          1e-9);
    CHECK(std::abs(table.length() - (corner(curve.end) - corner(curve.start)).norm()) < 1e-9);
  }
}

TEST_CASE("the nearest point of a curve agrees with brute force", "[cad][curve]") {
  constexpr int kSamples = 3000;
  for (const std::string name : {"bracket", "blade", "cylinder"}) {
    DYNAMIC_SECTION(name) {
      const CadModel part = model(name);
      for (const CurveId c : part.skeleton().curves.ids()) {
        const CurveTable table(part, c);
        for (int i = 0; i < 12; ++i) {
          const Vector3d x = table.point((i + 0.3) / 12) +
                             0.03 * table.length() * Vector3d(std::sin(i), std::cos(3 * i), 0.2);
          double least = 1e300;
          for (int j = 0; j <= kSamples; ++j)
            least = std::min(least, (table.point(double(j) / kSamples) - x).norm());
          const EdgeFoot foot = table.nearest(x);
          CHECK(foot.distance <= least + 1e-9 * part.diagonal());
          CHECK((part.evaluate_edge(foot.edge, foot.t).point - x).norm() ==
                Approx(foot.distance).margin(1e-9));
        }
      }
    }
  }
}
