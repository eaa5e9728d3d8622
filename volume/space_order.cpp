#include "volume/space_order.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <numeric>

#include "core/parallel.h"

namespace cadmorph {
namespace {

// Boxes that space is cut into, 2^kBits in each direction: with a million cells, some hundred a box
// of those that hold any, whose nodes fit into a processor's first cache.
constexpr int kBits = 5;
constexpr std::size_t kBoxes = std::size_t{1} << (3 * kBits);
constexpr Index kGrain = 4096;

// The number of a box along the curve: the bits of its coordinates in turn.
std::uint32_t along_curve(const Eigen::Array3i& box) {
  std::uint32_t result = 0;
  for (int bit = kBits - 1; bit >= 0; --bit)
    for (int d = 0; d < 3; ++d) result = 2 * result + ((box[d] >> bit) & 1);
  return result;
}

}  // namespace

void sort_in_space(const Mesh& mesh, const Points& positions, std::vector<Index>& cells) {
  const Index count = std::ssize(cells);
  const auto place = [&](Index i) { return positions.row(mesh.cell(cells[i])[0]).transpose(); };
  Eigen::AlignedBox3d box;
  for (Index i = 0; i < count; ++i) box.extend(Eigen::Vector3d(place(i)));
  const double size = count > 0 ? box.sizes().maxCoeff() : 0;
  const double scale = size > 0 ? (1 << kBits) / size : 0;
  std::vector<std::uint32_t> box_of(count);
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      box_of[i] =
          along_curve(((place(i) - box.min()) * scale).array().min((1 << kBits) - 1).cast<int>());
  });
  std::vector<Index> next(kBoxes + 1, 0);
  for (const std::uint32_t one : box_of) ++next[one + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<Index> sorted(cells.size());
  for (Index i = 0; i < count; ++i) sorted[next[box_of[i]]++] = cells[i];
  cells = std::move(sorted);
}

}  // namespace cadmorph
