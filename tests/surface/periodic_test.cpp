#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <Eigen/Geometry>
#include <Geom_BezierSurface.hxx>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <gp_Ax1.hxx>
#include <numbers>

#include "morph_case.h"
#include "triangulation.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// A curved side from hub to casing and from inlet to outlet; `camber` bends it, `lean` leans it.
Handle(Geom_BezierSurface) side(double camber, double lean) {
  TColgp_Array2OfPnt poles(1, 5, 1, 4);
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 4; ++j) {
      const double along = i / 4.0, up = j / 3.0;
      const double angle = camber * std::sin(pi * along) * (1 + up) + lean * up * up;
      const double radius = 5 + 5 * up;
      poles.SetValue(i + 1, j + 1,
                     gp_Pnt(radius * std::cos(angle), radius * std::sin(angle), 9 * along));
    }
  return new Geom_BezierSurface(poles);
}

/// A passage between a side and its image a period further on.
struct Passage {
  Handle(Geom_BezierSurface) first;
  bool is_turned;  // else shifted
  double period;   // radians, or a part of kShift
  std::array<int, 3> cells{6, 5, 4};

  static inline const Vector3d kShift{1, 6, 2};

  Isometry3d at(double part) const {
    Isometry3d result = Isometry3d::Identity();
    if (is_turned)
      result.rotate(Eigen::AngleAxisd(part * period, Vector3d::UnitZ()));
    else
      result.translate(part * period * kShift);
    return result;
  }
  TopoDS_Shape shape() const {
    const TopoDS_Face face = BRepBuilderAPI_MakeFace(first, 1e-7).Face();
    const Vector3d s = period * kShift;
    if (is_turned)
      return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), period);
    return BRepPrimAPI_MakePrism(face, gp_Vec(s.x(), s.y(), s.z()));
  }
  Mesh mesh() const {
    return hex_grid(cells, [&](const Vector3d& s) -> Vector3d {
      const gp_Pnt p = first->Value(std::pow(s.x(), 1.3), s.y());
      return at(s.z()) * Vector3d(p.X(), p.Y(), p.Z());
    });
  }
};

/// How far nodes of the second side are off the images of those of the first, and how far they
/// moved.
struct Apart {
  double most = 0, farthest = 0;
  Index pairs = 0, unpaired = 0;  // those that a repair may part
};

Apart apart(const Passage& base, const Passage& variant, const MorphCase& c, const Morphed& m) {
  const Mesh& mesh = c.mesh;
  const Points& moved = m.points;
  Apart result;
  for (Index i = 0; i < mesh.node_count(); ++i) {
    Index image = -1;
    for (Index k = 0; k < mesh.node_count(); ++k)
      if ((mesh.points.row(k).transpose() - base.at(1) * mesh.points.row(i).transpose()).norm() <
          1e-9)
        image = k;
    if (image < 0) continue;
    ++result.pairs;
    for (const Index node : {i, image}) {
      const auto row = std::ranges::lower_bound(c.boundary.nodes, node) - c.boundary.nodes.begin();
      result.unpaired += !std::ranges::binary_search(m.surface.paired, static_cast<int>(row));
    }
    result.most =
        std::max(result.most,
                 (moved.row(image).transpose() - variant.at(1) * moved.row(i).transpose()).norm());
    result.farthest = std::max(result.farthest, (moved.row(i) - mesh.points.row(i)).norm());
  }
  return result;
}

}  // namespace

TEST_CASE("curved sides a period apart move alike", "[surface][periodic]") {
  const bool is_turned = GENERATE(true, false);
  const unsigned seed = GENERATE(0, 1, 2);
  const double new_period = GENERATE(1.0, 1.1);
  const double period = is_turned ? pi / 6 : 1;
  CAPTURE(is_turned, seed, new_period);
  const Passage base{side(0.1, 0.05), is_turned, period},
      variant{side(0.16, -0.03), is_turned, period * new_period};
  const auto shuffled = [&](const Passage& passage, unsigned by) {
    if (seed == 0) return to_model(passage.shape());
    return to_model(
        shuffle(to_nurbs(passage.shape()),
                {.seed = seed + by, .has_reversed_edges = true, .has_reversed_surfaces = true})
            .shape);
  };
  const MorphCase c = mesh_case(shuffled(base, 0), base.mesh());
  const Morphed m = morph(c, shuffled(variant, 10));
  const Apart found = apart(base, variant, c, m);
  CHECK(found.pairs == 7 * 6);
  CHECK(found.unpaired == 0);
  CHECK(found.farthest > 0.3);
  CHECK(found.most <= 1e-12 * c.diagonal);
}
