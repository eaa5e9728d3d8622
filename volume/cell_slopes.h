#pragma once

#include <vector>

#include "core/mesh.h"
#include "volume/free_nodes.h"
#include "volume/node_blocks.h"

namespace cadmorph {

/// Derivatives of a sum over cells by the nodes of each cell. Threads may write those of different
/// cells; their sums at the nodes come in one order.
class CellSlopes {
 public:
  /// Of the cells with these ids; `free` tells which nodes' sums are wanted.
  CellSlopes(const Mesh& mesh, const std::vector<Index>& cells, const FreeNodes& free);

  /// Of the i-th cell, a row for each of its nodes.
  auto of(Index i) { return rows_.middleRows(first_[i], first_[i + 1] - first_[i]); }

  /// Sets the gradient by the unknowns of `free` to `factor` times the sums.
  void gather(const FreeNodes& free, double factor, Eigen::VectorXd& gradient) const;

  /// What a guess of the second derivatives needs beside the slopes: for each node of the i-th
  /// cell a stiffness in all directions, and one over the square of the way that it may go.
  auto stiffness_of(Index i) { return stiffness_.middleRows(first_[i], first_[i + 1] - first_[i]); }
  void reserve_stiffness() { stiffness_.resize(rows_.rows(), 2); }

  /// The sum of the products of each slope with itself and of the stiffnesses, at each free node.
  std::vector<NodeBlocks::Block> gather_blocks(const FreeNodes& free) const;

 private:
  Points rows_;
  Eigen::Matrix<float, Eigen::Dynamic, 2, Eigen::RowMajor> stiffness_;  ///< rough numbers do
  std::vector<Index> first_;                                            ///< row of each cell
  std::vector<Index> node_first_, rows_of_node_;  ///< the rows of each free node
};

}  // namespace cadmorph
