#include "surface/round_face.h"

#include <Eigen/Geometry>
#include <numbers>

#include "cad/alignment.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

constexpr double kSameFrame = 1e-6;  // radians: far above the rounding of a file's directions

/// A sphere (major radius 0) or a torus.
struct RoundSurface {
  Vector3d centre, axis, start;  ///< `start`: direction of u = 0
  double major = 0, minor = 0;
};

RoundSurface round_surface(const CadModel& model, FaceId face) {
  const auto at = [&](double u, double v) -> Vector3d {
    return model.evaluate(face, {u, v}).point;
  };
  RoundSurface s;
  s.centre = 0.5 * (at(0, 0) + at(pi, 0));
  s.start = (at(0, 0) - s.centre).normalized();
  const Vector3d tube = model.faces()[face].type == SurfaceType::Torus
                            ? Vector3d(0.5 * (at(0, 0) + at(0, pi)))
                            : s.centre;
  s.major = (tube - s.centre).norm();
  s.minor = (at(0, 0) - tube).norm();
  s.axis = (at(0, 0.5 * pi) - tube).normalized();
  return s;
}

bool runs_alike(const RoundSurface& a, const RoundSurface& b, const Eigen::Matrix3d& turn) {
  return (turn * a.axis - b.axis).norm() < kSameFrame &&
         (a.major == 0 || (turn * a.start - b.start).norm() < kSameFrame);
}

// The rotation about the centres that carries marks onto their images; least squares.
Eigen::Matrix3d turn_of_marks(const RoundSurface& base, const RoundSurface& variant,
                              const std::vector<Vector3d>& from, const std::vector<Vector3d>& to) {
  std::vector<Vector3d> before, after;
  for (std::size_t i = 0; i < from.size(); ++i)
    for (const double side : {1.0, -1.0}) {  // so that the centres are the means
      before.push_back(side * (from[i] - base.centre));
      after.push_back(side * (to[i] - variant.centre));
    }
  return fit_similarity(before, after).rotation;
}

}  // namespace

std::optional<FaceCarry> carry_round_face(const ModelPair& pair, FaceId base_face,
                                          const std::vector<Vector3d>& marks,
                                          const std::vector<Vector3d>& marked) {
  const FaceId variant_face = pair.match.faces[base_face];
  const SurfaceType type = pair.base.faces()[base_face].type;
  if (type != pair.variant.faces()[variant_face].type ||
      (type != SurfaceType::Sphere && type != SurfaceType::Torus))
    return std::nullopt;
  const RoundSurface from = round_surface(pair.base, base_face),
                     to = round_surface(pair.variant, variant_face);
  Eigen::Matrix3d turn = pair.match.alignment.rotation;
  if (runs_alike(from, to, turn)) return std::nullopt;
  if (!marks.empty()) turn = turn_of_marks(from, to, marks, marked);
  if (type == SurfaceType::Sphere)
    return [=](const Vector3d& x) -> Vector3d {
      return to.centre + to.minor / from.minor * (turn * (x - from.centre));
    };
  const Vector3d axis = (turn * from.axis).dot(to.axis) < 0 ? Vector3d(-to.axis) : to.axis;
  return [=](const Vector3d& x) -> Vector3d {
    const Vector3d way = x - from.centre;
    const double height = way.dot(from.axis);
    const Vector3d out = way - height * from.axis;
    const Vector3d turned = turn * out;
    const Vector3d along = (turned - turned.dot(axis) * axis).normalized();
    const double stretch = to.minor / from.minor;
    return to.centre + (to.major + stretch * (out.norm() - from.major)) * along +
           stretch * height * axis;
  };
}

}  // namespace cadmorph
