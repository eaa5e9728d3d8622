#include "volume/follow_slides.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <utility>

#include "volume/node_cells.h"

namespace cadmorph {
namespace {

using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>;

// Layers of cells round those that suffer in which nodes follow: a wall's few cells shear over as
// many as it has times the way that they are to take.
constexpr int kLayers = 12;
// Of the weights that a node's edges had at their mean length: it draws a node back that slides, so
// that what moves is forgotten after some ten cells, but hardly within a wall of three.
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

FollowingNodes follow_neighbours(const Mesh& mesh, const Points& reference, const Points& moved,
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
  FollowingNodes result{sliding.slides, moved};
  if (count == 0) return result;
  std::vector<char> is_sliding(mesh.node_count(), 0);
  for (const Index n : sliding.nodes) is_sliding[n] = 1;
  Matrix matrix(count, count);
  RowMatrix right = RowMatrix::Zero(count, 3);
  std::vector<std::pair<Index, double>> row;  // node and weight
  for (Index i = 0; i < count; ++i) {
    const Index a = nodes[i];
    double sum = 0, squares = 0, pairs = 0;
    row.clear();
    for (const Index c : incidence.cells(a))
      for (const Index b : mesh.cell(c)) {
        const double square = (reference.row(a) - reference.row(b)).squaredNorm();
        if (square == 0) continue;
        sum += 1 / square;
        squares += square;
        ++pairs;
        if (unknown[b] < 0)
          right.row(i) += way(b) / square;
        else
          row.emplace_back(unknown[b], -1 / square);
      }
    if (is_sliding[a]) {
      // By the long edges: thin cells are to pass on what moves across them, too.
      const double back = kDrawnBack * pairs * pairs / squares;
      right.row(i) += back * way(a);
      sum += back;
    }
    row.emplace_back(i, sum);
    std::ranges::sort(row);
    matrix.startVec(i);
    for (std::size_t k = 0; k < row.size();) {
      const Index j = row[k].first;
      double& entry = matrix.insertBack(i, j);
      for (entry = 0; k < row.size() && row[k].first == j; ++k) entry += row[k].second;
    }
  }
  matrix.finalize();
  Eigen::ConjugateGradient<
      Matrix, Eigen::Lower | Eigen::Upper,
      Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::NaturalOrdering<Index>>>
      solver;
  solver.setTolerance(kAccuracy);
  solver.setMaxIterations(kMostIterations);
  solver.compute(matrix);
  Eigen::MatrixX3d ways(count, 3);
  for (Index i = 0; i < count; ++i) ways.row(i) = way(nodes[i]);
  right -= matrix * ways;  // solved for what changes, which the accuracy is a part of
  for (int k = 0; k < 3; ++k) ways.col(k) += solver.solve(right.col(k));
  for (Index i = 0; i < count; ++i)
    if (!is_sliding[nodes[i]])
      result.positions.row(nodes[i]) = reference.row(nodes[i]) + ways.row(i);
  for (Index i = 0; i < std::ssize(sliding.nodes); ++i) {
    const Index n = sliding.nodes[i];
    if (unknown[n] < 0) continue;
    const Eigen::RowVector2d slide = sliding.slides.row(i);
    const SlidePlace place = sliding.at(i, slide.transpose());
    const Eigen::RowVector2d step = (ways.row(unknown[n]) - way(n)) * place.tangents;
    if (!sliding.is_within(i, (slide + step).transpose())) continue;
    result.slides.row(i) += step;
    result.positions.row(n) = sliding.at(i, result.slides.row(i).transpose()).point;
  }
  return result;
}

}  // namespace cadmorph
