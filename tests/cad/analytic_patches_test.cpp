#include "cad/analytic_patches.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <catch2/catch.hpp>
#include <map>

#include "cad_variants.h"
#include "known_parts.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;

namespace {

constexpr double kTolerance = 1e-5;  // millimetres: what a merge allows on parts of 100

std::optional<CadModel> with_all_analytic(const CadModel& model) {
  std::vector<FaceId> faces;
  for (const FaceId face : model.faces().ids()) faces.push_back(face);
  return model.with_analytic_faces(faces);
}

/// Largest distance between edges and their curves on faces.
double off_edges(const CadModel& model) {
  double most = 0;
  for (const CoedgeId c : model.coedges().ids()) {
    const CadCoedge& coedge = model.coedges()[c];
    const CadEdge& edge = model.edges()[coedge.edge];
    for (int i = 0; i <= 200 && !edge.is_degenerate; ++i) {
      const double t = edge.first + (edge.last - edge.first) * i / 200;
      const Vector2d uv = model.pcurve(c, t);
      most = std::max(
          most, (model.evaluate(coedge.face, uv).point - model.evaluate_edge(coedge.edge, t).point)
                    .norm());
    }
  }
  return most;
}

std::map<SurfaceType, int> types(const CadModel& model) {
  std::map<SurfaceType, int> count;
  for (const CadFace& face : model.faces()) ++count[face.type];
  return count;
}

/// With a slot through cylinder and cone, and a hole across the ball.
std::vector<TopoDS_Shape> opened_shapes() {
  const TopoDS_Shape slot = BRepPrimAPI_MakeBox(gp_Pnt(-50, -3, -30), gp_Pnt(0, 3, 12)).Solid();
  const TopoDS_Shape hole =
      BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(-40, 2, 4), gp::DX()), 5, 80).Solid();
  return {BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(20, 30).Solid(), slot).Shape(),
          BRepAlgoAPI_Cut(BRepPrimAPI_MakeCone(20, 5, 30).Solid(), slot).Shape(),
          BRepAlgoAPI_Cut(BRepPrimAPI_MakeCone(0, 20, 30).Solid(), slot).Shape(),
          BRepAlgoAPI_Cut(BRepPrimAPI_MakeSphere(20).Solid(), hole).Shape()};
}

}  // namespace

TEST_CASE("analytic faces are told from the B-splines they were written as", "[cad][patches]") {
  for (const TopoDS_Shape& shape : opened_shapes())
    for (const bool is_reversed : {false, true}) {
      const CadModel plain = to_model(shape);
      CAPTURE(to_string(plain.faces().front().type), is_reversed);
      TopoDS_Shape nurbs = to_nurbs(shape);
      if (is_reversed)
        nurbs =
            shuffle(nurbs,
                    {.is_order_shuffled = false, .has_reversed_surfaces = true, .probability = 1})
                .shape;
      const CadModel written = to_model(nurbs);
      const auto found = with_all_analytic(written);
      REQUIRE(found);
      CHECK(types(*found) == types(plain));
      // The pieces of pcurves; a file's own are that exact.
      CHECK(off_edges(*found) < 1e-7 * plain.diagonal());
      CHECK((found->lower() - plain.lower()).norm() < 0.05);
      CHECK((found->upper() - plain.upper()).norm() < 0.05);
      for (const FaceId f : plain.faces().ids()) {
        const CadFace &before = written.faces()[f], &after = found->faces()[f];
        CHECK((after.period - before.period).norm() < 1e-6);
        CHECK(after.wires == before.wires);
      }
    }
}

TEST_CASE("normals stay outside on analytic faces, whatever the patch", "[cad][patches]") {
  int compared = 0;
  for (const TopoDS_Shape& shape : opened_shapes())
    for (const bool is_reversed : {false, true}) {
      const ShuffleOptions reversed{
          .is_order_shuffled = false, .has_reversed_surfaces = is_reversed, .probability = 1};
      const CadModel written = to_model(shuffle(to_nurbs(shape), reversed).shape);
      const auto found = with_all_analytic(written);
      REQUIRE(found);
      for (const CoedgeId c : written.coedges().ids()) {
        const CadCoedge& coedge = written.coedges()[c];
        const CadEdge& edge = written.edges()[coedge.edge];
        const double t = 0.7 * edge.first + 0.3 * edge.last;
        const auto normal = [&](const CadModel& model) {
          return model.normal(coedge.face, model.pcurve(c, t));
        };
        CHECK(found->coedges()[c].is_reversed == coedge.is_reversed);
        if (edge.is_degenerate) continue;
        ++compared;
        CHECK((normal(*found) - normal(written)).norm() < 1e-6);
      }
    }
  CHECK(compared == 196);  // all but the degenerate ones
}

TEST_CASE("free forms are no analytic faces", "[cad][patches]") {
  const TopoDS_Shape cylinder = BRepPrimAPI_MakeCylinder(20, 30).Solid();
  CHECK_FALSE(with_all_analytic(to_model(cylinder)));  // it has them
  CHECK_FALSE(with_all_analytic(to_model(to_nurbs(BRepPrimAPI_MakeTorus(30, 8).Solid()))));
  // All but the ends.
  const auto free_form = [](const std::optional<CadModel>& model) {
    return model && types(*model)[SurfaceType::BSpline] == 1;
  };
  CHECK(free_form(with_all_analytic(to_model(transformed(to_nurbs(cylinder), general_affine())))));
  // An ellipse that is a thousandth of a millimetre off a circle.
  const gp_GTrsf wider(gp_Mat(1 + 5e-5, 0, 0, 0, 1, 0, 0, 0, 1), gp_XYZ());
  CHECK(free_form(with_all_analytic(to_model(transformed(to_nurbs(cylinder), wider)))));
}

TEST_CASE("edges at the ends of a patch of a cylinder are told from its rims", "[cad][patches]") {
  const KnownPart& part = known_part("split_ring");
  const TopoDS_Shape ring = to_nurbs(part.make(part.sizes).shape);
  TopTools_IndexedDataMapOfShapeListOfShape faces_of;
  TopExp::MapShapesAndAncestors(ring, TopAbs_EDGE, TopAbs_FACE, faces_of);
  int seams = 0;
  for (int i = 1; i <= faces_of.Extent(); ++i) {
    const TopoDS_Edge edge = TopoDS::Edge(faces_of.FindKey(i));
    const TopoDS_Face one = TopoDS::Face(faces_of(i).First()),
                      other = TopoDS::Face(faces_of(i).Last());
    if (!one.IsSame(other) && is_at_end_of_patch(edge, one, kTolerance) &&
        is_at_end_of_patch(edge, other, kTolerance))
      ++seams;
  }
  CHECK(seams == 2);  // of the outer and the inner cylinder
}

TEST_CASE("pieces of an opened cylinder written as B-splines are merged wherever its seam lies",
          "[cad][patches]") {
  const KnownPart& part = known_part("split_ring");
  Sizes sizes = part.sizes;
  for (const double seam : {0.0, 0.8, 2.8, 4.4}) {
    CAPTURE(seam);
    sizes["seam"] = seam;
    const TopoDS_Shape ring = to_nurbs(part.make(sizes).shape);
    for (const CadModel& model : {to_model(ring), through_step(ring)}) {
      REQUIRE(model.faces().size() == 9);
      const auto merged = model.with_merged_faces(FaceMerge::AcrossSeams);
      REQUIRE(merged);
      CHECK(merged->faces().size() == 7);
      CHECK(merged->solid_count() == 1);
      CHECK(off_edges(*merged) < 1e-7 * model.diagonal());
    }
  }
}
