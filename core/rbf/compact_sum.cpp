// Compiled without contraction of products and sums (see CMakeLists.txt).

#include "core/rbf/compact_sum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

#include "core/parallel.h"
#include "core/rbf/tile_sum.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// Targets that a thread takes at a time.
constexpr Index kGrain = 512;

// Wendland's kernel of the sources near a tile of targets. A source beyond the support adds zero:
// which of those are among the sources makes no difference.
struct NearKernel {
  std::span<const Index> sources;
  double scale;  // one over the support

  Index source_count() const { return std::ssize(sources); }
  Index source(Index i) const { return sources[std::size_t(i)]; }

  template <class Vec>
  CADMORPH_INLINE void evaluate(Vec& r) const {
    take_root(r);
    r *= scale;
    Vec rest = 1 - r;
    rest = rest > 0 ? rest : Vec{};
    const Vec square = rest * rest;
    r = square * square * (4 * r + 1);
  }
};

struct Box {
  std::array<double, 3> low, high;
};

// Squared distance of two boxes; a point is a box, too.
double squared_gap(const double* low, const double* high, const Box& box) {
  double sum = 0;
  for (int d = 0; d < 3; ++d) {
    const double gap = std::max({low[d] - box.high[d], 0.0, box.low[d] - high[d]});
    sum += gap * gap;
  }
  return sum;
}

// Rounding of a box's distance must not cut what is just within the support.
double squared_reach(double support) { return 1.000001 * support * support; }

// Appends the positions of the points within reach of a box, in the order of the tree.
void find_near(const BoxTree& tree, int id, const Box& box, double squared_reach,
               std::vector<Index>& sources) {
  const BoxTree::Node& node = tree.nodes()[id];
  if (squared_gap(node.low.data(), node.high.data(), box) > squared_reach) return;
  if (node.left >= 0) {
    find_near(tree, node.left, box, squared_reach, sources);
    find_near(tree, node.right, box, squared_reach, sources);
    return;
  }
  for (Index j = node.begin; j < node.end; ++j)
    if (squared_gap(tree.point(j), tree.point(j), box) <= squared_reach) sources.push_back(j);
}

Box box_of(const TargetTile& tile) {
  Box result{};
  for (int d = 0; d < 3; ++d) {
    const auto [low, high] = std::minmax_element(tile.x + d * kTile, tile.x + (d + 1) * kTile);
    result.low[d] = *low;
    result.high[d] = *high;
  }
  return result;
}

// Spreads the lowest 21 bits to every third.
std::uint64_t spread(std::uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

}  // namespace

CompactSum::CompactSum(const Points& points, double support, simd::InstructionSet set)
    : tree_(std::make_shared<const BoxTree>(points, points.rows())),
      support_(support),
      set_(std::min(set, simd::best())) {
  points_ = std::make_shared<const MatrixXd>(in_tree_order(MatrixXd(points)));
}

CompactSum CompactSum::with_support(double support) const {
  CompactSum result = *this;
  result.support_ = support;
  return result;
}

MatrixXd CompactSum::in_tree_order(const Eigen::Ref<const MatrixXd>& rows) const {
  MatrixXd result(rows.rows(), rows.cols());
  for (Index i = 0; i < rows.rows(); ++i) result.row(i) = rows.row(tree_->row(i));
  return result;
}

// Sums at targets, with the sources near each tile found by near(tile number, tile, buffer).
template <class Near>
MatrixXd CompactSum::sum(const Eigen::Ref<const MatrixXd>& targets, const MatrixXd& weights,
                         const Near& near) const {
  const Index columns = weights.cols();
  MatrixXd result(targets.rows(), columns);
  const WeightedPoints from{points_->data(), points_->rows(), weights.data(), weights.rows()};
  parallel_for(targets.rows(), kGrain, [&](Index first, Index last) {
    std::vector<Index> buffer;
    std::vector<double> values(kTile * columns);
    for (Index begin = first; begin < last; begin += kTile) {
      const TargetTile tile(targets, begin);
      const NearKernel kernel{near(begin / kTile, tile, buffer), 1 / support_};
      sum_tile(set_, kernel, from, tile, columns, values.data());
      for (Index m = 0; m < columns; ++m)
        for (Index i = 0; i < tile.count; ++i) result(begin + i, m) = values[m * kTile + i];
    }
  });
  return result;
}

MatrixXd CompactSum::operator()(const Eigen::Ref<const MatrixXd>& targets,
                                const Eigen::Ref<const MatrixXd>& coefficients) const {
  const double reach = squared_reach(support_);
  return sum(targets, in_tree_order(coefficients),
             [&](Index, const TargetTile& tile, std::vector<Index>& buffer) {
               buffer.clear();
               find_near(*tree_, 0, box_of(tile), reach, buffer);
               return std::span<const Index>(buffer);
             });
}

CompactMatrix::CompactMatrix(const CompactSum& sum) : sum_(sum) {
  const MatrixXd& points = *sum.points_;
  near_.resize((points.rows() + kTile - 1) / kTile);
  const double reach = squared_reach(sum.support_);
  parallel_for(static_cast<Index>(near_.size()), kGrain / kTile, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      find_near(*sum.tree_, 0, box_of(TargetTile(points, i * kTile)), reach, near_[i]);
  });
}

MatrixXd CompactMatrix::operator*(const Eigen::Ref<const MatrixXd>& coefficients) const {
  const MatrixXd sums =
      sum_.sum(*sum_.points_, sum_.in_tree_order(coefficients),
               [&](Index tile, const auto&, auto&) { return std::span<const Index>(near_[tile]); });
  MatrixXd result(sums.rows(), sums.cols());
  for (Index i = 0; i < sums.rows(); ++i) result.row(sum_.tree_->row(i)) = sums.row(i);
  return result;
}

std::vector<Index> spatial_order(const Eigen::Ref<const MatrixXd>& points) {
  if (points.rows() == 0) return {};
  const Eigen::RowVector3d low = points.colwise().minCoeff();
  const double extent = (points.colwise().maxCoeff() - low).maxCoeff();
  const double scale = extent > 0 ? 0x1p21 * (1 - 0x1p-50) / extent : 0;
  std::vector<std::pair<std::uint64_t, Index>> keys(points.rows());
  parallel_for(points.rows(), 4096, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      std::uint64_t key = 0;
      for (int d = 0; d < 3; ++d)
        key |= spread(static_cast<std::uint64_t>((points(i, d) - low(d)) * scale)) << d;
      keys[i] = {key, i};
    }
  });
  std::sort(keys.begin(), keys.end());
  std::vector<Index> rows(keys.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = keys[i].second;
  return rows;
}

}  // namespace cadmorph
