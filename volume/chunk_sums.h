#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "volume/node_blocks.h"

namespace cadmorph {

/// Sums at free nodes of what the cells at them have, cells in chunks: those of a chunk share a row
/// for each of their nodes, so that threads may fill different chunks at once, and the order of all
/// additions is the same for any number of threads. Memory: about a row for each cell.
class ChunkSums {
 public:
  /// A node's share of a guess of second derivatives.
  struct Block {
    std::array<double, 6> hessian{};  ///< 00, 10, 20, 11, 21, 22
    double stiffness = 0;             ///< in all directions
    double inverse_square_reach = 0;  ///< of the way that it may go

    void add_square(double factor, const Eigen::RowVector3d& slope);
  };

  /// `first_cell`: of each chunk, and their number; `first_node`: of each cell in `nodes`, and
  /// their number; `nodes`: of the cells one after the other, as numbers of `ids`, mesh nodes.
  ChunkSums(std::span<const Index> first_cell, std::span<const Index> first_node,
            std::span<const std::uint32_t> nodes, const std::vector<Index>& ids,
            const FreeNodes& free);

  /// Sets those of a chunk to the sums of `slopes`, derivatives by the positions of its cells'
  /// nodes, which are those from `first` in `nodes` on.
  void set_slopes(Index chunk, Index first, const Points& slopes);
  /// Sets the gradient by the unknowns of `free` to `factor` times the sums.
  void gather_slopes(const FreeNodes& free, double factor, Eigen::VectorXd& gradient) const;

  void reserve_blocks() { blocks_.resize(slopes_.size()); }
  void clear_blocks(Index chunk);
  /// That of a node of `nodes`.
  Block& block(Index node) { return blocks_[rows_[node]]; }
  std::vector<NodeBlocks::Block> gather_blocks(const FreeNodes& free) const;

 private:
  template <class Visit>
  void for_each_node(const Visit& visit) const;

  std::vector<std::uint32_t> rows_;
  std::vector<Index> first_row_;  ///< of each chunk, and their number
  std::vector<Eigen::Vector3d> slopes_;
  std::vector<Block> blocks_;
  std::vector<Index> free_;   ///< nodes with rows: places in FreeNodes, in the order of the cells
  std::vector<Index> first_;  ///< of each of them in rows_of_, and their number
  std::vector<std::uint32_t> rows_of_;
};

}  // namespace cadmorph
