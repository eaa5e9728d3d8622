#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <vector>

#include "core/types.h"

namespace cadmorph {

/// Non-zero of an N x N matrix.
using MatrixEntry = Eigen::Triplet<double, int>;

/// A sparse linear relation between the nodes of a mesh, A u = 0 in the rows of the free nodes,
/// solved for them: A_II u_I = -A_IB u_B.
class InteriorSystem {
 public:
  enum class Symmetry {
    PositiveDefinite,  ///< A_II symmetric positive definite: conjugate gradients
    General,           ///< stabilised bi-conjugate gradients
  };

  /// `prescribed`: distinct ids of the nodes B; all others are free (I). Equal positions in
  /// `entries` add up; those in rows of prescribed nodes are not used. Free nodes without an entry
  /// stay at 0.
  InteriorSystem(Index nodes, std::vector<Index> prescribed,
                 const std::vector<MatrixEntry>& entries, Symmetry symmetry);
  ~InteriorSystem();

  /// Returns the values at all nodes (N x 3) for those at the prescribed ones. Preconditioned
  /// iterations; where they miss the accuracy, a sparse factorisation. Throws SolverError when that
  /// misses it too.
  Points solve(const Points& prescribed) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
