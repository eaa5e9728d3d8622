#pragma once

#include <vector>

#include "core/quality.h"
#include "volume/free_nodes.h"

namespace cadmorph {

/// chi(D, eps) = (D + sqrt(eps^2 + D^2)) / 2 (Garanzha et al. 2021, eq. 3): positive, near D for
/// D > 0.
double regularised(double d, double epsilon);

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
  const Eigen::VectorXd& stiffness_diagonal() const { return stiffness_; }
  const FreeNodes& free_nodes() const { return free_; }
  const Points& positions() const { return positions_; }

 private:
  using NodeRows = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  struct Cell {
    Index id;
    std::vector<NodeRows> gradients;  ///< a sample each
    NodeRows slope;                   ///< of the energy
  };

  void add_cell(Index id, const Orientation& orientation);
  void add_map_samples(Cell& cell, const Eigen::MatrixXd& base, int sign) const;
  void add_polyhedron_samples(Cell& cell, const Eigen::MatrixXd& base, int sign) const;
  Eigen::VectorXd stiffness() const;
  void evaluate(Index i, double epsilon, double& energy, double& least);
  void scatter(Index i, Eigen::VectorXd& gradient) const;

  const Mesh& mesh_;
  Points positions_;
  FreeNodes free_;
  std::vector<Cell> cells_;
  Eigen::VectorXd stiffness_;
  double least_ = 0;
};

}  // namespace cadmorph
