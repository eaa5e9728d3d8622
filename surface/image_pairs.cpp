#include "surface/image_pairs.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "core/kd_tree.h"
#include "core/least_squares.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kAnywhere = std::numeric_limits<double>::infinity();

// Planes nearer to parallel than this (the sine of their angle) are parallel: what nodes on a plane
// are off it (kSamePlane).
constexpr double kParallel = 1e-6;

// Sheets are compared node by node only where their shapes agree to so many digits, far fewer than
// a mesh file has; principal moments closer than that leave the axes open.
constexpr double kSameShape = 1e-3;

// A sheet that closes round itself has no side: its area vector is less than this part of its area,
// but for rounding none. That of half a cylinder is 0.64 of it.
constexpr double kLeastSide = 1e-2;

// What a sheet's images share with it.
struct Shape {
  Vector3d centre;  // of its border's nodes
  Vector3d side;    // sum of its area vectors
  double area = 0;
  Vector3d moments;  // principal ones of the border's nodes, ascending
  Matrix3d axes;
};

Shape shape_of(const SurfaceMesh& surface, const Sheet& sheet) {
  Shape shape;
  const Points border = surface.points(sheet.border, Eigen::all);
  shape.centre = border.colwise().mean();
  shape.side.setZero();
  for (const FacetId f : sheet.facets) {
    const Vector3d area = area_vector(surface, surface.points, f);
    shape.side += area;
    shape.area += area.norm();
  }
  const Points off = border.rowwise() - shape.centre.transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> principal(off.transpose() * off);
  shape.moments = principal.eigenvalues();
  shape.axes = principal.eigenvectors();
  return shape;
}

bool is_like(const Shape& a, const Shape& b) {
  return (a.moments - b.moments).cwiseAbs().maxCoeff() <= kSameShape * a.moments[2] &&
         std::abs(a.area - b.area) <= kSameShape * a.area;
}

// The isometry with this linear part that carries a centre onto the other.
Isometry between(const Matrix3d& linear, const Shape& a, const Shape& b) {
  return {linear, b.centre - linear * a.centre};
}

// Mirrors that carry the plane of one sheet onto that of the other.
void add_mirrors(const Shape& a, const Shape& b, std::vector<Isometry>& result) {
  const auto add = [&](const Vector3d& normal) {
    const Isometry mirror = between(Matrix3d::Identity() - 2 * normal * normal.transpose(), a, b);
    result.push_back(mirror);
  };
  const Vector3d m = a.side.normalized(),
                 n = m.dot(b.side) < 0 ? Vector3d(-b.side.normalized()) : b.side.normalized();
  if (m.cross(n).norm() < kParallel) return add(m);
  add((m - n).normalized());
  add((m + n).normalized());
}

// A shift, and the turns that carry the principal axes onto each other, of those that leave the
// inside of the mesh on opposite sides.
void add_periods(const Shape& a, const Shape& b, std::vector<Isometry>& result) {
  const auto add = [&](const Matrix3d& turn) {
    if ((turn * a.side + b.side).norm() <= kSameShape * a.area)
      result.push_back(between(turn, a, b));
  };
  if (a.side.norm() < kLeastSide * a.area) return;
  add(Matrix3d::Identity());
  const double least_gap = std::min(a.moments[1] - a.moments[0], a.moments[2] - a.moments[1]);
  if (least_gap <= kSameShape * a.moments[2]) return;
  for (const double first : {1.0, -1.0})
    for (const double second : {1.0, -1.0}) {
      Matrix3d turn = b.axes * Vector3d(first, second, 1).asDiagonal() * a.axes.transpose();
      if (turn.determinant() < 0)
        turn = b.axes * Vector3d(first, second, -1).asDiagonal() * a.axes.transpose();
      add(turn);
    }
}

// The image of each node of `from` among `to`; nothing where one has none of its own.
std::optional<std::vector<RowId>> images(const SurfaceMesh& surface, const std::vector<RowId>& from,
                                         const std::vector<RowId>& to, const Isometry& map,
                                         double tolerance) {
  if (from.empty()) return std::vector<RowId>();
  const KdTree tree(surface.points(to, Eigen::all));
  std::vector<char> is_taken(to.size(), 0);
  std::vector<RowId> result;
  for (const RowId node : from) {
    const Vector3d x = map(surface.points.row(node));
    const Neighbour near = tree.nearest(x.data(), 1).front();
    if (near.squared_distance > tolerance * tolerance || std::exchange(is_taken[near.index], 1))
      return std::nullopt;
    result.push_back(to[static_cast<std::size_t>(near.index)]);
  }
  return result;
}

// The isometry that fits best, mirrored or not as `like` is.
Isometry fit(const Points& from, const Points& to, const Isometry& like) {
  Points turned = from;
  for (Index i = 0; i < from.rows(); ++i) turned.row(i) = like(from.row(i));
  const Isometry rest = fit_motion(turned, to);
  return {rest.linear * like.linear, rest(like.shift)};
}

std::optional<ImagePair> pair_by(const SurfaceMesh& surface, const Points& moved, const Sheet& a,
                                 const Sheet& b, const Isometry& rough, double tolerance) {
  const auto nearest = images(surface, a.border, b.border, rough, kAnywhere);
  if (!nearest) return std::nullopt;
  const Isometry map =
      fit(surface.points(a.border, Eigen::all), surface.points(*nearest, Eigen::all), rough);
  const auto border = images(surface, a.border, b.border, map, tolerance);
  if (!border) return std::nullopt;
  const auto inner = images(surface, a.inner, b.inner, map, tolerance);
  if (!inner) return std::nullopt;
  ImagePair pair;
  pair.from = a.inner;
  pair.to = *inner;
  pair.inner = a.inner.size();
  pair.from.insert(pair.from.end(), a.border.begin(), a.border.end());
  pair.to.insert(pair.to.end(), border->begin(), border->end());
  pair.before = pair.after =
      fit(surface.points(pair.from, Eigen::all), surface.points(pair.to, Eigen::all), map);
  const Points at_a = moved(a.border, Eigen::all);
  Points at_b(at_a.rows(), 3);
  const double same = kSameMotion * tolerance;
  for (std::size_t i = 0; i < border->size(); ++i) {
    const Vector3d off =
        surface.points.row((*border)[i]).transpose() - pair.before(surface.points.row(a.border[i]));
    at_b.row(i) = moved.row((*border)[i]) - off.transpose();
  }
  if (fits(at_a, at_b, pair.after, same)) return pair;
  pair.after = fit(at_a, at_b, pair.before);
  if (!fits(at_a, at_b, pair.after, same)) return std::nullopt;
  return pair;
}

std::vector<Isometry> maps_between(const Sheet& a, const Sheet& b, const Shape& of_a,
                                   const Shape& of_b) {
  std::vector<Isometry> maps;
  if (a.is_planar && b.is_planar) add_mirrors(of_a, of_b, maps);
  add_periods(of_a, of_b, maps);
  return maps;
}

}  // namespace

Isometry fit_motion(const Points& from, const Points& to) {
  const Eigen::RowVector3d at = from.colwise().mean(), after = to.colwise().mean();
  const Matrix3d rotation =
      fit_rotation((to.rowwise() - after).transpose() * (from.rowwise() - at)).rotation;
  return {rotation, after.transpose() - rotation * at.transpose()};
}

bool fits(const Points& from, const Points& to, const Isometry& map, double tolerance) {
  for (Index i = 0; i < from.rows(); ++i)
    if ((map(from.row(i)) - to.row(i).transpose()).norm() > tolerance) return false;
  return true;
}

Vector3d ImagePair::place(const SurfaceMesh& surface, const Points& moved, std::size_t i) const {
  const Vector3d off = surface.points.row(to[i]).transpose() - before(surface.points.row(from[i]));
  return after(moved.row(from[i])) + after.linear * (before.linear.transpose() * off);
}

std::vector<RowId> nodes_of(const std::vector<ImagePair>& pairs) {
  std::vector<RowId> result;
  for (const ImagePair& pair : pairs)
    for (const auto* nodes : {&pair.from, &pair.to})
      result.insert(result.end(), nodes->begin(), nodes->end());
  std::ranges::sort(result);
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

std::vector<ImagePair> find_image_pairs(const SurfaceMesh& surface, const Points& moved,
                                        const std::vector<Sheet>& sheets, double tolerance) {
  std::vector<Shape> shapes;
  for (const Sheet& sheet : sheets)
    shapes.push_back(sheet.border.empty() || sheet.inner.empty() ? Shape()
                                                                 : shape_of(surface, sheet));
  std::vector<ImagePair> pairs;
  std::vector<char> is_image(sheets.size(), 0);
  for (std::size_t a = 0; a < sheets.size(); ++a)
    for (std::size_t b = a + 1; b < sheets.size() && !is_image[a]; ++b) {
      const bool may_match =
          !is_image[b] && !sheets[a].inner.empty() && !sheets[a].border.empty() &&
          sheets[a].inner.size() == sheets[b].inner.size() &&
          sheets[a].border.size() == sheets[b].border.size() && is_like(shapes[a], shapes[b]);
      if (!may_match) continue;
      std::optional<ImagePair> pair;
      for (const Isometry& map : maps_between(sheets[a], sheets[b], shapes[a], shapes[b])) {
        pair = pair_by(surface, moved, sheets[a], sheets[b], map, tolerance);
        if (pair) break;
      }
      if (!pair) continue;
      is_image[b] = 1;
      pair->original = a;
      pair->image = b;
      pairs.push_back(std::move(*pair));
    }
  return pairs;
}

}  // namespace cadmorph
