#include "volume/worst_patch.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "volume/worst_cells.h"

namespace cadmorph {
namespace {

// Of all cells. With twice as many neighbours (kMostNeighbours) or half of them see best_mesh.cpp.
constexpr double kMostSeeds = 0.05;
// So many times as many are taken where cells of one bin would be parted otherwise: in a symmetric
// mesh each cell shares its bin with its mirror image. With 4, 5 pairs come out the same; with 1,
// which parts bins, they keep up to 15 % more of the smallest, one 2 % less of the worst twentieth.
constexpr double kWholeBins = 2;
// A cell that kept this share of its scaled Jacobian is left alone: it lost no more than what an
// attempt is to gain (kWorthwhile in best_mesh.cpp). With 0.98 or 0.995, 5 pairs keep 1 % less of
// the worst twentieth on the mean, single ones up to 31 % more of the smallest.
constexpr double kKept = 0.99;

// Whether the cell at `next` is still taken where `most` are to be and `taken` are: to the end of
// the bin of the one before, up to kWholeBins times as many.
bool has_room(double taken, double most, const std::vector<Index>& cells, std::size_t next,
              const std::vector<double>& values) {
  return taken < most || (taken < kWholeBins * most && next > 0 &&
                          quality_bin(values[cells[next - 1]]) == quality_bin(values[cells[next]]));
}

std::vector<Index> marked(const std::vector<char>& marks) {
  std::vector<Index> result;
  for (Index i = 0; i < std::ssize(marks); ++i)
    if (marks[i]) result.push_back(i);
  return result;
}

}  // namespace

std::vector<Index> worst_that_lost(const QualityReport& now, const QualityReport& reference) {
  const std::vector<double>& values = now.values;
  std::vector<Index> result;
  for (Index c = 0; c < std::ssize(values); ++c)
    if (is_measured(values[c]) && values[c] < kKept * reference.values[c]) result.push_back(c);
  const double most = std::max(1.0, kMostSeeds * double(now.cells));
  const auto first = [&](Index c) { return std::pair(quality_bin(values[c]), c); };
  std::size_t count = std::size_t(std::ceil(kWholeBins * most));
  if (result.size() > count) {
    std::ranges::nth_element(result, result.begin() + std::ptrdiff_t(count), {}, first);
    result.resize(count);
  }
  std::ranges::sort(result, {}, first);
  count = 0;
  while (count < result.size() && has_room(double(count), most, result, count, values)) ++count;
  result.resize(count);
  return result;
}

Patch patch_round(std::vector<Index> seeds, int layers, double most, const QualityReport& now,
                  const NodeCells& cells_at, const MovingNodes& moving) {
  const Mesh& mesh = moving.mesh();
  std::vector<char> has_node(mesh.node_count(), 0), has_cell(mesh.cell_count(), 0);
  std::vector<Index> cells = std::move(seeds);
  Index changed = 0;
  const auto take = [&](Index node) {
    if (moving.is_fixed(node) || moving.mid_nodes().contains(node) ||
        std::exchange(has_node[node], 1))
      return;
    for (const Index c : cells_at.cells(node))
      if (is_measured(now.values[c]) && !std::exchange(has_cell[c], 1)) {
        cells.push_back(c);
        ++changed;
      }
  };
  std::size_t next = 0;
  for (int layer = 0; layer < layers; ++layer)
    for (const std::size_t last = cells.size();
         next < last && has_room(double(changed), most, cells, next, now.values); ++next) {
      const Index cell = cells[next];
      for (const Index node : mesh.cell(cell)) moving.for_column(node, take);
    }
  Patch result;
  result.nodes = marked(has_node);
  result.cells = marked(has_cell);
  moving.add_followers(result, has_node);
  return result;
}

}  // namespace cadmorph
