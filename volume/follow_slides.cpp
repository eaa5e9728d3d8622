#include "volume/follow_slides.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <utility>

#include "core/least_squares.h"
#include "core/parallel.h"
#include "volume/node_cells.h"

namespace cadmorph {
namespace {

using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>;

// A node that goes along its surface alone.
struct Slider {
  Index node, slide;                     ///< SlidingNodes::slides' row
  Eigen::Matrix<double, 2, 3> to_slide;  ///< the slide that comes nearest to a step
  Eigen::Matrix3d along;                 ///< what of a step is along the surface
};

// Nodes that slide are drawn back with this weight, over the square of the reach, times the sum of
// the weights that their edges would have at their mean length. In a wall of one layer of cubes a
// motion then falls to a fifth within the reach: by e^-1.6. With half or twice of it 2 of 5 pairs
// come out the same, the others keep 0.1 % less to 27 % more of the smallest scaled Jacobian.
constexpr double kDrawnBack = 0.72;
// Of what changes. With 1e-4 or 1e-6, 2 of 5 pairs come out the same, the others keep up to 5 %
// more of the smallest, and up to 3 % less of the worst twentieth: neither is better in all.
constexpr double kAccuracy = 1e-5;
constexpr int kMostIterations = 300;  // 15 to 50 are usual
constexpr Index kRowsAtOnce = 8192;   // of the matrix, found before they go into it: some 10 MB

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

// Solves A x = b (count x 3) by preconditioned conjugate gradients, among those x whose rows at
// `sliders` are along their surfaces.
RowMatrix solve_along(const Matrix& a, const RowMatrix& b, const std::vector<Slider>& sliders) {
  const auto project = [&](RowMatrix x) {
    for (const Slider& slider : sliders) x.row(slider.node) *= slider.along;
    return x;
  };
  const Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::NaturalOrdering<Index>> factor(a);
  RowMatrix x = RowMatrix::Zero(b.rows(), 3), residual = project(b);
  const double allowed = kAccuracy * residual.norm();
  RowMatrix direction = RowMatrix::Zero(b.rows(), 3);
  double before = 1;
  for (int k = 0; k < kMostIterations && residual.norm() > allowed; ++k) {
    const RowMatrix z = project(factor.solve(residual));
    const double now = residual.cwiseProduct(z).sum();
    direction = z + now / before * direction;
    const RowMatrix image = project(a * direction);
    const double step = now / direction.cwiseProduct(image).sum();
    x += step * direction;
    residual -= step * image;
    before = now;
  }
  return x;
}

}  // namespace

FollowingNodes follow_neighbours(const Mesh& mesh, const Points& reference, const Points& moved,
                                 const std::vector<char>& is_fixed, const SlidingNodes& sliding,
                                 const Surroundings& around) {
  const NodeCells incidence(mesh);
  const std::vector<Index> near = grow(mesh, incidence, around.cells, around.reach);
  std::vector<char> is_near(mesh.cell_count(), 0);
  for (const Index c : near) is_near[c] = 1;
  std::vector<Index> nodes, unknown(mesh.node_count(), -1);
  for (Index n = 0; n < mesh.node_count(); ++n) {
    const auto own = incidence.cells(n);
    if (is_fixed[n] || own.empty() ||
        !std::ranges::all_of(own, [&](Index c) { return is_near[c]; }))
      continue;
    unknown[n] = std::ssize(nodes);
    nodes.push_back(n);
  }
  const auto way = [&](Index n) -> Eigen::RowVector3d { return moved.row(n) - reference.row(n); };
  const Index count = std::ssize(nodes);
  FollowingNodes result{sliding.slides, moved};
  if (count == 0) return result;
  std::vector<char> does_slide(count, 0);
  std::vector<Slider> sliders;
  for (Index i = 0; i < std::ssize(sliding.nodes); ++i) {
    const Index a = unknown[sliding.nodes[i]];
    if (a < 0) continue;
    does_slide[a] = 1;
    const auto tangents = sliding.at(i, sliding.slides.row(i).transpose()).tangents;
    const Eigen::Matrix<double, 2, 3> to_slide =
        small_least_squares(tangents, Eigen::Matrix3d::Identity());
    sliders.push_back({a, i, to_slide, tangents * to_slide});
  }
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
    if (does_slide[i]) sum += kDrawnBack / (around.reach * around.reach) * pairs * pairs / squares;
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
  Matrix matrix(count, count);
  RowMatrix pulls(count, 3);
  std::vector<Row> rows(kRowsAtOnce);
  for (Index from = 0; from < count; from += kRowsAtOnce) {
    const Index to = std::min(from + kRowsAtOnce, count);
    parallel_for(to - from, 256, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) rows[i] = row_of(from + i);
    });
    for (Index i = from; i < to; ++i) {
      pulls.row(i) = rows[i - from].pull;
      matrix.startVec(i);
      for (const auto& [j, weight] : rows[i - from].weights) matrix.insertBack(i, j) = weight;
    }
  }
  matrix.finalize();
  const RowMatrix steps = solve_along(matrix, pulls, sliders);
  for (Index i = 0; i < count; ++i)
    if (!does_slide[i]) result.positions.row(nodes[i]) += steps.row(i);
  for (const Slider& slider : sliders) {
    const Eigen::Vector2d slide = sliding.slides.row(slider.slide).transpose() +
                                  slider.to_slide * steps.row(slider.node).transpose();
    if (!sliding.is_within(slider.slide, slide)) continue;
    result.slides.row(slider.slide) = slide;
    result.positions.row(nodes[slider.node]) = sliding.at(slider.slide, slide).point;
  }
  return result;
}

}  // namespace cadmorph
