#include "surface/face_progress.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <catch2/catch.hpp>
#include <numbers>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector3d;
using std::numbers::pi;

TEST_CASE("the angle about a hole tells how far along its rim a place is", "[surface][curves]") {
  constexpr double kRadius = 4;
  const CadModel model = to_model(
      BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(10, 40).Shape(),
                      BRepPrimAPI_MakeCylinder(
                          gp_Ax2(gp_Pnt(0, 0, 20), gp_Dir(1, 0, 0), gp_Dir(0, 0, 1)), kRadius, 30)
                          .Shape())
          .Shape());
  int rims = 0, holes = 0;
  for (const CadCurve& curve : model.skeleton().curves) {
    const bool is_intersection = model.edges()[curve.links.front().edge].is_free_form;
    if (!is_intersection) continue;
    ++rims;
    for (const FaceId face : curve.faces) {
      const auto progress = FaceProgress::along(model, curve, face, 0);
      CHECK_FALSE(FaceProgress::along(model, curve, face, 1));
      const auto& f = model.faces()[face];
      const Vector3d x = model.evaluate(face, f.lower).point;
      const bool is_hole = std::abs(Vector3d(0, x.y(), x.z() - 20).norm() - kRadius) < 1e-9;
      REQUIRE(progress.has_value() == is_hole);
      if (!is_hole) continue;
      ++holes;
      // The rim rises by at most tan a = 4 sin(45) / sqrt(100 - 8) times sin(45) along the hole.
      CHECK(progress->straightness() > 0.9);
      CHECK(progress->straightness() <= 1);
      REQUIRE(progress->seam());
      const auto angle = [&](const CurveLocation& l) {
        const Vector3d p = model.evaluate_edge(l.edge, l.t).point;
        return std::atan2(p.y(), p.z() - 20);
      };
      const double from = angle(progress->locate(0)), step = angle(progress->locate(0.01)) - from;
      for (const double s : {0.0, 0.1, 0.37, 0.5, 0.81, 0.999}) {
        const CurveLocation at = progress->locate(s);
        CHECK(std::abs((*progress)(at)-s) < 1e-12);
        const double turned = (angle(at) - from) / (2 * pi) * std::copysign(1.0, std::sin(step));
        CHECK(std::abs(turned - std::floor(turned + 1e-6) - s) < 1e-6);  // pcurves' tolerance
      }
      CHECK(progress->locate(1.25).t == progress->locate(0.25).t);
    }
  }
  CHECK(rims == 1);
  CHECK(holes == 1);
}
