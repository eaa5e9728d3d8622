#include "volume/distortion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/jacobian_samples.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Weight of the change of volume beside the change of shape, as in the paper's program.
constexpr double kVolumeWeight = 1.0 / 128;
// A sample whose volume in the base mesh is below this share of its edges' product has no shape of
// its own worth keeping.
constexpr double kFlat = 1e-9;

// The base shape a sample is compared with: its own Jacobian, or a cube's where that is flat.
Matrix3d reference_jacobian(const Matrix3d& base, int orientation) {
  const double edges = base.colwise().norm().prod();
  if (base.determinant() * orientation > kFlat * edges) return base;
  const double size = std::max(base.colwise().norm().maxCoeff(), 1e-300);
  return Eigen::Vector3d(size, size, orientation * size).asDiagonal();
}

}  // namespace

double regularised(double d, double epsilon) {
  const double root = std::sqrt(d * d + epsilon * epsilon);
  return d > 0 ? (d + root) / 2 : epsilon * epsilon / (2 * (root - d));
}

Distortion::Distortion(const Mesh& mesh, Points positions, FreeNodes free,
                       const std::vector<Index>& cells, const Orientation& orientation)
    : mesh_(mesh), positions_(std::move(positions)), free_(std::move(free)) {
  for (const Index c : cells) add_cell(c, orientation);
  stiffness_ = stiffness();
}

double Distortion::operator()(const VectorXd& x, double epsilon, VectorXd& gradient) {
  free_.move(x, positions_);
  const Index count = static_cast<Index>(cells_.size());
  std::vector<double> energies(count), determinants(count);
  parallel_for(count, 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) evaluate(i, epsilon, energies[i], determinants[i]);
  });
  gradient.setZero(x.size());
  double energy = 0;
  least_ = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < count; ++i) {
    energy += energies[i];
    least_ = std::min(least_, determinants[i]);
    scatter(i, gradient);
  }
  return energy;
}

void Distortion::add_cell(Index id, const Orientation& orientation) {
  const auto nodes = mesh_.cell(id);
  MatrixXd base(nodes.size(), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    base.row(n) = mesh_.points.row(nodes[n]) - mesh_.points.row(nodes[0]);
  Cell cell{id, {}, NodeRows::Zero(nodes.size(), 3)};
  const int sign = orientation[static_cast<std::size_t>(mesh_.types[id])];
  if (mesh_.types[id] == CellType::Polyhedron)
    add_polyhedron_samples(cell, base, sign);
  else
    add_map_samples(cell, base, sign);
  if (!cell.gradients.empty()) cells_.push_back(std::move(cell));
}

void Distortion::add_map_samples(Cell& cell, const MatrixXd& base, int sign) const {
  const JacobianSamples& samples = *jacobian_samples(mesh_.types[cell.id]);
  for (int s = 0; s < samples.samples; ++s) {
    const auto slopes = samples.derivatives.middleRows<3>(3 * s);
    if (slopes.rowwise().norm().minCoeff() < kFlat) continue;  // a pyramid's apex
    const Matrix3d jacobian = (slopes * base).transpose();
    cell.gradients.push_back(slopes.transpose() * reference_jacobian(jacobian, sign).inverse());
  }
}

// A tetrahedron for each edge of each face, over the means of the face's nodes and the cell's.
// Those that are inverted in the base, as in cells that are not star-shaped, have no say.
void Distortion::add_polyhedron_samples(Cell& cell, const MatrixXd& base, int sign) const {
  const auto nodes = mesh_.cell(cell.id);
  const auto mean = [&](std::span<const Index> some) {
    Eigen::RowVectorXd weights = Eigen::RowVectorXd::Zero(static_cast<Index>(nodes.size()));
    for (const Index node : some)
      weights[std::ranges::find(nodes, node) - nodes.begin()] += 1.0 / some.size();
    return weights;
  };
  const Eigen::RowVectorXd centre = mean(nodes);
  MatrixXd slopes(3, static_cast<Index>(nodes.size()));
  for (const Facet& facet : cell_facets(mesh_, cell.id)) {
    slopes.row(0) = mean(facet.nodes) - centre;
    for (std::size_t i = 0; i < facet.nodes.size(); ++i) {
      slopes.row(1) = mean({&facet.nodes[i], 1}) - centre;
      slopes.row(2) = mean({&facet.nodes[(i + 1) % facet.nodes.size()], 1}) - centre;
      const Matrix3d jacobian = (slopes * base).transpose();
      if (jacobian.determinant() * sign > kFlat * jacobian.colwise().norm().prod())
        cell.gradients.push_back(slopes.transpose() * jacobian.inverse());
    }
  }
}

double Distortion::size() const {
  double nodes = 0;
  for (const Cell& cell : cells_)
    for (const NodeRows& gradients : cell.gradients) nodes += double(gradients.rows());
  return nodes;
}

VectorXd Distortion::stiffness() const {
  VectorXd result = VectorXd::Zero(free_.unknowns());
  for (const Cell& cell : cells_) {
    const auto nodes = mesh_.cell(cell.id);
    for (const NodeRows& gradient : cell.gradients)
      for (std::size_t n = 0; n < nodes.size(); ++n)
        if (free_.contains(nodes[n]))
          free_.add_diagonal(
              nodes[n], gradient.row(n).squaredNorm() / static_cast<double>(cell.gradients.size()),
              result);
  }
  return result;
}

// Shape tr(F^T F) / chi^(2/3) and volume (det^2 + 1) / chi.
void Distortion::evaluate(Index i, double epsilon, double& energy, double& least) {
  Cell& cell = cells_[i];
  const auto nodes = mesh_.cell(cell.id);
  NodeRows x(nodes.size(), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n) x.row(n) = positions_.row(nodes[n]);
  const double weight = 1.0 / static_cast<double>(cell.gradients.size());
  cell.slope.setZero();
  energy = 0;
  least = std::numeric_limits<double>::infinity();
  for (const NodeRows& gradient : cell.gradients) {
    const Matrix3d f = x.transpose().lazyProduct(gradient);
    Matrix3d cofactor;
    cofactor << f.col(1).cross(f.col(2)), f.col(2).cross(f.col(0)), f.col(0).cross(f.col(1));
    const double det = f.col(0).dot(cofactor.col(0));
    const double root = std::sqrt(det * det + epsilon * epsilon);
    const double chi = regularised(det, epsilon), rate = chi / root;
    const double third = std::cbrt(chi), power = 1 / (third * third);
    const double shape = f.squaredNorm() * power;
    const double volume = (det * det + 1) / chi;
    energy += weight * (shape + kVolumeWeight * volume);
    const double by_det =
        -2.0 / 3 * shape / chi * rate + kVolumeWeight * (2 * det - volume * rate) / chi;
    const Matrix3d by_f = weight * (2 * power * f + by_det * cofactor).transpose();
    cell.slope += gradient.lazyProduct(by_f);
    least = std::min(least, det);
  }
}

void Distortion::scatter(Index i, VectorXd& gradient) const {
  const auto nodes = mesh_.cell(cells_[i].id);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    if (free_.contains(nodes[n]))
      free_.add_slope(nodes[n], cells_[i].slope.row(n).transpose(), gradient);
}

}  // namespace cadmorph
