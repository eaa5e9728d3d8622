#include "volume/baselines/femwarp.h"

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "core/errors.h"
#include "core/remedies.h"
#include "volume/baselines/interior_system.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Corners = std::array<int, 8>;
using HexGradients = Eigen::Matrix<double, 8, 3>;

// A cell's nodes as the corners of a hexahedron, some of them repeated.
constexpr Corners kHexahedron = {0, 1, 2, 3, 4, 5, 6, 7};
constexpr Corners kVoxel = {0, 1, 3, 2, 4, 5, 7, 6};
constexpr Corners kWedge = {0, 1, 2, 2, 3, 4, 5, 5};
constexpr Corners kPyramid = {0, 1, 2, 3, 4, 4, 4, 4};

const Corners& hexahedron_corners(CellType type) {
  switch (type) {
    case CellType::Hexahedron:
      return kHexahedron;
    case CellType::Voxel:
      return kVoxel;
    case CellType::Wedge:
      return kWedge;
    case CellType::Pyramid:
      return kPyramid;
    default:
      throw InvalidInputError(
          "FEMWARP knows linear tetrahedra, hexahedra, wedges and pyramids, "
          "not cells of VTK type " +
          std::to_string(static_cast<int>(type)));
  }
}

// Derivatives of the trilinear shape functions on [-1, 1]^3.
HexGradients shape_gradients(double r, double s, double t) {
  static constexpr double kSigns[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                                          {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};
  HexGradients result;
  for (int i = 0; i < 8; ++i) {
    const double a = kSigns[i][0], b = kSigns[i][1], c = kSigns[i][2];
    result.row(i) << a * (1 + b * s) * (1 + c * t), b * (1 + a * r) * (1 + c * t),
        c * (1 + a * r) * (1 + b * s);
  }
  return result / 8;
}

// Adds weight * |J| times the products of the gradients J^-T g_i.
void add_gradients(const MatrixXd& local, const Matrix3d& jacobian, double weight, MatrixXd& K) {
  const double determinant = jacobian.determinant();
  if (determinant == 0)
    throw SolverError("it has no volume, which FEMWARP needs; use " + words_for(Remedy::RbfMethod));
  const MatrixXd gradients = local * jacobian.inverse().transpose();
  K += weight * std::abs(determinant) * gradients * gradients.transpose();
}

MatrixXd tetrahedron_stiffness(const RowMatrix& nodes) {
  Eigen::Matrix<double, 4, 3> local;
  local << -1, -1, -1, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  MatrixXd K = MatrixXd::Zero(4, 4);
  add_gradients(local, local.transpose() * nodes, 1.0 / 6, K);
  return K;
}

MatrixXd hexahedron_stiffness(const RowMatrix& nodes, const Corners& corners) {
  const double g = 1 / std::sqrt(3.0);
  MatrixXd K = MatrixXd::Zero(nodes.rows(), nodes.rows());
  for (const double r : {-g, g})
    for (const double s : {-g, g})
      for (const double t : {-g, g}) {
        const HexGradients all = shape_gradients(r, s, t);
        MatrixXd local = MatrixXd::Zero(nodes.rows(), 3);
        for (int i = 0; i < 8; ++i) local.row(corners[i]) += all.row(i);
        add_gradients(local, local.transpose() * nodes, 1, K);
      }
  return K;
}

// Names the cell that has none.
MatrixXd stiffness_of(const Mesh& mesh, Index cell, const RowMatrix& nodes) {
  try {
    return laplace_stiffness(mesh.types[cell], nodes);
  } catch (const SolverError& error) {
    throw SolverError("cell " + std::to_string(cell) + ": " + error.what());
  } catch (const InvalidInputError& error) {
    throw InvalidInputError("cell " + std::to_string(cell) + ": " + error.what());
  }
}

class Femwarp final : public Baseline {
 public:
  Femwarp(const Mesh& mesh, const std::vector<Index>& surface_nodes)
      : system_(mesh.node_count(), surface_nodes, entries(mesh),
                InteriorSystem::Symmetry::PositiveDefinite) {}

  Points displacements(const Points& surface) const override { return system_.solve(surface); }

 private:
  static std::vector<MatrixEntry> entries(const Mesh& mesh) {
    std::vector<MatrixEntry> result;
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      if (dimension(mesh.types[c]) != 3) continue;
      const auto nodes = mesh.cell(c);
      RowMatrix positions(nodes.size(), 3);
      for (std::size_t i = 0; i < nodes.size(); ++i) positions.row(i) = mesh.points.row(nodes[i]);
      const MatrixXd K = stiffness_of(mesh, c, positions);
      for (std::size_t i = 0; i < nodes.size(); ++i)
        for (std::size_t j = 0; j < nodes.size(); ++j)
          result.emplace_back(nodes[i], nodes[j], K(i, j));
    }
    return result;
  }

  InteriorSystem system_;
};

}  // namespace

MatrixXd laplace_stiffness(CellType type, const RowMatrix& nodes) {
  return type == CellType::Tetra ? tetrahedron_stiffness(nodes)
                                 : hexahedron_stiffness(nodes, hexahedron_corners(type));
}

std::unique_ptr<Baseline> make_femwarp(const Mesh& mesh, const std::vector<Index>& surface_nodes) {
  return std::make_unique<Femwarp>(mesh, surface_nodes);
}

}  // namespace cadmorph
