#pragma once

#include <vector>

#include "core/mesh.h"
#include "volume/free_nodes.h"

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

  /// Where the first column holds stiffnesses at the nodes of each cell instead: the diagonal by
  /// the unknowns of `free`.
  Eigen::VectorXd gather_diagonal(const FreeNodes& free) const;

 private:
  Points rows_;
  std::vector<Index> first_;                      ///< row of each cell
  std::vector<Index> node_first_, rows_of_node_;  ///< the rows of each free node
};

}  // namespace cadmorph
