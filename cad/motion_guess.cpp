#include "cad/motion_guess.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <optional>

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// Radians: a guess that turns more is called a turn in reports. Nothing else depends on it.
constexpr double kTurn = 0.3;
// Of a pattern's size, given to flat patterns and rows as their thickness, so that their scatter
// has an inverse: far above its rounding (1e-8), far below any pitch.
constexpr double kThin = 1e-4;
constexpr double kExact = 1e-9;      // of a pattern's size: above rounding, below what files keep
constexpr std::size_t kPattern = 3;  // entities that have a spread
// Turns of a pattern: members whose image is sought and turns tried at most. With three axes and
// kRounds these are 50,000 searches for a nearest member, however large the pattern is.
constexpr std::size_t kMostAsked = 64, kMostTurns = 64;
// A larger turn has to lay the members this much nearer to the variant's than a smaller one: turns
// by whole pitches fit alike, but for what else changed. Turns below kNoTurn, radians, are none: in
// a ring of up to 100 members each is clearly nearest to its own without (kClearMargin). Distances
// of two members from the axis differ by less than the part kSameLever: pitches change by less.
// Half and double of kNoTurn and kSameLever leave all known pairs as they are.
constexpr double kNearer = 0.9, kNoTurn = 0.02, kSameLever = 0.3;
// Of fitting a turn to the nearest members: it starts where one member lies in the direction of
// another, so that few change their partners.
constexpr int kRounds = 3;

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

// The turn of a pattern about one of its principal axes that lays it onto the variant's: the
// smallest of those that do so equally well.
class PatternTurn {
 public:
  PatternTurn(const MatchSide& base, const MatchSide& variant, const ColourClass& members)
      : base_(base),
        variant_(variant),
        members_(members),
        from_(base, members.base),
        to_(variant, members.variant),
        nearest_(variant, members.variant) {
    const std::size_t step = 1 + members.base.size() / kMostAsked;
    for (std::size_t i = 0; i < members.base.size(); i += step) asked_.push_back(members.base[i]);
  }

  Eigen::AngleAxisd find() const {
    // Turns that lay it exactly fit equally well, whatever their rounding.
    const double exact = kExact * std::sqrt(from_.scatter.trace());
    Eigen::AngleAxisd best(0, Vector3d::UnitZ());
    double least = std::max(exact, distance(best));
    const Eigen::Matrix3d axes =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(from_.scatter).eigenvectors();
    for (int a = 0; a < 3; ++a)
      for (const double angle : angles(axes.col(a))) {
        const Eigen::AngleAxisd turn = fitted({angle, axes.col(a)});
        const double off = std::max(exact, distance(turn));
        const bool is_farther = std::abs(turn.angle()) > std::abs(best.angle());
        if (off >= (is_farther ? kNearer : 1 / kNearer) * least) continue;
        best = turn;
        least = std::min(least, off);
      }
    return best;
  }

 private:
  // Those that lay the member farthest from the axis on others, the smallest first.
  std::vector<double> angles(const Vector3d& axis) const {
    const auto off_axis = [&](const Vector3d& way) -> Vector3d {
      return way - axis.dot(way) * axis;
    };
    const auto way_of = [&](int n) { return off_axis(base_.features[n].centre - from_.mean); };
    const int farthest =
        *std::ranges::max_element(asked_, {}, [&](int n) { return way_of(n).squaredNorm(); });
    const Vector3d lever = way_of(farthest);
    std::vector<double> result;
    for (const int n : members_.variant) {
      const Vector3d other = off_axis(variant_.features[n].centre - to_.mean);
      if (std::abs(other.norm() - lever.norm()) > kSameLever * lever.norm()) continue;
      result.push_back(std::atan2(axis.dot(lever.cross(other)), lever.dot(other)));
    }
    std::ranges::sort(result, {}, [](double angle) { return std::abs(angle); });
    if (result.size() > kMostTurns) result.resize(kMostTurns);
    return result;
  }

  // The member of the variant nearest to where the turn takes one, seen from the mean.
  std::pair<double, Vector3d> nearest(int n, const Eigen::AngleAxisd& turn) const {
    const EntityFeature& feature = base_.features[n];
    const Vector3d at = to_.mean + turn * (feature.centre - from_.mean);
    const auto [square, node] = nearest_.find(feature, at, 1, 1).front();
    return {square, variant_.features[node].centre - to_.mean};
  }

  double distance(const Eigen::AngleAxisd& turn) const {
    double sum = 0;
    for (const int n : asked_) sum += nearest(n, turn).first;
    return std::sqrt(sum / double(asked_.size()));
  }

  Eigen::AngleAxisd fitted(Eigen::AngleAxisd turn) const {
    for (int round = 0; round < kRounds; ++round) {
      double along = 0, across = 0;
      for (const int n : asked_) {
        const Vector3d way = turn * (base_.features[n].centre - from_.mean);
        const Vector3d image = nearest(n, turn).second;
        const double axial = turn.axis().dot(way);
        along += way.dot(image) - axial * turn.axis().dot(image);
        across += turn.axis().dot(way.cross(image));
      }
      turn.angle() += std::atan2(across, along);
    }
    turn.angle() = std::remainder(turn.angle(), 2 * std::numbers::pi);
    return turn;
  }

  const MatchSide &base_, &variant_;
  const ColourClass& members_;
  Spread from_, to_;
  NearestMembers nearest_;
  std::vector<int> asked_;
};

// Entities that the topology can't tell apart, such as the holes of a pattern, go where their mean
// and their spread go: the pitch of a pattern changes, and no row gets ahead of another. `turns`:
// after a turn of their own; nothing if none turns.
std::optional<NamedGuess> by_spread(const MatchSide& base, const MatchSide& variant,
                                    const ColourRefinement& colours, bool turns) {
  struct Map {
    Vector3d from, to;
    Eigen::Matrix3d linear;
  };
  bool has_pattern = false, has_turn = false;
  std::vector<Map> maps;
  std::vector<int> map_of;  // of the rows of `centres`
  std::vector<Vector3d> centres;
  for (const ColourClass& members : classes_of(colours, base.graph.entity_count())) {
    const bool is_pattern = members.base.size() >= kPattern;
    has_pattern |= is_pattern;
    const Spread from(base, members.base), to(variant, members.variant);
    Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
    if (is_pattern && turns) {
      const Eigen::AngleAxisd turn = PatternTurn(base, variant, members).find();
      has_turn |= std::abs(turn.angle()) > kNoTurn;
      map = turn.toRotationMatrix();
    }
    if (is_pattern) map = least_stretch(map * from.scatter * map.transpose(), to.scatter) * map;
    maps.push_back({from.mean, to.mean, map});
    for (const int n : members.base) {
      centres.push_back(base.features[n].centre);
      map_of.push_back(static_cast<int>(maps.size()) - 1);
    }
  }
  if (!has_pattern || has_turn != turns) return std::nullopt;
  RowMatrix rows(std::ssize(centres), 3);
  for (Index i = 0; i < rows.rows(); ++i) rows.row(i) = centres[i].transpose();
  const auto tree = std::make_shared<const KdTree>(rows);
  return NamedGuess{{[=](const Vector3d& x) -> Vector3d {
                       const Map& map = maps[map_of[tree->nearest(x.data(), 1)[0].index]];
                       return map.to + map.linear * (x - map.from);
                     },
                     1},
                    turns ? kTurned : kInPlace};
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
  for (const bool turns : {false, true})
    if (auto guess = by_spread(base, variant, colours, turns)) all.push_back(std::move(*guess));
  for (const auto& s : by_principal_axes(base, variant)) all.push_back(guess_by(s, kTurned));
  return all;
}

}  // namespace cadmorph
