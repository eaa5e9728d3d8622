#include "cad/projector.h"

#include <BRepBuilderAPI_NurbsConvert.hxx>
#include <catch2/catch.hpp>
#include <random>

#include "cad/face_sampler.h"
#include "cad_variants.h"
#include "warped_shape.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

TopoDS_Shape shape(const std::string& name) {
  return read_shape(model_file("shapes/" + name + ".step"));
}

/// Points off a face by up to `reach` along its normal, above random places inside its wires.
struct Probe {
  Vector2d uv;
  Vector3d x;
  double offset;
};

std::vector<Probe> probes(const CadModel& model, const FaceOracle& oracle, int face, double reach) {
  std::mt19937 random(17u + static_cast<unsigned>(face));
  std::uniform_real_distribution<double> unit(0, 1);
  const CadFace& f = model.faces()[FaceId(face)];
  std::vector<Probe> all;
  for (int tries = 0; all.size() < 20 && tries < 400; ++tries) {
    const double a = unit(random), b = unit(random), offset = reach * (2 * unit(random) - 1);
    const Vector2d uv = f.lower + Vector2d(a, b).cwiseProduct(f.upper - f.lower);
    const Vector3d n = model.normal(FaceId(face), uv);
    if (oracle.side(face, uv) != 1 || n.isZero(0)) continue;
    all.push_back({uv, model.evaluate(FaceId(face), uv).point + offset * n, offset});
  }
  REQUIRE(all.size() == 20);
  return all;
}

}  // namespace

TEST_CASE("projection from a near seed finds the foot that OCCT's global search finds",
          "[cad][projector]") {
  for (const std::string name : {"bracket", "torus", "sphere", "cone", "cylinder", "blade"})
    for (const bool is_nurbs : {false, true}) {
      DYNAMIC_SECTION(name << (is_nurbs ? " as NURBS" : "")) {
        const TopoDS_Shape part = is_nurbs ? to_nurbs(shape(name)) : shape(name);
        const CadModel model = to_model(part);
        const FaceOracle oracle(part);
        for (int f = 0; f < oracle.face_count(); ++f) {
          const CadFace& face = model.faces()[FaceId(f)];
          for (const Probe& p : probes(model, oracle, f, 0.01 * model.diagonal())) {
            const Vector2d seed =
                p.uv + Vector2d(0.02, -0.015).cwiseProduct(face.upper - face.lower);
            const FaceFoot foot = project_on_face(model, FaceId(f), p.x, seed);
            const Vector3d known = oracle.point(f, oracle.parameters(f, p.x));
            CHECK(foot.distance <= (known - p.x).norm() + 1e-9 * model.diagonal());
            CHECK((model.evaluate(FaceId(f), foot.uv).point - foot.point).norm() <
                  1e-12 * model.diagonal());
            CHECK(std::abs((foot.point - p.x).norm() - foot.distance) < 1e-12 * model.diagonal());
          }
        }
      }
    }
}

TEST_CASE("points on a face project onto themselves to rounding", "[cad][projector]") {
  for (const std::string name : {"bracket", "torus", "sphere", "cone", "blade"}) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape part = shape(name);
      const CadModel model = to_model(part);
      const FaceOracle oracle(part);
      for (int f = 0; f < oracle.face_count(); ++f)
        for (const Probe& p : probes(model, oracle, f, 0)) {
          const CadFace& face = model.faces()[FaceId(f)];
          const Vector2d seed = p.uv + Vector2d(-0.03, 0.01).cwiseProduct(face.upper - face.lower);
          CHECK(project_on_face(model, FaceId(f), p.x, seed).distance < 1e-10 * model.diagonal());
        }
    }
  }
}

TEST_CASE("a foot beyond the seam of a closed surface that is not periodic is found",
          "[cad][projector]") {
  const CadModel part = to_model(BRepBuilderAPI_NurbsConvert(shape("cylinder")).Shape());
  const CadModel twisted = to_model(warped(shape("cylinder"), [](const Vector3d& x) -> Vector3d {
    return {x.x() + 0.1 * x.y(), x.y(), x.z()};
  }));
  int closed = 0;
  for (const CadModel* model : {&part, &twisted})
    for (const FaceId f : model->faces().ids()) {
      const CadFace& face = model->faces()[f];
      if (face.period[0] <= 0) continue;
      ++closed;
      const double v = 0.4 * face.lower[1] + 0.6 * face.upper[1];
      for (const double part_of_period : {1e-4, 0.01, 0.1}) {
        const double step = part_of_period * face.period[0];
        const Vector2d left(face.lower[0] + step, v), right(face.upper[0] - step, v);
        for (const auto& [seed, at] : {std::pair(left, right), {right, left}}) {
          const FaceFoot foot = project_on_face(*model, f, model->evaluate(f, at).point, seed);
          CAPTURE(f, part_of_period);
          CHECK(foot.distance < 1e-12 * model->diagonal());
          CHECK((foot.uv - at).norm() < 1e-9 * face.period[0]);
        }
      }
    }
  CHECK(closed == 2);
}

TEST_CASE("the distance of a surface's point from the trimmed face is what OCCT measures",
          "[cad][projector]") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(-0.1, 1.1);
  for (const std::string name : {"plate_12_holes", "bracket", "cylinder"}) {
    const TopoDS_Shape part = shape(name);
    const CadModel model = to_model(part);
    const FaceOracle oracle(part);
    int outside = 0;
    for (const FaceId f : model.faces().ids())
      for (int i = 0; i < 20; ++i) {
        const CadFace& face = model.faces()[f];
        const Vector2d uv =
            face.lower + Vector2d(unit(random), unit(random)).cwiseProduct(face.upper - face.lower);
        const double distance = distance_to_trimmed(model, f, uv);
        const double expected = oracle.distance(f, model.evaluate(f, uv).point);
        CAPTURE(name, f, uv.transpose());
        CHECK(distance == Approx(expected).margin(1e-7));
        outside += distance > 0;
      }
    CHECK(outside > 20);
  }
}

TEST_CASE("global projection needs no seed and agrees with brute force", "[cad][projector]") {
  constexpr int kGrid = 150;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-0.2, 1.2);
  for (const std::string name : {"torus", "sphere", "blade", "cone_frustum"}) {
    DYNAMIC_SECTION(name) {
      const CadModel model = to_model(shape(name));
      for (const FaceId f : model.faces().ids()) {
        const CadFace& face = model.faces()[f];
        for (int i = 0; i < 15; ++i) {
          const double a = unit(random), b = unit(random), c = unit(random);
          const Vector3d x =
              model.lower() + Vector3d(a, b, c).cwiseProduct(model.upper() - model.lower());
          double least = 1e300;
          for (int j = 0; j <= kGrid; ++j)
            for (int k = 0; k <= kGrid; ++k) {
              const Vector2d uv = face.lower + Vector2d(double(j) / kGrid, double(k) / kGrid)
                                                   .cwiseProduct(face.upper - face.lower);
              least = std::min(least, (model.evaluate(f, uv).point - x).norm());
            }
          // The grid's best point is never nearer than the true foot in the same domain.
          CHECK(project_globally(model, f, x).distance <= least + 1e-9 * model.diagonal());
        }
      }
    }
  }
}

TEST_CASE("projection on an edge agrees with brute force and stays on the edge",
          "[cad][projector]") {
  constexpr int kSamples = 4000;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const std::string name : {"bracket", "blade", "cylinder"}) {
    DYNAMIC_SECTION(name) {
      const CadModel model = to_model(shape(name));
      for (const EdgeId edge : model.edges().ids()) {
        const CadEdge& e = model.edges()[edge];
        if (!e.is_physical()) continue;
        for (int i = 0; i < 10; ++i) {
          const double t = e.first + (e.last - e.first) * i / 9;
          const double a = unit(random), b = unit(random), c = unit(random);
          const Vector3d x =
              model.evaluate_edge(edge, t).point + 0.05 * e.length * Vector3d(a, b, c);
          std::pair<double, double> best{1e300, 0};
          for (int j = 0; j <= kSamples; ++j) {
            const double s = e.first + (e.last - e.first) * j / kSamples;
            best = std::min(best, {(model.evaluate_edge(edge, s).point - x).norm(), s});
          }
          const EdgeFoot foot = project_on_edge(model, edge, x, best.second);
          CHECK(foot.edge == edge);
          CHECK(foot.t >= e.first);
          CHECK(foot.t <= e.last);
          CHECK(foot.distance <= best.first + 1e-9 * model.diagonal());
          CHECK((model.evaluate_edge(edge, foot.t).point - foot.point).norm() < 1e-12);
        }
      }
    }
  }
}

TEST_CASE("samples lie inside their faces and leave no gap above their spacing", "[cad][sampler]") {
  const std::pair<const char*, int> shapes[] = {
      {"plate_12_holes", 12}, {"bracket", 5}, {"torus", 1}, {"sphere", 1}, {"blade", 2}};
  for (const auto& [name, expected_curved] : shapes) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape part = shape(name);
      const CadModel model = to_model(part);
      const FaceOracle oracle(part);
      constexpr Index kCount = 5000;
      const FaceSamples samples = sample_faces(model, kCount);
      REQUIRE(samples.points.rows() == std::ssize(samples.uv));
      CHECK(samples.points.rows() > kCount / 4);
      CHECK(samples.points.rows() < kCount * 4);
      std::vector<int> count(model.faces().size(), 0);
      double off = 0, outside = 0;
      for (Index i = 0; i < samples.points.rows(); ++i) {
        const int f = samples.face[i];
        ++count[f];
        const Vector3d x = samples.points.row(i);
        off = std::max(off, (model.evaluate(FaceId(f), samples.uv[i]).point - x).norm());
        if (i % 7 == 0) outside = std::max(outside, oracle.distance(f, x));
      }
      CHECK(off < 1e-12 * model.diagonal());
      // Samples along curved wires sit on pcurves, which leave edges by their tolerance at most.
      double tolerance = 1e-6;
      for (const auto& e : model.edges()) tolerance = std::max(tolerance, e.tolerance);
      CHECK(outside <= tolerance);

      int curved = 0;
      for (int f = 0; f < oracle.face_count(); ++f) {
        const bool is_curved = model.faces()[FaceId(f)].type != SurfaceType::Plane;
        curved += is_curved;
        if (is_curved) CHECK(count[f] >= 25);
        for (const Probe& p : probes(model, oracle, f, 0)) {
          double least = 1e300;
          for (Index i = 0; i < samples.points.rows(); ++i)
            if (samples.face[i] == f)
              least = std::min(least, (samples.points.row(i).transpose() - p.x).norm());
          CHECK(least <= samples.spacing);
        }
      }
      CHECK(curved == expected_curved);
    }
  }
}

// From a seed near the pole Newton's method goes beyond it as well as back.
TEST_CASE("A foot near a pole lies within the face's parameters", "[cad][projector]") {
  for (const bool is_nurbs : {false, true}) {
    const CadModel model = to_model(is_nurbs ? to_nurbs(shape("sphere")) : shape("sphere"));
    const FaceId face(0);
    const CadFace& f = model.faces()[face];
    const int around = f.period[0] > 0 ? 0 : 1, along = 1 - around;
    for (const double end : {f.lower[along], f.upper[along]})
      for (int i = 0; i < 12; ++i)
        for (int j = 0; j < 12; ++j) {
          Vector2d at, seed;
          at[around] = f.lower[around] + (f.upper[around] - f.lower[around]) * i / 12;
          const double inward = (f.lower + f.upper)[along] / 2 - end;
          at[along] = end + 0.05 * inward;
          seed[around] = f.lower[around] + (f.upper[around] - f.lower[around]) * j / 12;
          seed[along] = end + 0.001 * inward;
          const FaceFoot foot = project_on_face(model, face, model.evaluate(face, at).point, seed);
          CHECK(foot.distance < 1e-10 * model.diagonal());
          CHECK((foot.uv.array() >= f.lower.array() - 1e-9).all());
          CHECK((foot.uv.array() <= f.upper.array() + 1e-9).all());
        }
  }
}
