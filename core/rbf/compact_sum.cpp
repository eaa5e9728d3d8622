// Compiled without contraction of products and sums (see CMakeLists.txt).

#include "core/rbf/compact_sum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include "core/parallel.h"
#include "core/rbf/register.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

constexpr int kTile = 16;  // targets that are summed together

// Targets that a thread takes at a time.
constexpr Index kGrain = 512;

// The sources near a tile of targets.
struct Task {
  const double* points;
  Index point_stride;
  const double* weights;
  Index weight_stride;
  std::span<const Index> sources;
  double support;
};

// Sums for one tile of targets x (3 x kTile) and M columns into out (M x kTile). A source beyond
// the support adds zero: which of those are among the sources makes no difference.
template <int Bytes, int M>
CADMORPH_INLINE void sum_tile(const Task& t, const double* x, const double* weights, double* out) {
  using Vec = typename Register<Bytes>::Vec;
  constexpr int kLanes = Register<Bytes>::kLanes, kUnroll = kTile / kLanes;
  Vec place[kUnroll][3], sum[kUnroll][M];
  for (int u = 0; u < kUnroll; ++u) {
    for (int d = 0; d < 3; ++d) std::memcpy(&place[u][d], x + d * kTile + u * kLanes, sizeof(Vec));
    for (int m = 0; m < M; ++m) sum[u][m] = Vec{};
  }
  const double scale = 1 / t.support;
  for (const Index j : t.sources)
    for (int u = 0; u < kUnroll; ++u) {
      const Vec dx = place[u][0] - t.points[j];
      const Vec dy = place[u][1] - t.points[j + t.point_stride];
      const Vec dz = place[u][2] - t.points[j + 2 * t.point_stride];
      Vec r = dx * dx + dy * dy + dz * dz;
      take_root(r);
      r *= scale;
      Vec rest = 1 - r;
      rest = rest > 0 ? rest : Vec{};
      const Vec square = rest * rest;
      const Vec value = square * square * (4 * r + 1);
      for (int m = 0; m < M; ++m) sum[u][m] += value * weights[m * t.weight_stride + j];
    }
  for (int m = 0; m < M; ++m)
    for (int u = 0; u < kUnroll; ++u)
      std::memcpy(out + m * kTile + u * kLanes, &sum[u][m], sizeof(Vec));
}

template <int Bytes>
CADMORPH_INLINE void sum_columns(const Task& t, const double* x, Index columns, double* out) {
  Index m = 0;
  for (; m + 3 <= columns; m += 3)
    sum_tile<Bytes, 3>(t, x, t.weights + m * t.weight_stride, out + m * kTile);
  for (; m < columns; ++m)
    sum_tile<Bytes, 1>(t, x, t.weights + m * t.weight_stride, out + m * kTile);
}

void sum_plain(const Task& t, const double* x, Index columns, double* out) {
  sum_columns<16>(t, x, columns, out);
}

using TileSum = void (*)(const Task&, const double*, Index, double*);

#if defined(__x86_64__)
__attribute__((target("avx2"))) void sum_avx2(const Task& t, const double* x, Index columns,
                                              double* out) {
  sum_columns<32>(t, x, columns, out);
}

__attribute__((target("avx512f"))) void sum_avx512(const Task& t, const double* x, Index columns,
                                                   double* out) {
  sum_columns<64>(t, x, columns, out);
}
#endif

TileSum tile_sum(simd::InstructionSet set) {
#if defined(__x86_64__)
  if (set == simd::InstructionSet::Avx512) return sum_avx512;
  if (set == simd::InstructionSet::Avx2) return sum_avx2;
#endif
  (void)set;
  return sum_plain;
}

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

// A tile of targets. The last one is filled up: every target goes through the same instructions.
struct Tile {
  Tile(const Eigen::Ref<const MatrixXd>& targets, Index begin)
      : count(std::min<Index>(kTile, targets.rows() - begin)) {
    for (int d = 0; d < 3; ++d)
      for (Index i = 0; i < kTile; ++i)
        x[d * kTile + i] = targets(begin + std::min(i, count - 1), d);
  }

  Box box() const {
    Box result{};
    for (int d = 0; d < 3; ++d) {
      const auto [low, high] = std::minmax_element(x + d * kTile, x + (d + 1) * kTile);
      result.low[d] = *low;
      result.high[d] = *high;
    }
    return result;
  }

  Index count;
  double x[3 * kTile];
};

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
  const TileSum sum_tile = tile_sum(set_);
  parallel_for(targets.rows(), kGrain, [&](Index first, Index last) {
    std::vector<Index> buffer;
    std::vector<double> values(kTile * columns);
    for (Index begin = first; begin < last; begin += kTile) {
      const Tile tile(targets, begin);
      const Task task{points_->data(),
                      points_->rows(),
                      weights.data(),
                      weights.rows(),
                      near(begin / kTile, tile, buffer),
                      support_};
      sum_tile(task, tile.x, columns, values.data());
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
             [&](Index, const Tile& tile, std::vector<Index>& buffer) {
               buffer.clear();
               find_near(*tree_, 0, tile.box(), reach, buffer);
               return std::span<const Index>(buffer);
             });
}

CompactMatrix::CompactMatrix(const CompactSum& sum) : sum_(sum) {
  const MatrixXd& points = *sum.points_;
  near_.resize((points.rows() + kTile - 1) / kTile);
  const double reach = squared_reach(sum.support_);
  parallel_for(static_cast<Index>(near_.size()), kGrain / kTile, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      find_near(*sum.tree_, 0, Tile(points, i * kTile).box(), reach, near_[i]);
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
