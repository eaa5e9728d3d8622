#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/cell_topology.h"
#include "core/quality.h"
#include "volume/chunk_sums.h"
#include "volume/edge_spacing.h"
#include "volume/face_energy.h"
#include "volume/free_nodes.h"
#include "volume/sample_energy.h"
#include "volume/triangle_shape.h"

namespace cadmorph {

/// How poor cells are, as a smooth function of the free nodes. Of all samples of the scaled
/// Jacobian (docs/quality.md), with q the value of one and J its edges or tangents, it is
///
///     1/p log sum_cells mean_samples [ q^-p + k (s r)^n ],   r = (|F|^2 / 3)^3 / det(F)^2,
///
/// F = J J0^-1, J0 that of the same sample in a mesh of reference. The first term goes to
/// -log min q for large p; the second keeps each cell near its shape of reference, a thin layer
/// above all its height: n = p/4, s = 1, unless keep_flatness sets them.
/// The sum has EdgeSpacing with the power p of nodes that slide along edges, too, and TriangleShape
/// of a solid's surface.
/// For finite volumes FaceEnergy with the power 4 p is added in place of the latter, q is divided
/// by its value in the mesh of reference, and n = p/2, s = 1 for all. Infinite where a sample is
/// not positive.
class ShapeEnergy {
 public:
  /// Of solid `cells`, or those of a mesh of shells, at `positions` (N x 3) to start with, which
  /// count in the plane of the mesh (plane_normal), or each in its own plane there. `reference`
  /// (N x 3): samples that are not positive there have no shape to keep.
  /// `volumes`: null, or the mesh as finite volumes, which must outlive this.
  ShapeEnergy(const Mesh& mesh, const Points& reference, Points positions, FreeNodes free,
              std::vector<Index> cells, const Orientation& orientation,
              const FiniteVolumes* volumes = nullptr);

  /// Sets the power p to 2^doublings, of 2 to 7.
  void set_power(int doublings) { squarings_ = doublings - 1; }

  /// Has cells other than tetrahedra, whose q feels how flat they are, become little flatter than
  /// at `plain` (N x 3), once: n = p/2, and s such that a sample whose r is the mean of its own and
  /// of the largest there, as a geometric mean, counts as much as the least q does where the nodes
  /// are now. Not for finite volumes. O(cells).
  void keep_flatness(const Points& plain);

  /// Value at the unknowns with its gradient. The same to the last bit for any number of threads;
  /// O(cells).
  double operator()(const Eigen::VectorXd& x, Eigen::VectorXd& gradient);

  /// A guess of the Hessian at the unknowns, good until the next one; O(cells). With exp(p f) the
  /// summand of a cell, it counts p exp(p f) grad f (grad f)^T in blocks of a node each, and in
  /// place of the second derivatives of f a stiffness against stretch. No node is to go farther at
  /// once than half the height of its cells.
  const HessianGuess& guess_hessian(const Eigen::VectorXd& x);

  const FreeNodes& free_nodes() const { return free_; }
  /// All nodes' positions (N x 3) at the unknowns.
  const Points& positions_at(const Eigen::VectorXd& x);

 private:
  using NodeRows = Eigen::Matrix<double, Eigen::Dynamic, 3>;

  /// Three edges or tangents of a cell.
  struct Sample {
    /// Edges from the first of these nodes to the others, -1 for the normal; or
    std::array<int, 4> corner;
    NodeRows slopes;  ///< weights of the cell's nodes, where not empty
    double unit;      ///< one over the determinant in the ideal cell with unit edges

    bool is_corner_of_solid() const { return slopes.size() == 0 && corner[3] >= 0; }
  };
  using Samples = std::vector<Sample>;
  static int edge_count(const Sample& sample) { return sample.corner[3] < 0 ? 2 : 3; }

  struct Cell {
    Index id;
    const Samples* samples;
    double sign;
    const std::vector<LocalMidNode>* mid_nodes;  ///< null: none follows its corners
  };
  /// Cells [first, last), whose samples fill lanes from references_[first_reference] on.
  struct Chunk {
    Index first, last, first_reference;
    bool are_tetrahedra;
  };
  /// Where a lane's sample is from.
  struct Lane {
    Index cell;
    const Sample* sample;
  };

  const Samples* samples_of(Index cell);
  void number_nodes();
  Points of_nodes(const Points& points) const;
  void read_nodes(Index cell, const Points& points, NodeRows& x) const;
  /// `x`: the positions of the cell's nodes.
  static Eigen::Matrix3d edges(const Sample& sample, const NodeRows& x,
                               const Eigen::Vector3d& normal);
  void set_normals(const Points& points);
  void make_chunks();
  void set_references(const Chunk& chunk, const Points& points);
  /// Calls visit(reference, lane, edges) for the samples of all cells but tetrahedra at `points`,
  /// and returns the largest of what it returns and 1.
  template <class Visit>
  double largest(const Points& points, Visit&& visit);
  template <class Visit>
  void for_each_group(const Chunk& chunk, const Points& points, Visit&& visit) const;
  template <class Visit>
  double evaluate(const Chunk& chunk, Visit&& visit) const;
  template <class Visit>
  double add_faces(const Chunk& chunk, Points& slopes, Visit&& visit) const;
  /// `of_nodes`: x, y, z of each node of the cell.
  static void add_slopes(const Sample& sample, const Eigen::Matrix3d& by_edges, double* of_nodes);
  /// Gives the slopes of nodes that follow their corners to these.
  void give_to_corners(const Chunk& chunk, Points& slopes) const;
  /// The rows of a cell's nodes in a matrix of all those of a chunk.
  auto of_cell(Points& rows, const Chunk& chunk, Index cell) const {
    return rows.middleRows(first_node_[cell] - first_node_[chunk.first],
                           first_node_[cell + 1] - first_node_[cell]);
  }

  const Mesh& mesh_;
  Points positions_;
  FreeNodes free_;
  std::vector<Index> ids_;            ///< of the cells' nodes, in the order of the cells
  std::vector<Index> first_node_;     ///< of each cell in nodes_, and their number
  std::vector<std::uint32_t> nodes_;  ///< of all cells, as numbers of ids_
  Points placed_;                     ///< positions of ids_
  /// The third edge of all samples in a plane mesh; of each cell in another one of shells.
  Eigen::Vector3d normal_;
  std::vector<Eigen::Vector3d> normals_;
  int squarings_ = 1;
  bool keeps_flatness_ = false;
  std::vector<std::unique_ptr<Samples>> samples_;     ///< of a cell type; then of polyhedra
  std::vector<std::vector<LocalMidNode>> mid_nodes_;  ///< of a cell type
  std::vector<Cell> cells_;
  std::vector<Chunk> chunks_;
  std::unique_ptr<SampleReference[]> references_;  ///< of all lanes of all chunks
  std::optional<FaceEnergy> faces_;
  std::optional<EdgeSpacing> spacing_;
  std::optional<TriangleShape> triangles_;
  std::optional<ChunkSums> sums_;  ///< of the energy's slopes
  std::optional<NodeBlocks> hessian_;
  Eigen::VectorXd evaluated_;  ///< where the slopes are those of
  double sum_ = 0;             ///< of the summands there
};

}  // namespace cadmorph
