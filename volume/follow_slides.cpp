#include "volume/follow_slides.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <utility>

#include "volume/node_cells.h"

namespace cadmorph {
namespace {

// Layers of cells round those that suffer in which nodes follow: a wall's few cells shear over as
// many as it has times the way that they are to take.
constexpr int kLayers = 12;
// Of the sum of a node's weights: it draws a node back that slides, so that what moves is forgotten
// after some ten cells, but hardly within a wall of three.
constexpr double kDrawnBack = 0.005;
// A start is looked for, no solution.
constexpr double kAccuracy = 1e-3;
constexpr int kMostIterations = 300;

std::vector<Index> grow(const Mesh& mesh, const NodeCells& incidence, std::vector<Index> cells) {
  std::vector<char> has_cell(mesh.cell_count(), 0);
  for (const Index c : cells) has_cell[c] = 1;
  std::size_t first = 0;
  for (int layer = 0; layer < kLayers; ++layer) {
    const std::size_t last = cells.size();
    for (; first < last; ++first)
      for (const Index node : mesh.cell(cells[first]))
        for (const Index c : incidence.cells(node))
          if (!std::exchange(has_cell[c], 1)) cells.push_back(c);
  }
  return cells;
}

}  // namespace

RowMatrix follow_neighbours(const Mesh& mesh, const Points& reference, const Points& moved,
                            const std::vector<char>& is_fixed, const SlidingNodes& sliding,
                            const std::vector<Index>& cells) {
  const NodeCells incidence(mesh);
  const std::vector<Index> near = grow(mesh, incidence, cells);
  std::vector<char> is_near(mesh.cell_count(), 0);
  for (const Index c : near) is_near[c] = 1;
  std::vector<Index> nodes, unknown(mesh.node_count(), -1);
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const auto around = incidence.cells(n);
    if (is_fixed[n] || around.empty() ||
        !std::ranges::all_of(around, [&](Index c) { return is_near[c]; }))
      continue;
    unknown[n] = std::ssize(nodes);
    nodes.push_back(n);
  }
  const auto way = [&](Index n) -> Eigen::RowVector3d { return moved.row(n) - reference.row(n); };
  const Index count = std::ssize(nodes);
  std::vector<Eigen::Triplet<double>> terms;
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(count);
  RowMatrix right = RowMatrix::Zero(count, 3);
  const auto add = [&](Index a, Index b, double weight) {
    if (unknown[a] < 0) return;
    weights[unknown[a]] += weight;
    if (unknown[b] < 0)
      right.row(unknown[a]) += weight * way(b);
    else
      terms.emplace_back(unknown[a], unknown[b], -weight);
  };
  for (const Index c : near) {
    const auto of_cell = mesh.cell(c);
    for (std::size_t i = 0; i < of_cell.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) {
        const Index a = of_cell[i], b = of_cell[j];
        const double square = (reference.row(a) - reference.row(b)).squaredNorm();
        if (square == 0 || (unknown[a] < 0 && unknown[b] < 0)) continue;
        add(a, b, 1 / square);
        add(b, a, 1 / square);
      }
  }
  RowMatrix slides = sliding.slides;
  for (const Index n : sliding.nodes)
    if (const Index i = unknown[n]; i >= 0) {
      const double back = kDrawnBack * weights[i];
      weights[i] += back;
      right.row(i) += back * way(n);
    }
  if (count == 0) return slides;
  for (Index i = 0; i < count; ++i) terms.emplace_back(i, i, weights[i]);
  Eigen::SparseMatrix<double> matrix(count, count);
  matrix.setFromTriplets(terms.begin(), terms.end());
  terms = {};
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver;
  solver.setTolerance(kAccuracy);
  solver.setMaxIterations(kMostIterations);
  solver.compute(matrix);
  Eigen::MatrixX3d ways(count, 3);
  for (Index i = 0; i < count; ++i) ways.row(i) = way(nodes[i]);
  for (int k = 0; k < 3; ++k)
    ways.col(k) = solver.solveWithGuess(right.col(k), Eigen::VectorXd(ways.col(k)));
  for (Index i = 0; i < std::ssize(sliding.nodes); ++i) {
    const Index n = sliding.nodes[i];
    if (unknown[n] < 0) continue;
    const Eigen::RowVector2d slide = slides.row(i);
    const SlidePlace place = sliding.at(i, slide.transpose());
    const Eigen::RowVector2d step = (ways.row(unknown[n]) - way(n)) * place.tangents;
    if (sliding.is_within(i, (slide + step).transpose())) slides.row(i) += step;
  }
  return slides;
}

}  // namespace cadmorph
