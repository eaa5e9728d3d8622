#include "cad/motion_guess.h"

#include <Eigen/Dense>
#include <map>
#include <memory>
#include <optional>

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr double kTurn = 0.3;        // radians
constexpr double kThin = 1e-4;       // of a pattern's size
constexpr std::size_t kPattern = 3;  // entities that have a spread

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

// Mean and scatter of some entities' centres.
struct Spread {
  Vector3d mean = Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();

  Spread(const MatchSide& side, const std::vector<int>& members) {
    for (const int n : members) mean += side.features[n].centre / double(members.size());
    for (const int n : members) {
      const Vector3d way = side.features[n].centre - mean;
      scatter += way * way.transpose() / double(members.size());
    }
  }
};

// The linear map that carries one scatter to the other with the least motion, that between two
// normal distributions (Dowson and Landau, The Frechet distance between multivariate normal
// distributions, 1982).
Eigen::Matrix3d least_stretch(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  using Solver = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>;
  const Eigen::Matrix3d thickness =  // of what lies in a plane or on a line
      kThin * kThin * (from.trace() + to.trace()) * Eigen::Matrix3d::Identity();
  const Solver a(from + thickness);
  const Eigen::Matrix3d root = a.operatorSqrt(), inverse = a.operatorInverseSqrt();
  return inverse * Solver(root * (to + thickness) * root).operatorSqrt() * inverse;
}

// Entities that the topology can't tell apart, such as the holes of a pattern, go where their mean
// and their spread go: the pitch of a pattern changes, and no row gets ahead of another.
std::optional<NamedGuess> by_spread(const MatchSide& base, const MatchSide& variant,
                                    const ColourRefinement& colours) {
  struct Map {
    Vector3d from, to;
    Eigen::Matrix3d stretch;
  };
  bool has_pattern = false;
  std::vector<Map> maps;
  std::vector<int> map_of;  // of the rows of `centres`
  std::vector<Vector3d> centres;
  for (const ColourClass& members : classes_of(colours, base.graph.entity_count())) {
    const bool is_pattern = members.base.size() >= kPattern;
    has_pattern |= is_pattern;
    const Spread from(base, members.base), to(variant, members.variant);
    maps.push_back({from.mean, to.mean,
                    is_pattern ? least_stretch(from.scatter, to.scatter)
                               : Eigen::Matrix3d(Eigen::Matrix3d::Identity())});
    for (const int n : members.base) {
      centres.push_back(base.features[n].centre);
      map_of.push_back(static_cast<int>(maps.size()) - 1);
    }
  }
  if (!has_pattern) return std::nullopt;
  RowMatrix rows(std::ssize(centres), 3);
  for (Index i = 0; i < rows.rows(); ++i) rows.row(i) = centres[i].transpose();
  const auto tree = std::make_shared<const KdTree>(rows);
  return NamedGuess{{[=](const Vector3d& x) -> Vector3d {
                       const Map& map = maps[map_of[tree->nearest(x.data(), 1)[0].index]];
                       return map.to + map.stretch * (x - map.from);
                     },
                     1},
                    kInPlace};
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
  if (auto guess = by_spread(base, variant, colours)) all.push_back(std::move(*guess));
  for (const auto& s : by_principal_axes(base, variant)) all.push_back(guess_by(s, kTurned));
  return all;
}

}  // namespace cadmorph
