#include "surface/periodic_sides.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/plane_mesh.h"
#include "surface/free_patches.h"

namespace cadmorph {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

// Of the shortest mesh edge at a node: coordinates of six digits are as exact, and no other node
// is as near.
constexpr double kOfEdge = 0.01;
// Nodes lie on a line that are off it by less than this part of their extent: as for planes
// (kSamePlane), above the digits of single precision.
constexpr double kOnLine = 1e-6;
// Where the period is only guessed from two nodes, others may be off by so many times the
// tolerance: a tenth of a mesh edge, and still no other node is as near.
constexpr double kGuess = 10;
// A turn by less (radians) is a translation: a nanometre in a metre.
constexpr double kNoTurn = 1e-9;
// A side that closes round itself has no outward direction: its area vector is less than this part
// of its area, but for rounding none. That of half a cylinder is 0.64 of it.
constexpr double kLeastSide = 1e-2;

struct Side {
  std::string name;
  std::vector<RowId> rows;
  Points points = {};
  Vector3d centre = Vector3d::Zero(),
           outward = Vector3d::Zero();  ///< outward: of the mesh; zero where the side has none
};

bool is_on_line(const Points& points) {
  if (points.rows() < 3) return true;
  const Points off = points.rowwise() - points.colwise().mean();
  const Vector3d squares =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(off.transpose() * off).eigenvalues();
  return squares[1] <= kOnLine * kOnLine * squares[2];
}

// As far off the plane of a mesh as the points are apart; zero for other meshes.
Vector3d way_off(const Points& points, const Vector3d& normal) {
  if (points.rows() == 0) return Vector3d::Zero();
  const double size = (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  return (size > 0 ? size : 1) * normal;
}

// Points of a mesh in a plane tell of its normal, too, by copies of them beside the plane.
Points lifted(const Points& points, const Vector3d& off) {
  if (off.isZero(0)) return points;
  Points result(2 * points.rows(), 3);
  result << points, points.rowwise() + off.transpose();
  return result;
}

// The motion that fits best. Points on a line leave the turn about it open: they are shifted.
Isometry fit(const Points& from, const Points& to, const Vector3d& normal) {
  const Vector3d off = way_off(from, normal);
  const Points a = lifted(from, off), b = lifted(to, off);
  if (!is_on_line(a)) return fit_motion(a, b);
  const Vector3d shift = (to.colwise().mean() - from.colwise().mean()).transpose();
  return {Matrix3d::Identity(), shift};
}

// Sum of the outward area vectors of the side's facets, or where it has none (a line in a mesh of
// shells) of the ways from the middles of the facets beside it.
Vector3d outward_of(const SurfaceMesh& surface, const std::vector<RowId>& rows, bool is_flat) {
  IdVector<RowId, char> is_in(static_cast<std::size_t>(surface.points.rows()), 0);
  for (const RowId n : rows) is_in[n] = 1;
  Vector3d area = Vector3d::Zero(), beside = Vector3d::Zero();
  double whole_area = 0, whole_way = 0;
  for (const FacetId f : surface.facets.ids()) {
    const std::vector<RowId>& facet = surface.facets[f];
    const auto in = std::ranges::count_if(facet, [&](RowId n) { return is_in[n] != 0; });
    if (in == std::ssize(facet)) {
      const Vector3d own = area_vector(surface, surface.points, f);
      area += own;
      whole_area += own.norm();
    }
    const Vector3d middle = centroid(surface, surface.points, f);
    for (const RowId n : facet) {
      if (!is_in[n]) continue;
      const Vector3d way = surface.points.row(n).transpose() - middle;
      beside += way;
      whole_way += way.norm();
    }
  }
  const bool has_facets = whole_area > 0 && !is_flat;
  const Vector3d sum = has_facets ? area : beside;
  const double whole = has_facets ? whole_area : whole_way;
  return sum.norm() < kLeastSide * whole ? Vector3d::Zero() : Vector3d(sum.normalized());
}

Side make_side(const Mesh& mesh, const Boundary& boundary, const SurfaceMesh& surface,
               const std::string& name, bool is_flat) {
  Side side{.name = name, .rows = rows_of_group(mesh, boundary, name)};
  if (side.rows.empty())
    throw InvalidInputError("the group '" + name +
                            "' has no node on the surface of the mesh: it is no periodic side");
  side.points = surface.points(side.rows, Eigen::all);
  side.centre = side.points.colwise().mean();
  side.outward = outward_of(surface, side.rows, is_flat);
  return side;
}

// Columns: the directions of two vectors, made orthonormal, and their cross product.
Matrix3d frame(const Vector3d& a, const Vector3d& b) {
  Matrix3d result;
  result.col(0) = a.normalized();
  result.col(2) = a.cross(b).normalized();
  result.col(1) = result.col(2).cross(result.col(0));
  return result;
}

// The search for the motion that carries one side onto the other.
class PeriodSearch {
 public:
  PeriodSearch(const SurfaceMesh& surface, const Side& from, const Side& to, const Vector3d& normal)
      : from_(from), to_(to), normal_(normal), tree_(to.points) {
    const double least = plane_tolerance(surface);
    for (const Side* side : {&from, &to})
      for (const RowId n : side->rows)
        tolerance_of_.push_back(std::max(least, kOfEdge * surface.local_length[n]));
  }

  // Throws InvalidInputError where there is none.
  PeriodicSides find() const;

 private:
  double tolerance(std::size_t from, std::size_t to) const {
    return std::min(tolerance_of_[from], tolerance_of_[from_.rows.size() + to]);
  }
  std::vector<Isometry> guesses() const;
  std::vector<Matrix3d> turns() const;
  std::vector<std::size_t> at_distance(const Vector3d& from, double distance) const;
  bool looks_inward(const Matrix3d& turn) const;
  std::optional<std::vector<std::size_t>> images(const Isometry& map, double times) const;
  [[noreturn]] void refuse(const std::vector<Isometry>& guesses) const;

  const Side &from_, &to_;
  Vector3d normal_;
  KdTree tree_;
  std::vector<double> tolerance_of_;  // of the nodes of `from`, then of `to`
};

// Nodes of the second side that are so far from a place.
std::vector<std::size_t> PeriodSearch::at_distance(const Vector3d& from, double distance) const {
  std::vector<std::size_t> result;
  for (std::size_t k = 0; k < to_.rows.size(); ++k) {
    const double off = (to_.points.row(static_cast<Index>(k)).transpose() - from).norm() - distance;
    if (std::abs(off) <= 2 * tolerance_of_[from_.rows.size() + k]) result.push_back(k);
  }
  return result;
}

// Turns about the middles that carry two nodes of the first side, those that tell most, to two of
// the second; in a plane one node.
std::vector<Matrix3d> PeriodSearch::turns() const {
  const Points off = from_.points.rowwise() - from_.centre.transpose();
  Index far = 0, beside = 0;
  off.rowwise().norm().maxCoeff(&far);
  const Vector3d a = off.row(far);
  std::vector<Matrix3d> result;
  if (!normal_.isZero(0)) {
    for (const std::size_t k : at_distance(to_.centre, a.norm())) {
      const Vector3d b = to_.points.row(static_cast<Index>(k)).transpose() - to_.centre;
      result.push_back(frame(b, normal_) * frame(a, normal_).transpose());
    }
    return result;
  }
  if (is_on_line(from_.points)) return result;
  Eigen::VectorXd area(off.rows());
  for (Index i = 0; i < off.rows(); ++i) area[i] = a.cross(off.row(i).transpose()).norm();
  area.maxCoeff(&beside);
  const Vector3d second = off.row(beside);
  const auto seconds = at_distance(to_.centre, second.norm());
  for (const std::size_t k : at_distance(to_.centre, a.norm())) {
    const Vector3d place = to_.points.row(static_cast<Index>(k));
    for (const std::size_t l : seconds) {
      const Vector3d other = to_.points.row(static_cast<Index>(l));
      const double off_length = (other - place).norm() - (second - a).norm();
      if (k == l || std::abs(off_length) > 4 * tolerance_of_[from_.rows.size() + l]) continue;
      result.push_back(frame(place - to_.centre, other - to_.centre) *
                       frame(a, second).transpose());
    }
  }
  return result;
}

// Whether the mesh would lie on the same side of both.
bool PeriodSearch::looks_inward(const Matrix3d& turn) const {
  return (turn * from_.outward).dot(to_.outward) > 0;
}

// The likeliest first.
std::vector<Isometry> PeriodSearch::guesses() const {
  struct Guess {
    bool looks_inward;
    double cost;
    Isometry map;
  };
  const double size =
      (from_.points.rowwise() - from_.centre.transpose()).rowwise().norm().maxCoeff();
  std::vector<Guess> all;
  const auto add = [&](const Matrix3d& turn) {
    const Isometry map{turn, to_.centre - turn * from_.centre};
    const AngleAxisd about(turn);
    // A rotation shifts nothing along its axis.
    const double along =
        about.angle() > kNoTurn && size > 0 ? std::abs(about.axis().dot(map.shift)) / size : 0;
    all.push_back({looks_inward(turn), about.angle() + along, map});
  };
  add(Matrix3d::Identity());
  for (const Matrix3d& turn : turns()) add(turn);
  std::ranges::stable_sort(all, [](const Guess& a, const Guess& b) {
    return std::pair(a.looks_inward, a.cost) < std::pair(b.looks_inward, b.cost);
  });
  std::vector<Isometry> result;
  for (const Guess& guess : all) result.push_back(guess.map);
  return result;
}

// The image of each node within so many times its tolerance; nothing where one has none of its own.
std::optional<std::vector<std::size_t>> PeriodSearch::images(const Isometry& map,
                                                             double times) const {
  std::vector<char> is_taken(to_.rows.size(), 0);
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < from_.rows.size(); ++i) {
    const Vector3d x = map(from_.points.row(static_cast<Index>(i)));
    const Neighbour near = tree_.nearest(x.data(), 1).front();
    const auto image = static_cast<std::size_t>(near.index);
    const double most = times * tolerance(i, image);
    if (near.squared_distance > most * most || std::exchange(is_taken[image], 1)) return {};
    result.push_back(image);
  }
  return result;
}

std::string text_of(const Vector3d& x) {
  std::ostringstream text;
  text << x.x() << " " << x.y() << " " << x.z();
  return text.str();
}

// Names the node that the best of the guesses leaves farthest off.
void PeriodSearch::refuse(const std::vector<Isometry>& guesses) const {
  double least = std::numeric_limits<double>::infinity();
  Index worst_of_best = 0;
  for (const Isometry& map : guesses) {
    double most = 0;
    Index worst = 0;
    for (Index i = 0; i < from_.points.rows() && most < least; ++i) {
      const Vector3d x = map(from_.points.row(i));
      const double off = std::sqrt(tree_.nearest(x.data(), 1).front().squared_distance);
      if (off > most) worst = i;
      most = std::max(most, off);
    }
    if (most >= least) continue;
    least = most;
    worst_of_best = worst;
  }
  std::ostringstream text;
  text << "the groups '" << from_.name << "' and '" << to_.name
       << "' are no periodic sides: no translation or rotation carries each node of the one to a "
          "node of the other. With the best found the node of '"
       << from_.name << "' at " << text_of(from_.points.row(worst_of_best)) << " mm is " << least
       << " mm off the next one of '" << to_.name
       << "'. Were both sides meshed alike, and are these their names?";
  throw InvalidInputError(text.str());
}

PeriodicSides PeriodSearch::find() const {
  if (from_.rows.size() != to_.rows.size())
    throw InvalidInputError(
        "the groups '" + from_.name + "' and '" + to_.name + "' are no periodic sides: they have " +
        std::to_string(from_.rows.size()) + " and " + std::to_string(to_.rows.size()) +
        " nodes on the surface of the mesh. Does each name the whole of its side, and were both "
        "meshed alike?");
  const std::vector<Isometry> all = guesses();
  for (const Isometry& guess : all) {
    const auto rough = images(guess, kGuess);
    if (!rough) continue;
    const Isometry map = fit(from_.points, to_.points(*rough, Eigen::all), normal_);
    const auto found = images(map, 1);
    if (!found) continue;
    PeriodicSides result;
    result.first = from_.name;
    result.second = to_.name;
    result.normal = normal_;
    result.pair.from = from_.rows;
    result.pair.inner = from_.rows.size();
    result.pair.before = result.pair.after = map;
    for (std::size_t i = 0; i < found->size(); ++i) {
      result.pair.to.push_back(to_.rows[(*found)[i]]);
      result.tolerance.push_back(tolerance(i, (*found)[i]));
    }
    return result;
  }
  refuse(all);
}

// On the CAD: the kind of entity that both nodes lie on, or the one of the higher dimension.
CadDimension dimension_of(const Association& association, RowId from, RowId to) {
  const CadDimension a = association.dimension[from], b = association.dimension[to];
  return a == CadDimension::None || b == CadDimension::None ? CadDimension::None : std::max(a, b);
}

PeriodicSides find_pair(const MeshOnCad& on_cad, const std::string& first,
                        const std::string& second) {
  const auto& [mesh, boundary, surface, association, is_held] = on_cad;
  if (first == second)
    throw InvalidInputError("the group '" + first + "' of the mesh can't be a period from itself");
  const Vector3d normal = plane_normal(mesh, mesh.points);
  const Side from = make_side(mesh, boundary, surface, first, !normal.isZero(0));
  const Side to = make_side(mesh, boundary, surface, second, !normal.isZero(0));
  for (const Side* side : {&from, &to})
    for (const RowId n : side->rows)
      if (association.is_free[n])
        throw InvalidInputError(node_name(mesh, boundary.nodes[n]) + " of '" + side->name +
                                "' follows the volume, so the group can't be a periodic side");
  PeriodicSides sides = PeriodSearch(surface, from, to, normal).find();
  for (const RowId n : sides.pair.to)
    sides.is_given.push_back(is_held[n] || association.dimension[n] != CadDimension::None);
  return sides;
}

}  // namespace

std::vector<PeriodicSides> find_periodic_sides(
    const MeshOnCad& on_cad, const std::vector<std::pair<std::string, std::string>>& names) {
  std::vector<PeriodicSides> result;
  for (const auto& [first, second] : names) result.push_back(find_pair(on_cad, first, second));
  return result;
}

std::vector<PeriodicSides> find_sides_of_file(const MeshOnCad& on_cad,
                                              const GroupConstraints& constraints,
                                              std::vector<std::string>& remarks) {
  std::set<std::string> done;
  for (const auto* names : {&constraints.held, &constraints.rigid, &constraints.following})
    done.insert(names->begin(), names->end());
  for (const auto& [first, second] : constraints.periodic) done.insert({first, second});
  std::vector<PeriodicSides> result;
  for (const NodeGroup& group : on_cad.mesh.groups) {
    if (group.partner.empty() || done.contains(group.name) || done.contains(group.partner))
      continue;
    done.insert({group.name, group.partner});
    try {
      result.push_back(find_pair(on_cad, group.name, group.partner));
      result.back().is_by_file = true;
    } catch (const InvalidInputError& error) {
      remarks.push_back("the mesh file says that '" + group.name + "' and '" + group.partner +
                        "' are periodic, but they are not moved as such: " + error.what());
    }
  }
  return result;
}

ImagePair with_period_at(const PeriodicSides& sides, const SurfaceMesh& surface,
                         const Association& association, const Points& moved) {
  ImagePair pair = sides.pair;
  for (const CadDimension most : {CadDimension::Vertex, CadDimension::Edge, CadDimension::Face}) {
    std::vector<RowId> from, to;
    for (std::size_t i = 0; i < pair.from.size(); ++i) {
      const CadDimension own = dimension_of(association, pair.from[i], pair.to[i]);
      if (own == CadDimension::None || own > most) continue;
      from.push_back(pair.from[i]);
      to.push_back(pair.to[i]);
    }
    const Points at_from = moved(from, Eigen::all);
    if (is_on_line(lifted(at_from, way_off(at_from, sides.normal)))) continue;
    Points at_to = moved(to, Eigen::all);
    for (Index i = 0; i < at_to.rows(); ++i)
      at_to.row(i) -=
          surface.points.row(to[i]) - pair.before(surface.points.row(from[i])).transpose();
    if (!fits(at_from, at_to, pair.before, plane_tolerance(surface)))
      pair.after = fit(at_from, at_to, sides.normal);
    break;
  }
  return pair;
}

std::string place_second_side(const PeriodicSides& sides, const ImagePair& pair,
                              const SurfaceMesh& surface, Points& moved) {
  Points places(std::ssize(pair.to), 3);
  for (std::size_t i = 0; i < pair.to.size(); ++i) {
    const Vector3d place = pair.place(surface, moved, i);
    places.row(static_cast<Index>(i)) = place;
    if (pair.to[i] == pair.from[i]) continue;  // on the axis
    const double off = (place - moved.row(pair.to[i]).transpose()).norm();
    if (!sides.is_given[i] || off <= sides.tolerance[i]) continue;
    std::ostringstream text;
    text << "the sides '" << sides.first << "' and '" << sides.second << "', "
         << (sides.is_by_file ? "which the mesh file says are" : "named as")
         << " periodic, do not move alike: the node of '" << sides.second << "' at "
         << text_of(surface.points.row(pair.to[i])) << " mm goes " << off
         << " mm off the image of that of '" << sides.first << "' at "
         << text_of(surface.points.row(pair.from[i]))
         << " mm. Are the variant's sides a period apart there, and is neither held or moved "
            "otherwise?";
    if (sides.is_by_file) return text.str();
    throw InvalidInputError(text.str());
  }
  for (std::size_t i = 0; i < pair.to.size(); ++i)
    if (pair.to[i] != pair.from[i]) moved.row(pair.to[i]) = places.row(static_cast<Index>(i));
  return {};
}

std::string describe(const PeriodicSides& sides, const ImagePair& pair) {
  std::ostringstream text;
  text << "periodic sides " << sides.first << ", " << sides.second << ": " << pair.to.size()
       << " nodes";
  const auto add = [&](const Isometry& map) {
    const AngleAxisd about(map.linear);
    if (about.angle() <= kNoTurn)
      text << " shifted by (" << text_of(map.shift) << ") mm";
    else
      text << " turned by " << about.angle() * 180 / std::numbers::pi << " degrees about ("
           << text_of(about.axis()) << ")";
  };
  add(pair.before);
  if (pair.after.linear == pair.before.linear && pair.after.shift == pair.before.shift)
    return text.str();
  text << ", in the variant";
  add(pair.after);
  return text.str();
}

}  // namespace cadmorph
