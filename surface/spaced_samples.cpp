#include "surface/spaced_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace cadmorph {
namespace {

// Ratio of the spacings of neighbouring levels: few trees, in which samples are searched at most so
// many times as far as their own spacing asks. With half or twice of it or of kFar, or 1 or 3 for
// kSearched, 14 pairs come out the same.
constexpr double kLevel = 4;
// In spacings: a point on an entity has a sample within kFar, uneven parametrisations included. In
// an even grid it is within 0.7 of one, so that kSearched finds all that are nearly as near.
constexpr double kFar = 4, kSearched = 1.5;

}  // namespace

SpacedSamples::SpacedSamples(const RowMatrix& points, const std::vector<double>& spacing) {
  if (spacing.empty()) return;
  const double most = *std::ranges::max_element(spacing);
  std::map<int, std::vector<Index>> samples;
  for (std::size_t i = 0; i < spacing.size(); ++i)
    samples[static_cast<int>(std::log(most / spacing[i]) / std::log(kLevel))].push_back(
        static_cast<Index>(i));
  for (auto& [level, own] : samples) {
    double widest = 0;
    for (const Index i : own) widest = std::max(widest, spacing[static_cast<std::size_t>(i)]);
    KdTree tree(points(own, Eigen::all));
    levels_.push_back({widest, std::move(own), std::move(tree)});
  }
}

std::vector<Neighbour> SpacedSamples::within(const Eigen::Vector3d& x,
                                             const std::function<double(double)>& radius) const {
  std::vector<double> radii;
  for (const Level& level : levels_) radii.push_back(radius(level.spacing));
  return search(x, radii);
}

std::vector<Neighbour> SpacedSamples::near(const Eigen::Vector3d& x, double margin) const {
  std::vector<double> distances;
  double nearest = std::numeric_limits<double>::infinity();
  const auto is_far = [&](double distance, double spacing) {
    return distance > kFar * spacing + margin;
  };
  for (const Level& level : levels_) {
    distances.push_back(std::sqrt(level.tree.nearest(x.data(), 1)[0].squared_distance));
    if (!is_far(distances.back(), level.spacing)) nearest = std::min(nearest, distances.back());
  }
  std::vector<double> radii;
  for (std::size_t l = 0; l < levels_.size(); ++l)
    radii.push_back(is_far(distances[l], levels_[l].spacing)
                        ? -1
                        : kSearched * std::max(nearest, levels_[l].spacing) + margin);
  return search(x, radii);
}

// Radii: a level's, negative for none.
std::vector<Neighbour> SpacedSamples::search(const Eigen::Vector3d& x,
                                             const std::vector<double>& radii) const {
  std::vector<Neighbour> found;
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    if (radii[l] < 0) continue;
    for (const Neighbour& near : levels_[l].tree.within(x.data(), radii[l]))
      found.push_back(
          {levels_[l].samples[static_cast<std::size_t>(near.index)], near.squared_distance});
  }
  if (levels_.size() > 1) std::ranges::stable_sort(found, {}, &Neighbour::squared_distance);
  return found;
}

}  // namespace cadmorph
