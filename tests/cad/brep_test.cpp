#include "cad/brep.h"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepClass3d_SolidClassifier.hxx>
#include <BRepLib.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <GCE2d_MakeSegment.hxx>
#include <Geom2dAPI_PointsToBSpline.hxx>
#include <Geom2d_BSplineCurve.hxx>
#include <Geom_CylindricalSurface.hxx>
#include <TColgp_Array1OfPnt2d.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <random>

#include "cad/projector.h"
#include "cad/step_reader.h"
#include "cad_variants.h"
#include "core/errors.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

TopoDS_Shape shape(const std::string& name) {
  return read_shape(model_file("shapes/" + name + ".step"));
}

const std::vector<std::string> kShapes{
    "box",          "plate_12_holes", "bracket",  "stepped_shaft", "sphere",     "torus",
    "cone_frustum", "cone",           "cylinder", "blade",         "two_blocks", "sphere_in_box"};

int seams(const CadModel& model) {
  int count = 0;
  for (const auto& e : model.edges()) count += e.is_seam;
  return count;
}

int degenerate_edges(const CadModel& model) {
  int count = 0;
  for (const auto& e : model.edges()) count += e.is_degenerate;
  return count;
}

/// Points of a face's domain, and beyond it by a tenth.
std::vector<Vector2d> random_parameters(const CadFace& face, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> draw(-0.1, 1.1);
  std::vector<Vector2d> all;
  for (int i = 0; i < count; ++i) {
    const double a = draw(random), b = draw(random);
    all.push_back(face.lower + Vector2d(a, b).cwiseProduct(face.upper - face.lower));
  }
  return all;
}

/// Least distance of parameters to the pcurves of a face, in parts of the domain.
double distance_to_wires(const CadModel& model, int face, const Vector2d& uv) {
  const Vector2d size = model.faces()[FaceId(face)].upper - model.faces()[FaceId(face)].lower;
  double least = 1e300;
  for (const auto& wire : model.faces()[FaceId(face)].wires)
    for (const CoedgeId c : wire) {
      const CadEdge& e = model.edges()[model.coedges()[c].edge];
      for (int i = 0; i <= 400; ++i) {
        const Vector2d p = model.pcurve(c, e.first + (e.last - e.first) * i / 400);
        least = std::min(least, (p - uv).cwiseQuotient(size).norm());
      }
    }
  return least;
}

}  // namespace

TEST_CASE("a box has 6 faces, 12 edges and 8 corners", "[cad][brep]") {
  const CadModel box = to_model(shape("box"));
  CHECK(box.faces().size() == 6);
  CHECK(box.edges().size() == 12);
  CHECK(box.vertices().size() == 8);
  CHECK(box.coedges().size() == 24);
  CHECK(box.solid_count() == 1);
  CHECK(box.skeleton().curves.size() == 12);
  CHECK(box.skeleton().corners.size() == 8);
  CHECK(std::abs(box.diagonal() - std::sqrt(40. * 40 + 30 * 30 + 20 * 20)) < 1e-9);
  for (const auto& face : box.faces()) {
    CHECK(face.type == SurfaceType::Plane);
    CHECK(face.period.isZero(0));
    CHECK(face.wires.size() == 1);
    CHECK(face.solid == 0);
  }
  for (const auto& edge : box.edges()) {
    CHECK(edge.is_physical());
    CHECK(edge.coedges.size() == 2);
  }
  for (const auto& curve : box.skeleton().curves) {
    CHECK(curve.faces.size() == 2);
    CHECK(!curve.is_closed());
  }
}

TEST_CASE("a cylinder's seam is no physical curve", "[cad][brep]") {
  const CadModel cylinder = to_model(shape("cylinder"));
  CHECK(cylinder.faces().size() == 3);
  CHECK(cylinder.edges().size() == 3);
  CHECK(seams(cylinder) == 1);
  CHECK(degenerate_edges(cylinder) == 0);
  CHECK(cylinder.skeleton().corners.empty());
  REQUIRE(cylinder.skeleton().curves.size() == 2);
  for (const auto& curve : cylinder.skeleton().curves) {
    CHECK(curve.is_closed());
    CHECK(curve.faces.size() == 2);
    CHECK(std::abs(curve.length - 2 * pi * 15) < 1e-2 * 2 * pi * 15);
  }
  for (const auto& face : cylinder.faces()) {
    const bool is_mantle = face.type == SurfaceType::Cylinder;
    CHECK(std::abs(face.period.x() - (is_mantle ? 2 * pi : 0)) < 1e-9);
    CHECK(face.period.y() == 0);
  }
}

TEST_CASE("a torus has two seams and no physical curve", "[cad][brep]") {
  const CadModel torus = to_model(shape("torus"));
  CHECK(torus.faces().size() == 1);
  CHECK(torus.edges().size() == 2);
  CHECK(seams(torus) == 2);
  CHECK(torus.skeleton().curves.empty());
  CHECK(torus.skeleton().corners.empty());
  CHECK((torus.faces()[FaceId(0)].period - Vector2d(2 * pi, 2 * pi)).norm() < 1e-9);
}

TEST_CASE("a sphere has a seam and two poles", "[cad][brep]") {
  const CadModel sphere = to_model(shape("sphere"));
  CHECK(sphere.faces().size() == 1);
  CHECK(seams(sphere) == 1);
  CHECK(degenerate_edges(sphere) == 2);
  CHECK(sphere.skeleton().curves.empty());
  CHECK(sphere.skeleton().corners.empty());
  CHECK(std::abs(sphere.faces()[FaceId(0)].period.x() - 2 * pi) < 1e-9);
  CHECK(sphere.faces()[FaceId(0)].period.y() == 0);
}

TEST_CASE("a cone has a seam and its apex as a pole", "[cad][brep]") {
  const CadModel cone = to_model(shape("cone"));
  CHECK(cone.faces().size() == 2);
  CHECK(seams(cone) == 1);
  CHECK(degenerate_edges(cone) == 1);
  CHECK(cone.skeleton().curves.size() == 1);
  CHECK(cone.skeleton().corners.empty());
}

TEST_CASE("holes are wires and solids keep their faces apart", "[cad][brep]") {
  const CadModel plate = to_model(shape("plate_12_holes"));
  CHECK(plate.faces().size() == 18);
  int with_holes = 0;
  for (const auto& face : plate.faces()) with_holes += face.wires.size() == 13;
  CHECK(with_holes == 2);

  const CadModel blocks = to_model(shape("two_blocks"));
  CHECK(blocks.solid_count() == 2);
  CHECK(blocks.faces().size() == 12);
  int of_first = 0;
  for (const auto& face : blocks.faces()) of_first += face.solid == 0;
  CHECK(of_first == 6);
}

TEST_CASE("a shape without a face is no model", "[cad][brep][errors]") {
  CHECK_THROWS_AS(to_model(BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 2, 3)).Edge()),
                  CadError);
}

TEST_CASE("pcurves run along their edges", "[cad][brep]") {
  for (const auto& name : kShapes) {
    DYNAMIC_SECTION(name) {
      const CadModel model = to_model(shape(name));
      for (const CoedgeId c : model.coedges().ids()) {
        const CadCoedge& use = model.coedges()[c];
        const CadEdge& e = model.edges()[use.edge];
        for (int i = 0; i <= 10; ++i) {
          const double t = e.first + (e.last - e.first) * i / 10;
          const Vector3d on_face = model.evaluate(use.face, model.pcurve(CoedgeId(c), t)).point;
          CHECK((on_face - model.evaluate_edge(use.edge, t).point).norm() <=
                std::max(e.tolerance, 1e-7));
        }
      }
    }
  }
}

TEST_CASE("a face's material lies to the left of its coedges", "[cad][brep]") {
  const int physical[] = {24, 72, 62, 14, 0, 0, 4, 2, 4, 12, 48, 24};  // coedges of each shape
  REQUIRE(std::size(physical) == kShapes.size());
  for (std::size_t i = 0; i < kShapes.size(); ++i) {
    const std::string& name = kShapes[i];
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape solid = shape(name);
      const CadModel model = to_model(solid);
      const FaceOracle oracle(solid);
      int checked = 0;
      for (const auto& use : model.coedges()) {
        const CadEdge& e = model.edges()[use.edge];
        if (!e.is_physical()) continue;
        ++checked;
        const CurvePoint p = model.evaluate_edge(use.edge, e.first + 0.37 * (e.last - e.first));
        const Vector2d at = oracle.parameters(use.face, p.point);
        const Vector3d along = (use.is_reversed ? -1.0 : 1.0) * p.dt.normalized();
        const Vector3d left = model.normal(use.face, at).cross(along);
        const double step = 1e-3 * e.length;
        // On curved faces a tangential step leaves the face by far less than its own length.
        CHECK(oracle.side(use.face, oracle.parameters(use.face, p.point + step * left)) == 1);
        CHECK(oracle.distance(use.face, p.point + step * left) <
              0.2 * oracle.distance(use.face, p.point - step * left));
      }
      CHECK(checked == physical[i]);
    }
  }
}

TEST_CASE("normals point out of the solids", "[cad][brep]") {
  for (const auto& name : kShapes) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape part = shape(name);
      const CadModel model = to_model(part);
      std::vector<TopoDS_Shape> solids;
      for (TopExp_Explorer it(part, TopAbs_SOLID); it.More(); it.Next())
        solids.push_back(it.Current());
      const FaceOracle oracle(part);
      for (int f = 0; f < oracle.face_count(); ++f) {
        int checked = 0;
        for (const Vector2d& uv : random_parameters(model.faces()[FaceId(f)], 8, 5)) {
          if (oracle.side(f, uv) != 1) continue;
          const Vector3d n = model.normal(FaceId(f), uv), x = model.evaluate(FaceId(f), uv).point;
          if (n.isZero(0)) continue;  // a pole
          ++checked;
          CHECK(std::abs(n.norm() - 1) < 1e-12);
          const auto state = [&](const Vector3d& p) {
            BRepClass3d_SolidClassifier inside(solids[model.faces()[FaceId(f)].solid],
                                               gp_Pnt(p.x(), p.y(), p.z()), 1e-9);
            return inside.State();
          };
          CHECK(state(x + 1e-3 * n) == TopAbs_OUT);
          CHECK(state(x - 1e-3 * n) == TopAbs_IN);
        }
        CHECK(checked > 0);  // of 8, by the part of the parameters that the face covers
      }
    }
  }
}

TEST_CASE("derivatives agree with differences of points", "[cad][brep]") {
  constexpr double kStep = 1e-5;
  for (const std::string name : {"bracket", "torus", "cone_frustum", "blade", "sphere"}) {
    DYNAMIC_SECTION(name) {
      const CadModel model = to_model(shape(name));
      for (const FaceId f : model.faces().ids()) {
        const CadFace& face = model.faces()[f];
        const Vector2d uv = face.lower + Vector2d(0.37, 0.59).cwiseProduct(face.upper - face.lower);
        const Vector2d h = kStep * (face.upper - face.lower);
        const auto at = [&](double a, double b) {
          return model.evaluate(f, uv + Vector2d(a, b).cwiseProduct(h));
        };
        const SurfaceCurvature s = model.evaluate_second(f, uv);
        const double size = face.upper.x() - face.lower.x();
        const double size_v = face.upper.y() - face.lower.y();
        // Central differences leave an error of the square of the step, in model units.
        const double tolerance = 1e-6 * model.diagonal();
        CHECK((at(0, 0).du - s.first.du).norm() < 1e-12 * s.first.du.norm());
        CHECK(((at(1, 0).point - at(-1, 0).point) / (2 * kStep) - size * s.first.du).norm() <
              tolerance);
        CHECK(((at(0, 1).point - at(0, -1).point) / (2 * kStep) - size_v * s.first.dv).norm() <
              tolerance);
        CHECK((size * (at(1, 0).du - at(-1, 0).du) / (2 * kStep) - size * size * s.duu).norm() <
              tolerance);
        CHECK((size * (at(0, 1).du - at(0, -1).du) / (2 * kStep) - size * size_v * s.duv).norm() <
              tolerance);
        CHECK(
            (size_v * (at(0, 1).dv - at(0, -1).dv) / (2 * kStep) - size_v * size_v * s.dvv).norm() <
            tolerance);
      }
    }
  }
}

TEST_CASE("is_inside agrees with OCCT's classifier", "[cad][brep]") {
  for (const auto& name : kShapes) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape part = shape(name);
      const CadModel model = to_model(part);
      const FaceOracle oracle(part);
      int compared = 0, different = 0;
      for (int f = 0; f < oracle.face_count(); ++f)
        for (const Vector2d& uv : random_parameters(model.faces()[FaceId(f)], 150, 7u + f)) {
          if (distance_to_wires(model, f, uv) < 1e-5) continue;
          const Vector2d wrapped = model.into_domain(FaceId(f), uv);
          ++compared;
          different += model.is_inside(FaceId(f), uv) != (oracle.side(f, wrapped) == 1);
        }
      CHECK(different == 0);
      CHECK(compared > 50 * oracle.face_count());
    }
  }
}

TEST_CASE("is_inside follows curved wires beyond their chords", "[cad][brep]") {
  // The first layer at a pipe's wall is thousands of times thinner than the pipe.
  for (const auto& name : kShapes) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape part = shape(name);
      const CadModel model = to_model(part);
      const FaceOracle oracle(part);
      int compared = 0, different = 0;
      for (const CoedgeId c : model.coedges().ids()) {
        const int f = model.coedges()[c].face;
        const CadEdge& e = model.edges()[model.coedges()[c].edge];
        const Vector2d size = model.faces()[FaceId(f)].upper - model.faces()[FaceId(f)].lower;
        const auto at = [&](double share) -> Vector2d {
          return model.pcurve(c, e.first + (e.last - e.first) * share).cwiseQuotient(size);
        };
        for (int i = 0; i < 50; ++i) {
          const double share = (i + 0.37) / 50;
          const Vector2d along = (at(share + 1e-6) - at(share - 1e-6)).normalized();
          for (const double off : {-1e-3, -1e-4, -1e-5, 1e-5, 1e-4, 1e-3}) {
            const Vector2d uv =
                (at(share) + off * Vector2d(-along.y(), along.x())).cwiseProduct(size);
            const CadFace& face = model.faces()[FaceId(f)];
            if ((uv - face.lower).cwiseMin(face.upper - uv).minCoeff() < 2e-6 * size.maxCoeff())
              continue;  // beyond a seam or a pole
            ++compared;
            different += model.is_inside(FaceId(f), uv) != (oracle.side(f, uv) == 1);
          }
        }
      }
      CHECK(different == 0);
      CHECK(compared > 0);
    }
  }
}

TEST_CASE("a strip that winds round its cylinder several times keeps its turns", "[cad][brep]") {
  constexpr double kRadius = 10, kPitch = 3, kWidth = 1, kTurns = 4;
  const gp_Ax3 axes(gp_Pnt(1, 2, 3), gp_Dir(0, 0, 1));
  const Handle(Geom_Surface) cylinder = new Geom_CylindricalSurface(axes, kRadius);
  BRepBuilderAPI_MakeWire wire;
  const double end = 2 * pi * kTurns, rise = kPitch * kTurns;
  const gp_Pnt2d corners[] = {{0, 0}, {end, rise}, {end, rise + kWidth}, {0, kWidth}};
  for (int i = 0; i < 4; ++i)
    wire.Add(BRepBuilderAPI_MakeEdge(GCE2d_MakeSegment(corners[i], corners[(i + 1) % 4]).Value(),
                                     cylinder));
  TopoDS_Shape strip = BRepBuilderAPI_MakeFace(cylinder, wire.Wire());
  BRepLib::BuildCurves3d(strip);
  const CadModel model = through_step(strip);
  REQUIRE(model.faces().size() == 1);
  const CadFace& face = model.faces()[FaceId(0)];
  REQUIRE(face.upper[0] - face.lower[0] > 0.99 * end);
  int missed = 0;
  for (int i = 1; i < 400; ++i)
    for (const double across : {0.02, 0.5, 0.98}) {
      const double turn = end * i / 400, z = kPitch * turn / (2 * pi) + across * kWidth;
      const Vector3d x =
          Vector3d(1, 2, 3) + Vector3d(kRadius * std::cos(turn), kRadius * std::sin(turn), z);
      const Vector2d seed(face.lower[0] + (face.upper[0] - face.lower[0]) * i / 400, z + 0.01);
      const FaceFoot foot = project_on_face(model, FaceId(0), x, seed);
      missed += foot.distance > 1e-9 || !model.is_inside(FaceId(0), foot.uv) ||
                std::abs(foot.uv[1] - z) > 1e-9;
    }
  CHECK(missed == 0);
}

TEST_CASE("a seam that wavers within its tolerance leaves no gap", "[cad][brep]") {
  // As STEP reading leaves seams whose pcurves it has to find: here a wave of 1e-5 rad.
  constexpr double kRadius = 10, kHeight = 20, kWave = 1e-5;
  const TopoDS_Shape cylinder = BRepPrimAPI_MakeCylinder(kRadius, kHeight).Shape();
  for (TopExp_Explorer faces(cylinder, TopAbs_FACE); faces.More(); faces.Next()) {
    const TopoDS_Face face = TopoDS::Face(faces.Current());
    for (TopExp_Explorer edges(face, TopAbs_EDGE); edges.More(); edges.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(edges.Current());
      if (!BRep_Tool::IsClosed(edge, face)) continue;
      const auto waving = [&](double u) -> Handle(Geom2d_Curve) {
        TColgp_Array1OfPnt2d poles(1, 81);
        for (int i = 0; i <= 80; ++i)
          poles.SetValue(i + 1, gp_Pnt2d(u + (i % 2 ? kWave : -kWave), kHeight * i / 80.0));
        return Handle(Geom2d_Curve)(
            Geom2dAPI_PointsToBSpline(poles, 1, 1, GeomAbs_C0, 1e-9).Curve());
      };
      BRep_Builder().UpdateEdge(edge, waving(2 * pi), waving(0), face, kRadius * kWave);
      BRep_Builder().Range(edge, face, 0, 1);
      break;
    }
  }
  const CadModel model = to_model(cylinder);
  int mantle = 0;
  while (model.faces()[FaceId(mantle)].period.isZero(0)) ++mantle;
  REQUIRE(model.faces()[FaceId(mantle)].upper[0] - model.faces()[FaceId(mantle)].lower[0] >
          2 * pi + 1.5 * kWave);
  int outside = 0, beyond = 0;
  for (int i = 0; i < 1000; ++i)
    for (const double u : {-1.7, -0.9, -0.3, 0.0, 0.2, 0.8, 1.9}) {
      const double v = kHeight * (i + 0.5) / 1000;
      for (const double turn : {0.0, 2 * pi})
        outside += !model.is_inside(FaceId(mantle), {turn + u * kWave, v});
      beyond += model.is_inside(FaceId(mantle), {u * kWave, v + kHeight});
    }
  CHECK(outside == 0);
  CHECK(beyond == 0);
}

TEST_CASE("crossings bound the inside along lines of constant v", "[cad][brep]") {
  for (const std::string name : {"plate_12_holes", "bracket", "blade", "cylinder"}) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape part = shape(name);
      const CadModel model = to_model(part);
      const FaceOracle oracle(part);
      for (int f = 0; f < oracle.face_count(); ++f) {
        const CadFace& face = model.faces()[FaceId(f)];
        for (const double part_of : {0.137, 0.481, 0.873}) {
          const double v = face.lower.y() + part_of * (face.upper.y() - face.lower.y());
          const auto u = model.crossings(FaceId(f), v);
          REQUIRE(u.size() % 2 == 0);
          REQUIRE(!u.empty());
          CHECK(std::is_sorted(u.begin(), u.end()));
          for (std::size_t i = 0; i + 1 < u.size(); ++i) {
            if (u[i + 1] - u[i] < 1e-2 * (face.upper.x() - face.lower.x())) continue;
            const Vector2d middle(0.5 * (u[i] + u[i + 1]), v);
            CHECK((oracle.side(f, middle) == 1) == (i % 2 == 0));
          }
        }
      }
    }
  }
}

TEST_CASE("parameters wrap into the domain of periodic faces", "[cad][brep]") {
  const CadModel torus = to_model(shape("torus"));
  const CadFace& face = torus.faces()[FaceId(0)];
  const Vector2d uv = face.lower + Vector2d(0.3, 0.8).cwiseProduct(face.upper - face.lower);
  for (const int i : {-3, -1, 0, 1, 2})
    for (const int j : {-2, 0, 1})
      CHECK((torus.into_domain(FaceId(0), uv + 2 * pi * Vector2d(i, j)) - uv).norm() < 1e-9);
}

TEST_CASE("vertices that only end a seam are no corners", "[cad][brep][skeleton]") {
  const CadModel shaft = to_model(shape("stepped_shaft"));
  CHECK(shaft.skeleton().corners.empty());
  for (const auto& curve : shaft.skeleton().curves) CHECK(curve.is_closed());
  // Rings of the outline: every corner of the half profile off the axis turns into a circle.
  CHECK(shaft.skeleton().curves.size() == 7);
  const CadModel bracket = to_model(shape("bracket"));
  for (const EdgeId e : bracket.edges().ids())
    CHECK((bracket.skeleton().curve_of_edge[e] >= 0) == bracket.edges()[e].is_physical());
}
