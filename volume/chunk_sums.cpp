#include "volume/chunk_sums.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr Index kGrain = 1024;  // nodes

}  // namespace

void ChunkSums::Block::add_square(double factor, const Eigen::RowVector3d& slope) {
  int k = 0;
  for (int column = 0; column < 3; ++column)
    for (int row = column; row < 3; ++row) hessian[k++] += factor * slope[row] * slope[column];
}

ChunkSums::ChunkSums(std::span<const Index> first_cell, std::span<const Index> first_node,
                     std::span<const std::uint32_t> nodes, const std::vector<Index>& ids,
                     const FreeNodes& free)
    : rows_(nodes.size()), first_row_{0} {
  std::vector<Index> row_in_chunk(ids.size(), -1);  // where it is not below the chunk's first
  std::vector<Index> place(ids.size());             // in free_
  std::vector<std::uint32_t> node_of_row;           // its place, or kNone
  constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    place[i] = free.contains(ids[i]) ? std::ssize(free_) : -1;
    if (place[i] >= 0) free_.push_back(free.place_of(ids[i]));
  }
  first_.assign(free_.size() + 1, 0);
  for (std::size_t chunk = 0; chunk + 1 < first_cell.size(); ++chunk) {
    const Index first_row = first_row_.back();
    node_of_row.push_back(kNone);  // the first row is that of nodes which are not free
    for (Index i = first_node[first_cell[chunk]]; i < first_node[first_cell[chunk + 1]]; ++i) {
      const std::uint32_t node = nodes[i];
      if (place[node] >= 0 && row_in_chunk[node] < first_row) {
        row_in_chunk[node] = std::ssize(node_of_row);
        node_of_row.push_back(static_cast<std::uint32_t>(place[node]));
        ++first_[place[node] + 1];
      }
      rows_[i] = static_cast<std::uint32_t>(place[node] >= 0 ? row_in_chunk[node] : first_row);
    }
    first_row_.push_back(std::ssize(node_of_row));
  }
  slopes_.resize(node_of_row.size());
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  rows_of_.resize(static_cast<std::size_t>(first_.back()));
  std::vector<Index> next = first_;
  for (std::size_t row = 0; row < node_of_row.size(); ++row)
    if (node_of_row[row] != kNone)
      rows_of_[next[node_of_row[row]]++] = static_cast<std::uint32_t>(row);
}

void ChunkSums::set_slopes(Index chunk, Index first, const Points& slopes) {
  std::fill(slopes_.begin() + first_row_[chunk], slopes_.begin() + first_row_[chunk + 1],
            Vector3d::Zero());
  for (Index i = 0; i < slopes.rows(); ++i) slopes_[rows_[first + i]] += slopes.row(i).transpose();
}

void ChunkSums::clear_blocks(Index chunk) {
  std::fill(blocks_.begin() + first_row_[chunk], blocks_.begin() + first_row_[chunk + 1], Block());
}

// Calls visit(place in FreeNodes, its rows) for each node.
template <class Visit>
void ChunkSums::for_each_node(const Visit& visit) const {
  parallel_for(std::ssize(free_), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      visit(free_[i],
            std::span(rows_of_).subspan(static_cast<std::size_t>(first_[i]),
                                        static_cast<std::size_t>(first_[i + 1] - first_[i])));
  });
}

void ChunkSums::gather_slopes(const FreeNodes& free, double factor,
                              Eigen::VectorXd& gradient) const {
  gradient.setZero(free.unknowns());
  for_each_node([&](Index place, std::span<const std::uint32_t> rows) {
    Vector3d sum = Vector3d::Zero();
    for (const std::uint32_t row : rows) sum += slopes_[row];
    free.add_slope(place, factor * sum, gradient);
  });
}

std::vector<NodeBlocks::Block> ChunkSums::gather_blocks(const FreeNodes& free) const {
  std::vector<NodeBlocks::Block> result(
      static_cast<std::size_t>(free.count()),
      {Matrix3d::Zero(), std::numeric_limits<double>::infinity()});
  for_each_node([&](Index place, std::span<const std::uint32_t> rows) {
    Block sum;
    for (const std::uint32_t row : rows) {
      const Block& one = blocks_[row];
      for (std::size_t k = 0; k < sum.hessian.size(); ++k) sum.hessian[k] += one.hessian[k];
      sum.stiffness += one.stiffness;
      sum.inverse_square_reach = std::max(sum.inverse_square_reach, one.inverse_square_reach);
    }
    const auto& h = sum.hessian;
    Matrix3d hessian{{h[0], h[1], h[2]}, {h[1], h[3], h[4]}, {h[2], h[4], h[5]}};
    hessian.diagonal().array() += sum.stiffness;
    result[place] = {hessian, 1 / std::sqrt(sum.inverse_square_reach)};
  });
  return result;
}

}  // namespace cadmorph
