#include "volume/baselines/lbwarp.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/errors.h"
#include "core/parallel.h"
#include "volume/baselines/interior_system.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kMostSteps = 100;  // of Newton's method: few where the node is in the hull
// Newton decrement at which the weights are exact to rounding: the error after is its square.
constexpr double kDecrement = 1e-9;

// The weights, or nothing when the dual has no minimum: the node is not inside the hull.
std::optional<VectorXd> weights_inside(const Points& offsets) {
  const Index k = offsets.rows();
  const double length = k == 0 ? 0 : offsets.rowwise().norm().maxCoeff();
  if (k < 4 || length == 0) return std::nullopt;
  const Points scaled = offsets / length;
  Vector3d y = Vector3d::Zero();
  for (int step = 0; step < kMostSteps; ++step) {
    const VectorXd w = (scaled * y).array() + static_cast<double>(k);
    const Points ratios = w.cwiseInverse().asDiagonal() * scaled;
    const Vector3d descent = ratios.colwise().sum();
    const Eigen::LDLT<Matrix3d> hessian(Matrix3d(ratios.transpose() * ratios));
    const Vector3d newton = hessian.solve(descent);
    const double decrement = std::sqrt(std::max(0.0, descent.dot(newton)));
    if (!newton.allFinite()) return std::nullopt;
    // Self-concordant: the damped step stays inside the domain and converges; below 1/4 whole steps
    // converge quadratically (Boyd, Vandenberghe: Convex Optimization, 2004, sect. 9.6).
    y += newton / (decrement > 0.25 ? 1 + decrement : 1);
    if (decrement > kDecrement) continue;
    VectorXd result = ((scaled * y).array() + static_cast<double>(k)).inverse();
    return VectorXd(result / result.sum());
  }
  return std::nullopt;
}

// Nodes around each node, ascending.
using Neighbours = std::vector<std::vector<Index>>;

void sort_each(Neighbours& neighbours) {
  for (auto& of : neighbours) {
    std::ranges::sort(of);
    of.erase(std::unique(of.begin(), of.end()), of.end());
  }
}

void require_linear(const Mesh& mesh, Index c) {
  const CellType type = mesh.types[c];
  if (type >= CellType::QuadraticEdge && type < CellType::Polyhedron)
    throw InvalidInputError("LBWARP knows linear cells and polyhedra; cell " + std::to_string(c) +
                            " is quadratic (VTK type " + std::to_string(static_cast<int>(type)) +
                            ")");
}

Neighbours edge_neighbours(const Mesh& mesh) {
  Neighbours result(mesh.node_count());
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 3) continue;
    require_linear(mesh, c);
    for (const Facet& facet : cell_facets(mesh, c))
      for (std::size_t i = 0; i < facet.nodes.size(); ++i) {
        const Index a = facet.nodes[i], b = facet.nodes[(i + 1) % facet.nodes.size()];
        if (a == b) continue;
        result[a].push_back(b);
        result[b].push_back(a);
      }
  }
  sort_each(result);
  return result;
}

// Nodes that share a cell with each of the nodes asked for.
Neighbours cell_neighbours(const Mesh& mesh, const std::vector<char>& is_asked) {
  Neighbours result(mesh.node_count());
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (const Index a : mesh.cell(c))
      if (is_asked[a])
        for (const Index b : mesh.cell(c))
          if (a != b) result[a].push_back(b);
  sort_each(result);
  return result;
}

std::optional<VectorXd> node_weights(const Mesh& mesh, Index node,
                                     const std::vector<Index>& neighbours) {
  Points offsets(neighbours.size(), 3);
  for (std::size_t i = 0; i < neighbours.size(); ++i)
    offsets.row(i) = mesh.points.row(neighbours[i]) - mesh.points.row(node);
  return weights_inside(offsets);
}

// Rows u_i - sum_j w_ij u_j of the free nodes.
class Rows {
 public:
  Rows(const Mesh& mesh, const std::vector<Index>& surface_nodes)
      : mesh_(mesh), is_open_(mesh.node_count(), 1) {
    for (const Index node : surface_nodes) is_open_[node] = 0;
    take(edge_neighbours(mesh));
    if (std::ranges::count(is_open_, 1) > 0) take(cell_neighbours(mesh, is_open_));
    const auto left = std::ranges::find(is_open_, 1);
    if (left != is_open_.end())
      throw SolverError("LBWARP: node " + std::to_string(left - is_open_.begin()) +
                        " of the base mesh is not inside the hull of its neighbours, so that it "
                        "has no positive weights; use another method");
  }

  const std::vector<MatrixEntry>& entries() const { return entries_; }

 private:
  // Weights of all open nodes for which there are any; nodes of no cell need none.
  void take(const Neighbours& neighbours) {
    std::vector<std::optional<VectorXd>> weights(is_open_.size());
    parallel_for(mesh_.node_count(), 1000, [&](Index begin, Index end) {
      for (Index n = begin; n < end; ++n)
        if (is_open_[n]) weights[n] = node_weights(mesh_, n, neighbours[n]);
    });
    for (Index n = 0; n < mesh_.node_count(); ++n) {
      if (is_open_[n] && neighbours[n].empty()) is_open_[n] = 0;
      if (!weights[n]) continue;
      is_open_[n] = 0;
      entries_.emplace_back(n, n, 1.0);
      for (std::size_t j = 0; j < neighbours[n].size(); ++j)
        entries_.emplace_back(n, neighbours[n][j], -(*weights[n])[j]);
    }
  }

  const Mesh& mesh_;
  std::vector<char> is_open_;  // without weights yet
  std::vector<MatrixEntry> entries_;
};

class Lbwarp final : public Baseline {
 public:
  Lbwarp(const Mesh& mesh, const std::vector<Index>& surface_nodes)
      : system_(mesh.node_count(), surface_nodes, Rows(mesh, surface_nodes).entries(),
                InteriorSystem::Symmetry::General) {}

  Points displacements(const Points& surface) const override { return system_.solve(surface); }

 private:
  InteriorSystem system_;
};

}  // namespace

VectorXd log_barrier_weights(const Points& offsets) {
  auto weights = weights_inside(offsets);
  if (!weights)
    throw SolverError("no log-barrier weights: the node is not inside the hull of its neighbours");
  return *weights;
}

std::unique_ptr<Baseline> make_lbwarp(const Mesh& mesh, const std::vector<Index>& surface_nodes) {
  return std::make_unique<Lbwarp>(mesh, surface_nodes);
}

}  // namespace cadmorph
