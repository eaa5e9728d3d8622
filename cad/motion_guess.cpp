#include "cad/motion_guess.h"

#include <Eigen/Dense>
#include <map>

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr double kTurn = 0.3;  // radians

Eigen::Matrix3d principal_axes(const MatchSide& side, Vector3d& mean) {
  mean.setZero();
  double weight = 0;
  for (const auto& f : side.features) {
    mean += (f.size + 1e-12) * f.centre;
    weight += f.size + 1e-12;
  }
  mean /= weight;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& f : side.features)
    scatter += (f.size + 1e-12) * (f.centre - mean) * (f.centre - mean).transpose();
  Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors();
  if (axes.determinant() < 0) axes.col(2) *= -1;
  return axes;
}

// The four proper rotations that carry principal axes onto each other.
std::vector<Similarity> by_principal_axes(const MatchSide& base, const MatchSide& variant) {
  Vector3d a, b;
  const Eigen::Matrix3d from = principal_axes(base, a), to = principal_axes(variant, b);
  std::vector<Similarity> all;
  for (const auto& signs :
       {Vector3d(1, 1, 1), Vector3d(1, -1, -1), Vector3d(-1, 1, -1), Vector3d(-1, -1, 1)}) {
    Similarity s;
    s.rotation = to * signs.asDiagonal() * from.transpose();
    s.scale = variant.model.diagonal() / base.model.diagonal();
    s.translation = b - s.scale * (s.rotation * a);
    all.push_back(s);
  }
  return all;
}

// Centroids of the colours: a colour that several entities share still has one.
void colour_centroids(const MatchSide& base, const MatchSide& variant,
                      const ColourRefinement& colours, std::vector<Vector3d>& from,
                      std::vector<Vector3d>& to) {
  struct Centroids {
    Vector3d base = Vector3d::Zero(), variant = Vector3d::Zero();
    int count = 0;
  };
  std::map<int, Centroids> all;
  for (int n = 0; n < base.graph.entity_count(); ++n) {
    Centroids& c = all[colours.base_colours()[n]];
    c.base += base.features[n].centre;
    ++c.count;
    all[colours.variant_colours()[n]].variant += variant.features[n].centre;
  }
  for (const auto& [colour, c] : all) {
    from.push_back(c.base / c.count);
    to.push_back(c.variant / c.count);
  }
}

NamedGuess guess_by(const Similarity& s, const char* how) {
  return {{[s](const Vector3d& x) { return s(x); }, s.scale}, how};
}

}  // namespace

Similarity align_bounds(const CadModel& base, const CadModel& variant) {
  Similarity s;
  s.scale = variant.diagonal() / base.diagonal();
  s.translation =
      0.5 * (variant.lower() + variant.upper()) - s.scale * 0.5 * (base.lower() + base.upper());
  return s;
}

std::vector<NamedGuess> first_guesses(const MatchSide& base, const MatchSide& variant,
                                      const ColourRefinement& colours) {
  std::vector<NamedGuess> all{guess_by({}, kInPlace),
                              guess_by(align_bounds(base.model, variant.model), kInPlace)};
  std::vector<Vector3d> from, to;
  colour_centroids(base, variant, colours, from, to);
  if (from.size() >= 3) {
    const Similarity s = fit_similarity(from, to);
    const char* how = Eigen::AngleAxisd(s.rotation).angle() > kTurn ? kTurned : kInPlace;
    all.push_back({{fit_affine(from, to, s), s.scale}, how});
    all.push_back(guess_by(s, kTurned));
  }
  for (const auto& s : by_principal_axes(base, variant)) all.push_back(guess_by(s, kTurned));
  return all;
}

}  // namespace cadmorph
