#pragma once

#include <vector>

#include "core/face_quality.h"

namespace cadmorph {

/// How far the faces of cells are from what finite-volume schemes like (face_quality), as a smooth
/// function of the nodes: with c each of the cosines of face_quality, a face has the energy
///
///     sum (2 / (1 + c))^(2^doublings)
///
/// which is finite up to 180 degrees, so that centres behind their faces come back, too.
class FaceEnergy {
 public:
  using Rows = Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>;

  /// Of all faces of `cells` (ids) of `volumes`, which must outlive this. Nodes of other cells
  /// stay where `positions` (N x 3) has them.
  FaceEnergy(const FiniteVolumes& volumes, const std::vector<Index>& cells,
             const Points& positions);

  /// Moves the nodes to `positions`.
  void place(const Points& positions);

  /// The energy of a face and its derivatives.
  struct FaceSlopes {
    double energy = 0, stiffness = 0;
    Eigen::Vector3d by_area = Eigen::Vector3d::Zero(), by_face_centre = Eigen::Vector3d::Zero(),
                    by_cell_centre = Eigen::Vector3d::Zero();
    int corner = -1;  ///< of the face, that counts by itself; -1: none
    Eigen::Vector3d by_corner = Eigen::Vector3d::Zero();
  };

  /// Memory that the computation of one cell leaves to the next.
  struct Work {
    struct Face {
      int first, count;  ///< its corners, in `corners`
      Index other;
      finite_volume::FaceShape shape;
      Eigen::Vector3d by_centre, by_area;
    };
    std::vector<Face> faces;
    std::vector<int> corners;                        ///< local numbers of nodes
    std::vector<Eigen::Vector3d> at, by;             ///< nodes
    std::vector<Eigen::Vector3d> placed, by_placed;  ///< a face's corners
    std::vector<double> stiffness;
  };

  /// Returns the energy of the i-th cell's faces, and adds its derivative, times `factor`, to the
  /// rows of the cell's nodes (in the mesh that the volumes are of). Sets `stiffness` of each node
  /// to the energies of its faces over their areas: a guess of second derivatives, over the power.
  /// A face between two of the cells counts half in each, so that sums over the cells are the whole
  /// energy and its derivative.
  double add(Index i, int doublings, double factor, Rows slopes, Eigen::VectorXd& stiffness,
             Work& work) const;

 private:
  void read_faces(Index c, Work& work) const;
  FaceSlopes measure(Index c, Index other, std::span<const Eigen::Vector3d> corners,
                     const finite_volume::FaceShape& shape, int doublings) const;
  double measure_tetra(Index c, int doublings, Work& work) const;
  double measure_cell(Index c, int doublings, Work& work) const;

  const FiniteVolumes& volumes_;
  const Mesh& mesh_;
  std::vector<Index> cells_;
  std::vector<char> is_own_;
  const Points* points_ = nullptr;
  Points scratch_;
  std::vector<Eigen::Vector3d> centres_;  ///< of the cells and their neighbours
};

}  // namespace cadmorph
