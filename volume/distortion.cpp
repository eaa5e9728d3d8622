#include "volume/distortion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/foldover.h"
#include "core/jacobian_samples.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A sample whose volume in the base mesh is below this share of its edges' product has no shape of
// its own worth keeping. Far above the rounding of a determinant, 1e-16.
constexpr double kFlat = 1e-9;
constexpr std::size_t kTypes = 256;  // CellType is a byte

// The base shape a sample is compared with: its own Jacobian, or a cube's where that is flat.
Matrix3d reference_jacobian(const Matrix3d& base, int orientation) {
  const double edges = base.colwise().norm().prod();
  if (base.determinant() * orientation > kFlat * edges) return base;
  const double size = std::max(base.colwise().norm().maxCoeff(), 1e-300);
  return Eigen::Vector3d(size, size, orientation * size).asDiagonal();
}

}  // namespace

// Shape tr(F^T F) / chi^(2/3) and volume (det^2 + 1) / chi.
struct Distortion::Sample : Regularised {
  Sample(const Matrix3d& jacobian, double epsilon)
      : Regularised(jacobian.determinant(), epsilon), f(jacobian), det(jacobian.determinant()) {
    cofactor << f.col(1).cross(f.col(2)), f.col(2).cross(f.col(0)), f.col(0).cross(f.col(1));
    const double third = std::cbrt(chi);
    power = 1 / (third * third);
    shape = f.squaredNorm() * power;
    volume = (det * det + 1) / chi;
  }

  Matrix3d f, cofactor;
  double det;
  double power;  ///< chi^(-2/3)
  double shape, volume;
};

Distortion::Distortion(const Mesh& mesh, Points positions, FreeNodes free,
                       const std::vector<Index>& cells, const Orientation& orientation)
    : mesh_(mesh),
      positions_(std::move(positions)),
      free_(std::move(free)),
      mid_nodes_(kTypes),
      slopes_(mesh, cells, free_) {
  for (const Index c : cells) add_samples(c, orientation);
}

double Distortion::operator()(const VectorXd& x, double epsilon, VectorXd& gradient) {
  free_.move(x, positions_);
  const Index count = static_cast<Index>(cells_.size());
  std::vector<double> energies(count), determinants(count);
  parallel_for(count, 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) evaluate(i, epsilon, energies[i], determinants[i]);
  });
  slopes_.gather(free_, 1, gradient);
  double energy = 0;
  least_ = std::numeric_limits<double>::infinity();
  inverted_ = 0;
  for (Index i = 0; i < count; ++i) {
    energy += energies[i];
    least_ = std::min(least_, determinants[i]);
    if (determinants[i] <= 0) ++inverted_;
  }
  return energy;
}

void Distortion::add_samples(Index id, const Orientation& orientation) {
  const auto nodes = mesh_.cell(id);
  MatrixXd base(nodes.size(), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    base.row(n) = mesh_.points.row(nodes[n]) - mesh_.points.row(nodes[0]);
  cells_.push_back({id, static_cast<Index>(gradients_.size() / 3)});
  if (free_.has_followers() &&
      std::ranges::any_of(nodes, [&](Index node) { return free_.follows(node); })) {
    auto& mid_nodes = mid_nodes_[static_cast<std::size_t>(mesh_.types[id])];
    if (mid_nodes.empty()) mid_nodes = mid_nodes_of(mesh_.types[id]);
    cells_.back().mid_nodes = &mid_nodes;
  }
  const int sign = orientation[static_cast<std::size_t>(mesh_.types[id])];
  if (mesh_.types[id] == CellType::Polyhedron)
    add_polyhedron_samples(id, base, sign);
  else
    add_map_samples(id, base, sign);
}

void Distortion::add_sample(const NodeRows& gradient) {
  for (Index n = 0; n < gradient.rows(); ++n)
    for (int c = 0; c < 3; ++c) gradients_.push_back(gradient(n, c));
  ++cells_.back().samples;
}

void Distortion::add_map_samples(Index id, const MatrixXd& base, int sign) {
  const JacobianSamples& samples = *jacobian_samples(mesh_.types[id]);
  for (int s = 0; s < samples.samples; ++s) {
    const auto slopes = samples.derivatives.middleRows<3>(3 * s);
    if (slopes.rowwise().norm().minCoeff() < kFlat) continue;  // a pyramid's apex
    const Matrix3d jacobian = (slopes * base).transpose();
    add_sample(slopes.transpose() * reference_jacobian(jacobian, sign).inverse());
  }
}

// A tetrahedron for each edge of each face, over the means of the face's nodes and the cell's.
// Those that are inverted in the base, as in cells that are not star-shaped, have no say.
void Distortion::add_polyhedron_samples(Index id, const MatrixXd& base, int sign) {
  const auto nodes = mesh_.cell(id);
  const auto mean = [&](std::span<const Index> some) {
    Eigen::RowVectorXd weights = Eigen::RowVectorXd::Zero(static_cast<Index>(nodes.size()));
    for (const Index node : some)
      weights[std::ranges::find(nodes, node) - nodes.begin()] += 1.0 / some.size();
    return weights;
  };
  const Eigen::RowVectorXd centre = mean(nodes);
  MatrixXd slopes(3, static_cast<Index>(nodes.size()));
  for (const Facet& facet : cell_facets(mesh_, id)) {
    slopes.row(0) = mean(facet.nodes) - centre;
    for (std::size_t i = 0; i < facet.nodes.size(); ++i) {
      slopes.row(1) = mean({&facet.nodes[i], 1}) - centre;
      slopes.row(2) = mean({&facet.nodes[(i + 1) % facet.nodes.size()], 1}) - centre;
      const Matrix3d jacobian = (slopes * base).transpose();
      if (jacobian.determinant() * sign > kFlat * jacobian.colwise().norm().prod())
        add_sample(slopes.transpose() * jacobian.inverse());
    }
  }
}

double Distortion::size() const { return double(gradients_.size()) / 3; }

const HessianGuess& Distortion::guess_hessian(const VectorXd& x, double epsilon) {
  free_.move(x, positions_);
  slopes_.reserve_stiffness();
  parallel_for(std::ssize(cells_), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) stiffen(i, epsilon);
  });
  hessian_.emplace(free_, slopes_.gather_blocks(free_));
  return *hessian_;
}

template <class Visit>
void Distortion::for_each_sample(Index i, double epsilon, Visit&& visit) const {
  switch (mesh_.cell(cells_[i].id).size()) {
    case 4:
      return for_each_sample<4>(i, epsilon, visit);
    case 8:
      return for_each_sample<8>(i, epsilon, visit);
    case 10:
      return for_each_sample<10>(i, epsilon, visit);
    default:
      return for_each_sample<Eigen::Dynamic>(i, epsilon, visit);
  }
}

// Calls visit(gradient, sample) for the samples of the i-th cell.
template <int Nodes, class Visit>
void Distortion::for_each_sample(Index i, double epsilon, Visit& visit) const {
  using Rows = Eigen::Matrix<double, Nodes, 3, Eigen::RowMajor>;
  const Cell& cell = cells_[i];
  const auto nodes = mesh_.cell(cell.id);
  const Index count = std::ssize(nodes);
  Rows x(count, 3);
  for (Index n = 0; n < count; ++n) x.row(n) = positions_.row(nodes[n]);
  for (Index s = 0; s < cell.samples; ++s) {
    const Eigen::Map<const Rows> gradient(gradients_.data() + 3 * (cell.first + s * count), count,
                                          3);
    visit(gradient, Sample(x.transpose().lazyProduct(gradient), epsilon));
  }
}

// Calls give(mid, corner, share) for the nodes of the i-th cell that follow, and each of their
// corners.
template <class Give>
void Distortion::for_each_follower(Index i, Give&& give) const {
  if (!cells_[i].mid_nodes) return;
  const auto nodes = mesh_.cell(cells_[i].id);
  for (const LocalMidNode& mid : *cells_[i].mid_nodes)
    if (free_.follows(nodes[std::size_t(mid.node)]))
      for (const int corner : mid.corners) give(mid.node, corner, 1 / double(mid.corners.size()));
}

template <class Slopes>
void Distortion::give_to_corners(Index i, Slopes&& slope) const {
  const auto nodes = mesh_.cell(cells_[i].id);
  for_each_follower(i, [&](int mid, int corner, double share) {
    slope.row(corner) += share * free_.by_corners(nodes[std::size_t(mid)], slope.row(mid));
  });
}

void Distortion::evaluate(Index i, double epsilon, double& energy, double& least) {
  const double weight = 1.0 / static_cast<double>(cells_[i].samples);
  auto slope = slopes_.of(i);
  slope.setZero();
  energy = 0;
  least = std::numeric_limits<double>::infinity();
  for_each_sample(i, epsilon, [&](const auto& gradient, const Sample& s) {
    energy += weight * (s.shape + kVolumeWeight * s.volume);
    const double by_det = -2.0 / 3 * s.shape / s.chi * s.rate +
                          kVolumeWeight * (2 * s.det - s.volume * s.rate) / s.chi;
    const Matrix3d by_f = weight * (2 * s.power * s.f + by_det * s.cofactor).transpose();
    slope += gradient.lazyProduct(by_f);
    least = std::min(least, s.det);
  });
  give_to_corners(i, slope);
}

// The second derivatives by F alone and by the determinant alone.
void Distortion::stiffen(Index i, double epsilon) {
  const double weight = 1.0 / static_cast<double>(cells_[i].samples);
  auto slope = slopes_.of(i);
  auto stiffness = slopes_.stiffness_of(i);
  slope.setZero();
  stiffness.setZero();
  for_each_sample(i, epsilon, [&](const auto& gradient, const Sample& s) {
    const double rate_square = s.rate * s.rate / s.chi;
    const double by_det =
        s.shape / s.chi * (10.0 / 9 * rate_square - 2.0 / 3 * s.bend) +
        kVolumeWeight / s.chi *
            (2 - 4 * s.det * s.rate / s.chi + s.volume * (2 * rate_square - s.bend));
    if (by_det > 0)
      slope += weight * std::sqrt(by_det) * gradient.lazyProduct(s.cofactor.transpose());
    for (Index n = 0; n < gradient.rows(); ++n)
      stiffness(n, 0) += float(2 * weight * s.power * gradient.row(n).squaredNorm());
  });
  give_to_corners(i, slope);
  // The square of a mean is at most the mean of the squares.
  for_each_follower(i, [&](int mid, int corner, double share) {
    stiffness(corner, 0) += float(share) * stiffness(mid, 0);
  });
}

}  // namespace cadmorph
