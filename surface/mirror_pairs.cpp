#include "surface/mirror_pairs.h"

#include <Eigen/Dense>
#include <optional>
#include <utility>

#include "core/kd_tree.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Planes nearer to parallel than this (the sine of their angle) are parallel.
constexpr double kParallel = 1e-6;

// Part of the tolerance within which displacements are images.
constexpr double kSameMotion = 1e-3;

// x -> linear * x + shift
struct Mirror {
  Matrix3d linear;
  Vector3d shift;
};

Mirror mirror_in(const Vector3d& normal, double offset) {
  return {Matrix3d::Identity() - 2 * normal * normal.transpose(), 2 * offset * normal};
}

// Mirrors that carry one plane onto the other.
std::vector<Mirror> mirrors_between(const PlaneSheet& a, const PlaneSheet& b) {
  const Vector3d m = a.normal, n = m.dot(b.normal) < 0 ? Vector3d(-b.normal) : b.normal;
  const Vector3d along = m.cross(n);
  if (along.norm() < kParallel) return {mirror_in(m, m.dot(a.origin + b.origin) / 2)};
  Matrix3d planes;
  planes << m.transpose(), n.transpose(), along.transpose();
  const Vector3d common =
      planes.inverse() * Vector3d(m.dot(a.origin), n.dot(b.origin), along.dot(a.origin));
  std::vector<Mirror> result;
  for (const Vector3d& bisector : {Vector3d(m - n), Vector3d(m + n)})
    result.push_back(mirror_in(bisector.normalized(), bisector.normalized().dot(common)));
  return result;
}

// The image of each node of `from` among `to`; nothing where one has none of its own.
std::optional<std::vector<int>> images(const SurfaceMesh& surface, const std::vector<int>& from,
                                       const std::vector<int>& to, const Mirror& mirror,
                                       double tolerance) {
  if (from.size() != to.size()) return std::nullopt;
  if (from.empty()) return std::vector<int>();
  const KdTree tree(surface.points(to, Eigen::all));
  std::vector<char> is_taken(to.size(), 0);
  std::vector<int> result;
  for (const int node : from) {
    const Vector3d x = mirror.linear * surface.points.row(node).transpose() + mirror.shift;
    const Neighbour near = tree.nearest(x.data(), 1).front();
    if (near.squared_distance > tolerance * tolerance || std::exchange(is_taken[near.index], 1))
      return std::nullopt;
    result.push_back(to[static_cast<std::size_t>(near.index)]);
  }
  return result;
}

std::optional<MirrorPair> pair_of(const SurfaceMesh& surface, const Points& moved,
                                  const PlaneSheet& a, const PlaneSheet& b, double tolerance) {
  if (a.inner.size() != b.inner.size() || a.border.size() != b.border.size() || a.border.empty())
    return std::nullopt;
  const Vector3d centre = surface.points(a.border, Eigen::all).colwise().mean(),
                 image = surface.points(b.border, Eigen::all).colwise().mean();
  for (const Mirror& mirror : mirrors_between(a, b)) {
    if ((mirror.linear * centre + mirror.shift - image).norm() > tolerance) continue;
    const auto border = images(surface, a.border, b.border, mirror, tolerance);
    if (!border) continue;
    auto inner = images(surface, a.inner, b.inner, mirror, tolerance);
    if (!inner) continue;
    bool moves_alike = true;
    for (std::size_t i = 0; i < border->size(); ++i) {
      const auto motion = [&](int n) -> Vector3d { return moved.row(n) - surface.points.row(n); };
      moves_alike &= (mirror.linear * motion(a.border[i]) - motion((*border)[i])).norm() <=
                     kSameMotion * tolerance;
    }
    if (moves_alike) return MirrorPair{a.inner, std::move(*inner), mirror.linear, 0, 0};
  }
  return std::nullopt;
}

}  // namespace

std::vector<MirrorPair> find_mirror_pairs(const SurfaceMesh& surface, const Points& moved,
                                          const std::vector<PlaneSheet>& sheets, double tolerance) {
  std::vector<MirrorPair> pairs;
  std::vector<char> is_image(sheets.size(), 0);
  for (std::size_t a = 0; a < sheets.size(); ++a)
    for (std::size_t b = a + 1; b < sheets.size() && !is_image[a]; ++b) {
      if (is_image[b] || sheets[a].inner.empty()) continue;
      if (auto pair = pair_of(surface, moved, sheets[a], sheets[b], tolerance)) {
        is_image[b] = 1;
        pair->original = a;
        pair->image = b;
        pairs.push_back(std::move(*pair));
      }
    }
  return pairs;
}

void mirror_motion(const SurfaceMesh& surface, const MirrorPair& pair, Points& moved) {
  for (std::size_t i = 0; i < pair.from.size(); ++i) {
    const int from = pair.from[i], to = pair.to[i];
    const Vector3d motion = moved.row(from) - surface.points.row(from);
    moved.row(to) = surface.points.row(to) + (pair.mirror * motion).transpose();
  }
}

}  // namespace cadmorph
