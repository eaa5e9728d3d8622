#include "core/face_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "core/parallel.h"

namespace cadmorph {

using namespace finite_volume;

const double finite_volume::kSkewnessSlope =
    std::tan(kSevereNonOrthogonality * std::numbers::pi / 180) / kHighSkewness;

namespace {

constexpr Index kGrain = 2048;  // cells a task

double worst_face(PlacedCells& cells, const std::vector<Vector3d>& centres, Index c) {
  double least = 1;
  const auto take_skewness = [&](double squared) {
    least = std::min(least, 1 / std::sqrt(1 + kSkewnessSlope * kSkewnessSlope * squared));
  };
  cells.for_each_face(c, [&](const PlacedFace& placed) {
    const FaceShape face = face_shape(placed.corners);
    if (face.area.isZero(0)) return;
    if (placed.other < 0) {
      const Vector3d d =
          face.area * (face.area.dot(face.centre - centres[c]) / face.area.squaredNorm());
      take_skewness(squared_skewness(placed.corners, face, centres[c], d, kOutside));
      return;
    }
    const Vector3d d = centres[placed.other] - centres[c];
    const double length = face.area.norm() * d.norm();
    if (length > 0) least = std::min(least, cells.sign(c) * face.area.dot(d) / length);
    take_skewness(squared_skewness(placed.corners, face, centres[c], d, kInside));
  });
  return least;
}

// Sets the values of `cells`; `around` are those and their neighbours.
void measure(const FiniteVolumes& volumes, const Points& points, const std::vector<Index>& cells,
             const std::vector<Index>& around, std::vector<double>& values) {
  Points scratch;
  const PlacedCells placed(volumes, volumes.place(points, scratch));
  std::vector<Vector3d> centres(values.size());
  parallel_for(std::ssize(around), kGrain, [&](Index begin, Index end) {
    PlacedCells own = placed;
    std::vector<FaceShape> faces;
    for (Index i = begin; i < end; ++i)
      if (own.is_solid(around[i])) centres[around[i]] = cell_shape(own, around[i], faces).centre;
  });
  parallel_for(std::ssize(cells), kGrain, [&](Index begin, Index end) {
    PlacedCells own = placed;
    for (Index i = begin; i < end; ++i)
      if (own.is_solid(cells[i])) values[cells[i]] = worst_face(own, centres, cells[i]);
  });
}

// The cells and all that share a face with one.
std::vector<Index> with_neighbours(const FiniteVolumes& volumes, const std::vector<Index>& cells) {
  std::vector<Index> result = cells;
  for (const Index c : cells)
    for (const Index other : volumes.neighbours().of(c))
      if (other >= 0) result.push_back(other);
  std::ranges::sort(result);
  result.erase(std::ranges::unique(result).begin(), result.end());
  return result;
}

}  // namespace

double face_angle(double quality) {
  return std::acos(std::clamp(quality, -1.0, 1.0)) * 180 / std::numbers::pi;
}

std::vector<double> face_quality(const FiniteVolumes& volumes, const Points& points) {
  std::vector<double> result(volumes.mesh().cell_count(), std::numeric_limits<double>::quiet_NaN());
  std::vector<Index> all(result.size());
  std::iota(all.begin(), all.end(), Index{0});
  measure(volumes, points, all, all, result);
  return result;
}

std::vector<double> face_quality_again(std::vector<double> before, const FiniteVolumes& volumes,
                                       const Points& points, const std::vector<Index>& cells) {
  const std::vector<Index> changed = with_neighbours(volumes, cells);
  measure(volumes, points, changed, with_neighbours(volumes, changed), before);
  return before;
}

}  // namespace cadmorph
