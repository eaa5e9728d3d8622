#pragma once

#include <optional>
#include <vector>

#include "core/cell_topology.h"
#include "core/lbfgs.h"
#include "core/quality.h"
#include "volume/cell_slopes.h"
#include "volume/free_nodes.h"

namespace cadmorph {

/// Distortion of the map from the base cells to the moved ones, as a function of the free nodes
/// (Garanzha et al. 2021, eq. 4-5).
class Distortion {
 public:
  /// Of `cells` of the base mesh, at `positions` (N x 3) to start with. Polyhedra are sampled by
  /// tetrahedra over the means of their faces and nodes.
  Distortion(const Mesh& mesh, Points positions, FreeNodes free, const std::vector<Index>& cells,
             const Orientation& orientation);

  /// Energy at the unknowns x with its gradient; remembers the smallest determinant. O(cells).
  double operator()(const Eigen::VectorXd& x, double epsilon, Eigen::VectorXd& gradient);

  /// What an evaluation costs: the nodes of all samples.
  double size() const;
  double least_determinant() const { return least_; }
  /// Cells with a determinant that is not positive.
  Index inverted() const { return inverted_; }
  /// A guess of the energy's Hessian at the unknowns, good until the next one; O(cells).
  const HessianGuess& guess_hessian(const Eigen::VectorXd& x, double epsilon);
  const FreeNodes& free_nodes() const { return free_; }
  const Points& positions() const { return positions_; }

 private:
  /// A sample is the derivatives of its coordinates in the base by the cell's nodes.
  using NodeRows = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  struct Sample;
  struct Cell {
    Index id;
    Index first = 0, samples = 0;  ///< in gradients_: a row for each node of each sample
    /// Null: none of its nodes follows others.
    const std::vector<LocalMidNode>* mid_nodes = nullptr;
  };

  void add_samples(Index id, const Orientation& orientation);
  void add_map_samples(Index id, const Eigen::MatrixXd& base, int sign);
  void add_polyhedron_samples(Index id, const Eigen::MatrixXd& base, int sign);
  void add_sample(const NodeRows& gradient);
  template <class Visit>
  void for_each_sample(Index i, double epsilon, Visit&& visit) const;
  template <int Nodes, class Visit>
  void for_each_sample(Index i, double epsilon, Visit& visit) const;
  void evaluate(Index i, double epsilon, double& energy, double& least);
  void stiffen(Index i, double epsilon);
  template <class Slopes>
  void give_to_corners(Index i, Slopes&& slope) const;
  template <class Give>
  void for_each_follower(Index i, Give&& give) const;

  const Mesh& mesh_;
  Points positions_;
  FreeNodes free_;
  std::vector<std::vector<LocalMidNode>> mid_nodes_;  ///< by type, of those with nodes that follow
  std::vector<Cell> cells_;
  std::vector<double> gradients_;  ///< three a row
  CellSlopes slopes_;
  std::optional<NodeBlocks> hessian_;
  double least_ = 0;
  Index inverted_ = 0;
};

}  // namespace cadmorph
