#pragma once

#include <vector>

#include "core/types.h"

namespace cadmorph {

/// Some of the points of a cluster that stand for all of them, seen from afar.
struct ClusterSkeleton {
  std::vector<Index> permutation;  ///< of the candidates; the first `rank` are the skeleton
  Index rank = 0;
  /// Weights of the rest carried over to the skeleton: rank x rest, rows padded by zeros as
  /// simd::padded says.
  Eigen::MatrixXd transfer;

  /// Returns the weights of the skeleton that stand for those of the candidates (n x M), each
  /// column computed the same whatever the others are.
  Eigen::MatrixXd compress(const Eigen::Ref<const Eigen::MatrixXd>& weights) const;

  /// The transpose: potentials at the skeleton (rank x M) carried to the candidates (n x M).
  Eigen::MatrixXd expand(const Eigen::Ref<const Eigen::MatrixXd>& potentials) const;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(permutation, rank, transfer);
  }
};

/// Proxy points on shells about the unit ball, from `1 / separation` outwards, that stand for all
/// sources outside; fixed, whatever the machine.
class ProxyShell {
 public:
  explicit ProxyShell(double separation);

  /// Coordinates (size() x 3) and 1 / |x|^3.
  const Eigen::MatrixXd& points() const { return points_; }
  const Eigen::VectorXd& scale() const { return scale_; }
  Index size() const { return points_.rows(); }

 private:
  Eigen::MatrixXd points_;
  Eigen::VectorXd scale_;
};

/// Finds a skeleton of candidates (n x 3) in the ball about `centre` by interpolative decomposition
/// (Cheng, Gimbutas, Martinsson, Rokhlin 2005) of their r^3 kernel with the proxies: beyond them
/// its field misses by `tolerance` relative to the largest. Moments up to degree 2 are kept far
/// more exactly: weights orthogonal to linear polynomials rely on their cancellation.
ClusterSkeleton find_skeleton(const Eigen::Ref<const Eigen::MatrixXd>& candidates,
                              const Eigen::RowVector3d& centre, double radius, double tolerance,
                              const ProxyShell& proxies);

}  // namespace cadmorph
