#pragma once

#include <vector>

#include "core/lbfgs.h"
#include "volume/free_nodes.h"

namespace cadmorph {

/// A guess of a Hessian with a block for each free node, and how far each node may go at once.
class NodeBlocks : public HessianGuess {
 public:
  /// What is guessed of a node.
  struct Block {
    Eigen::Matrix3d hessian;  ///< second derivatives by its position
    double reach;             ///< the farthest that it may go
  };

  /// Of `blocks` one a node of `free`, where it was last moved to.
  NodeBlocks(const FreeNodes& free, const std::vector<Block>& blocks);

  Eigen::VectorXd solve(const Eigen::VectorXd& vector) const override;
  void shorten(Eigen::VectorXd& step) const override;

 private:
  struct Inverse {
    Index first;  ///< of the node's unknowns
    int count;
    double reach;
    Eigen::Matrix3d inverse;  ///< of its hessian by its unknowns: count x count
  };
  std::vector<Inverse> nodes_;
};

}  // namespace cadmorph
