#include "volume/untangle.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "core/errors.h"
#include "core/jacobian_samples.h"
#include "core/parallel.h"
#include "volume/held_cells.h"
#include "volume/lbfgs.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using NodeRows = Eigen::Matrix<double, Eigen::Dynamic, 3>;

// Weight of the change of volume beside the change of shape, as in the paper's program.
constexpr double kVolumeWeight = 1.0 / 128;
// A sample whose volume in the base mesh is below this share of its edges' product has no shape of
// its own worth keeping.
constexpr double kFlat = 1e-9;
// Regularisation once all samples are positive.
constexpr double kLeastEpsilon = 1e-10;
// Minimisations end when they lower the energy by less than this share, all samples positive.
constexpr double kSettled = 1e-3;
// Neighbourhoods in a row that may repair nothing.
constexpr int kIdleAttempts = 2;

// chi(D, eps) = (D + sqrt(eps^2 + D^2)) / 2 (Garanzha et al. 2021, eq. 3): positive, near D for D >
// 0.
double regularised(double d, double epsilon) {
  const double root = std::sqrt(d * d + epsilon * epsilon);
  return d > 0 ? (d + root) / 2 : epsilon * epsilon / (2 * (root - d));
}

// Positions x cells -> cells at each node.
class NodeCells {
 public:
  explicit NodeCells(const Mesh& mesh) : first_(mesh.node_count() + 1, 0) {
    for (const Index node : mesh.connectivity) ++first_[node + 1];
    for (std::size_t n = 1; n < first_.size(); ++n) first_[n] += first_[n - 1];
    cells_.resize(mesh.connectivity.size());
    auto next = first_;
    for (Index c = 0; c < mesh.cell_count(); ++c)
      for (const Index node : mesh.cell(c)) cells_[next[node]++] = c;
  }
  std::span<const Index> cells(Index node) const {
    return {cells_.data() + first_[node],
            static_cast<std::size_t>(first_[node + 1] - first_[node])};
  }

 private:
  std::vector<Index> first_, cells_;
};

// The cells within some rings of the seeds, and the nodes that may move.
struct Neighbourhood {
  std::vector<Index> cells;  ///< with a free node, ascending
  std::vector<Index> nodes;  ///< free ones, ascending
};

Neighbourhood grow(const Mesh& mesh, const NodeCells& incidence, const std::vector<Index>& seeds,
                   int rings, const std::vector<char>& is_fixed) {
  std::vector<char> has_cell(mesh.cell_count(), 0), has_node(mesh.node_count(), 0);
  std::vector<Index> front = seeds, nodes;
  for (const Index c : seeds) has_cell[c] = 1;
  for (int ring = 0; ring < rings && !front.empty(); ++ring) {
    std::vector<Index> next;
    for (const Index c : front)
      for (const Index node : mesh.cell(c)) {
        if (std::exchange(has_node[node], 1)) continue;
        if (!is_fixed[node]) nodes.push_back(node);
        for (const Index other : incidence.cells(node))
          if (!std::exchange(has_cell[other], 1)) next.push_back(other);
      }
    front = std::move(next);
  }
  Neighbourhood result;
  std::vector<char> is_active(mesh.cell_count(), 0);
  for (const Index node : nodes)
    for (const Index c : incidence.cells(node))
      if (dimension(mesh.types[c]) == 3) is_active[c] = 1;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (is_active[c]) result.cells.push_back(c);
  std::ranges::sort(nodes);
  result.nodes = std::move(nodes);
  return result;
}

// Seeds that a move of free nodes may help.
std::vector<Index> movable(const Mesh& mesh, const Points& positions,
                           const std::vector<Index>& seeds, const std::vector<char>& is_fixed,
                           const Orientation& orientation) {
  std::vector<Index> result;
  for (const Index c : seeds)
    if (!is_held(mesh, positions, is_fixed, orientation, c)) result.push_back(c);
  return result;
}

// The base shape a sample is compared with: its own Jacobian, or a cube's where that is flat.
Matrix3d reference_jacobian(const Matrix3d& base, int orientation) {
  const double edges = base.colwise().norm().prod();
  if (base.determinant() * orientation > kFlat * edges) return base;
  const double size = std::max(base.colwise().norm().maxCoeff(), 1e-300);
  return Eigen::Vector3d(size, size, orientation * size).asDiagonal();
}

// Distortion of the map from the base cells to the moved ones, as a function of the free nodes.
// Cells held inverted have no say: their energy would outweigh all others.
class Distortion {
 public:
  Distortion(const Mesh& mesh, Points positions, const std::vector<char>& is_fixed,
             const Neighbourhood& neighbourhood, const Orientation& orientation)
      : mesh_(mesh), positions_(std::move(positions)), around_(neighbourhood) {
    local_.assign(mesh.node_count(), -1);
    for (std::size_t i = 0; i < around_.nodes.size(); ++i) local_[around_.nodes[i]] = i;
    for (const Index c : around_.cells)
      if (!is_held(mesh, positions_, is_fixed, orientation, c)) add_cell(c, orientation);
    stiffness_ = stiffness();
  }

  VectorXd start() const {
    VectorXd x(3 * around_.nodes.size());
    for (std::size_t i = 0; i < around_.nodes.size(); ++i)
      x.segment<3>(3 * i) = positions_.row(around_.nodes[i]).transpose();
    return x;
  }

  // Energy at x with its gradient; remembers the smallest determinant.
  double operator()(const VectorXd& x, double epsilon, VectorXd& gradient) {
    move_to(x);
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

  double least_determinant() const { return least_; }
  const VectorXd& stiffness_diagonal() const { return stiffness_; }
  const Points& positions() const { return positions_; }

 private:
  struct Cell {
    Index id;
    std::vector<NodeRows> gradients;  ///< a sample each
    NodeRows slope;                   ///< of the energy
  };

  void add_cell(Index id, const Orientation& orientation) {
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

  void add_map_samples(Cell& cell, const MatrixXd& base, int sign) const {
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
  void add_polyhedron_samples(Cell& cell, const MatrixXd& base, int sign) const {
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

  VectorXd stiffness() const {
    VectorXd result = VectorXd::Zero(3 * around_.nodes.size());
    for (const Cell& cell : cells_) {
      const auto nodes = mesh_.cell(cell.id);
      for (const NodeRows& gradient : cell.gradients)
        for (std::size_t n = 0; n < nodes.size(); ++n)
          if (local_[nodes[n]] >= 0)
            result.segment<3>(3 * local_[nodes[n]]).array() +=
                gradient.row(n).squaredNorm() / static_cast<double>(cell.gradients.size());
    }
    return result;
  }

  void move_to(const VectorXd& x) {
    for (std::size_t i = 0; i < around_.nodes.size(); ++i)
      positions_.row(around_.nodes[i]) = x.segment<3>(3 * i).transpose();
  }

  // Shape tr(F^T F) / chi^(2/3) and volume (det^2 + 1) / chi (Garanzha et al. 2021, eq. 4-5).
  void evaluate(Index i, double epsilon, double& energy, double& least) {
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

  void scatter(Index i, VectorXd& gradient) const {
    const auto nodes = mesh_.cell(cells_[i].id);
    for (std::size_t n = 0; n < nodes.size(); ++n)
      if (local_[nodes[n]] >= 0)
        gradient.segment<3>(3 * local_[nodes[n]]) += cells_[i].slope.row(n).transpose();
  }

  const Mesh& mesh_;
  Points positions_;
  const Neighbourhood& around_;
  std::vector<Index> local_;
  std::vector<Cell> cells_;
  VectorXd stiffness_;
  double least_ = 0;
};

// The regularisation that lowers the energy at the worst sample as the last minimisation lowered
// the whole (Garanzha et al. 2021, sect. 4).
double next_epsilon(double epsilon, double least, double energy_before, double energy) {
  const double drop = std::max(1 - energy / energy_before, 0.1);
  const double mu = (1 - drop) * regularised(least, epsilon);
  return least < mu ? std::max(2 * std::sqrt(mu * (mu - least)), kLeastEpsilon) : kLeastEpsilon;
}

Points minimise(Distortion& distortion, const UntangleOptions& options) {
  VectorXd x = distortion.start(), gradient;
  double epsilon = 1;
  distortion(x, epsilon, gradient);
  if (distortion.least_determinant() > 0) epsilon = kLeastEpsilon;
  for (int outer = 0; outer < options.outer_iterations; ++outer) {
    const auto energy = [&](const VectorXd& at, VectorXd& slope) {
      return distortion(at, epsilon, slope);
    };
    const double before = energy(x, gradient);
    minimise_lbfgs(energy, x, distortion.stiffness_diagonal(), options.inner_iterations);
    const double after = energy(x, gradient);
    const double least = distortion.least_determinant();
    if (least > 0 && epsilon <= kLeastEpsilon && after > (1 - kSettled) * before) break;
    epsilon = next_epsilon(epsilon, least, before, after);
  }
  return distortion.positions();
}

void check_sizes(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed) {
  if (positions.rows() != mesh.node_count() ||
      static_cast<Index>(is_fixed.size()) != mesh.node_count())
    throw InvalidInputError("untangling needs a position and a mark for each of the mesh's " +
                            std::to_string(mesh.node_count()) + " nodes");
}

}  // namespace

UntangleResult untangle(const Mesh& mesh, const Points& positions,
                        const std::vector<char>& is_fixed, const Orientation& orientation,
                        const UntangleOptions& options) {
  check_sizes(mesh, positions, is_fixed);
  const auto start = std::chrono::steady_clock::now();
  UntangleResult result{positions, {}};
  UntangleReport& report = result.report;
  report.validity = check_validity(mesh, positions, orientation);
  report.before = report.validity.invalid;
  std::vector<Index> seeds = report.validity.invalid_cells;
  seeds.insert(seeds.end(), options.poor_cells.begin(), options.poor_cells.end());
  if (!seeds.empty()) {
    const NodeCells incidence(mesh);
    seeds = movable(mesh, result.positions, seeds, is_fixed, orientation);
    int idle = 0;
    for (int attempt = 0; attempt < options.attempts && !seeds.empty() && idle < kIdleAttempts;
         ++attempt) {
      if (options.progress) options.progress("untangle", 1.0 * attempt / options.attempts);
      const int rings = options.rings << attempt;
      const Neighbourhood around = grow(mesh, incidence, seeds, rings, is_fixed);
      if (around.nodes.empty()) break;
      Distortion distortion(mesh, result.positions, is_fixed, around, orientation);
      Points moved = minimise(distortion, options);
      ValidityReport validity = check_validity(mesh, moved, orientation);
      report.rings = rings;
      report.moved_nodes = static_cast<Index>(around.nodes.size());
      idle = validity.invalid < report.validity.invalid ? 0 : idle + 1;
      if (validity.invalid <= report.validity.invalid) {
        result.positions = std::move(moved);
        report.validity = std::move(validity);
      }
      seeds = movable(mesh, result.positions, report.validity.invalid_cells, is_fixed, orientation);
    }
  }
  report.after = report.validity.invalid;
  report.max_move = (result.positions - positions).rowwise().norm().maxCoeff();
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace cadmorph
