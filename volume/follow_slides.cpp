#include "volume/follow_slides.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <utility>

#include "core/parallel.h"
#include "volume/node_cells.h"

namespace cadmorph {
namespace {

using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>;

// Directions that a node can go, unit vectors, a column each.
using Ways = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>;

// Over the square of the reach, of the weights that a node's edges had at their mean length: it
// draws a node back that slides, so that what moves is forgotten there.
constexpr double kDrawnBack = 0.72;
constexpr double kAccuracy = 1e-5;  // of what changes
constexpr int kMostIterations = 300;
constexpr Index kRowsAtOnce = 8192;  // of the matrix, found before they go into it

std::vector<Index> grow(const Mesh& mesh, const NodeCells& incidence, std::vector<Index> cells,
                        int layers) {
  std::vector<char> has_cell(mesh.cell_count(), 0);
  for (const Index c : cells) has_cell[c] = 1;
  std::size_t first = 0;
  for (int layer = 0; layer < layers; ++layer) {
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
                                 const std::vector<Index>& cells, int reach) {
  const NodeCells incidence(mesh);
  const std::vector<Index> near = grow(mesh, incidence, cells, reach);
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
  // Nodes that slide go along their surfaces alone.
  std::vector<Ways> ways(count, Ways{Eigen::Matrix3d::Identity()});
  std::vector<Index> slider(count, -1), first(count + 1, 0);
  for (Index i = 0; i < std::ssize(sliding.nodes); ++i) {
    const Index a = unknown[sliding.nodes[i]];
    if (a < 0) continue;
    slider[a] = i;
    const auto tangents = sliding.at(i, sliding.slides.row(i).transpose()).tangents;
    ways[a] = tangents.leftCols(tangents.col(1).isZero(0) ? 1 : 2);
  }
  for (Index i = 0; i < count; ++i) first[i + 1] = first[i] + ways[i].cols();
  struct Row {
    std::vector<std::pair<Index, double>> weights;  // by node, ascending; its own one among them
    Eigen::RowVector3d pull;
  };
  const auto row_of = [&](Index i) {
    const Index a = nodes[i];
    double sum = 0, squares = 0, pairs = 0;
    Row row{{}, Eigen::RowVector3d::Zero()};
    for (const Index c : incidence.cells(a))
      for (const Index b : mesh.cell(c)) {
        const double square = (reference.row(a) - reference.row(b)).squaredNorm();
        if (square == 0) continue;
        sum += 1 / square;
        squares += square;
        ++pairs;
        row.pull += (way(b) - way(a)) / square;
        if (unknown[b] >= 0) row.weights.emplace_back(unknown[b], -1 / square);
      }
    // By the long edges: thin cells are to pass on what moves across them, too.
    if (slider[i] >= 0) sum += kDrawnBack / (reach * reach) * pairs * pairs / squares;
    row.weights.emplace_back(i, sum);
    std::ranges::sort(row.weights);
    std::size_t last = 0;
    for (std::size_t k = 1; k < row.weights.size(); ++k)
      if (row.weights[k].first == row.weights[last].first)
        row.weights[last].second += row.weights[k].second;
      else
        row.weights[++last] = row.weights[k];
    row.weights.resize(last + 1);
    return row;
  };
  Matrix matrix(first[count], first[count]);
  Eigen::VectorXd right(first[count]);
  std::vector<Row> rows(kRowsAtOnce);
  for (Index from = 0; from < count; from += kRowsAtOnce) {
    const Index to = std::min(from + kRowsAtOnce, count);
    parallel_for(to - from, 256, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) rows[i] = row_of(from + i);
    });
    for (Index i = from; i < to; ++i)
      for (Index k = 0; k < ways[i].cols(); ++k) {
        right(first[i] + k) = rows[i - from].pull * ways[i].col(k);
        matrix.startVec(first[i] + k);
        for (const auto& [j, weight] : rows[i - from].weights)
          for (Index l = 0; l < ways[j].cols(); ++l) {
            const double part = i == j ? double(k == l) : ways[i].col(k).dot(ways[j].col(l));
            if (part != 0) matrix.insertBack(first[i] + k, first[j] + l) = part * weight;
          }
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
  const Eigen::VectorXd steps = solver.solve(right);
  for (Index i = 0; i < count; ++i) {
    const Eigen::VectorXd step = steps.segment(first[i], ways[i].cols());
    const Index node = nodes[i], s = slider[i];
    if (s < 0) {
      result.positions.row(node) += step.transpose();
      continue;
    }
    Eigen::Vector2d slide = sliding.slides.row(s);
    slide.head(step.size()) += step;
    if (!sliding.is_within(s, slide)) continue;
    result.slides.row(s) = slide;
    result.positions.row(node) = sliding.at(s, slide).point;
  }
  return result;
}

}  // namespace cadmorph
