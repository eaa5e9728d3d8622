// Compiled without contraction of products and sums (see CMakeLists.txt).

#include "core/rbf/compact_sum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <span>
#include <utility>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

constexpr int kLanes = 8;
constexpr int kUnroll = 2;
constexpr int kTile = kUnroll * kLanes;  // targets that are summed together
typedef double Vec __attribute__((vector_size(64)));

// Targets that a thread takes at a time.
constexpr Index kGrain = 512;

#define CADMORPH_INLINE inline __attribute__((always_inline))

using Range = std::pair<Index, Index>;

// The sources near a tile of targets.
struct Task {
  const double* sources;
  Index source_stride;
  const double* weights;
  Index weight_stride;
  const Range* ranges;
  std::size_t range_count;
  double support;
};

// Vectorised by the compiler: correctly rounded whatever the width.
CADMORPH_INLINE void take_root(Vec& x) {
  double values[kLanes];
  std::memcpy(values, &x, sizeof x);
  for (int i = 0; i < kLanes; ++i) values[i] = __builtin_sqrt(values[i]);
  std::memcpy(&x, values, sizeof x);
}

// Sums for one tile of targets x (3 x kTile) and M columns into out (M x kTile). A source beyond
// the support adds zero: which of those are among the ranges makes no difference.
template <int M>
CADMORPH_INLINE void sum_tile(const Task& t, const double* x, const double* weights, double* out) {
  Vec place[kUnroll][3], sum[kUnroll][M];
  for (int u = 0; u < kUnroll; ++u) {
    for (int d = 0; d < 3; ++d) std::memcpy(&place[u][d], x + d * kTile + u * kLanes, sizeof(Vec));
    for (int m = 0; m < M; ++m) sum[u][m] = Vec{};
  }
  const double scale = 1 / t.support;
  for (std::size_t range = 0; range < t.range_count; ++range)
    for (Index j = t.ranges[range].first; j < t.ranges[range].second; ++j)
      for (int u = 0; u < kUnroll; ++u) {
        const Vec dx = place[u][0] - t.sources[j];
        const Vec dy = place[u][1] - t.sources[j + t.source_stride];
        const Vec dz = place[u][2] - t.sources[j + 2 * t.source_stride];
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

CADMORPH_INLINE void sum_columns(const Task& t, const double* x, Index columns, double* out) {
  Index m = 0;
  for (; m + 3 <= columns; m += 3)
    sum_tile<3>(t, x, t.weights + m * t.weight_stride, out + m * kTile);
  for (; m < columns; ++m) sum_tile<1>(t, x, t.weights + m * t.weight_stride, out + m * kTile);
}

void sum_plain(const Task& t, const double* x, Index columns, double* out) {
  sum_columns(t, x, columns, out);
}

// The same sums, of values that were kept: kTile for each of the sources.
struct KeptTask {
  const Index* sources;
  const double* values;
  std::size_t count;
  const double* weights;
  Index weight_stride;
};

template <int M>
CADMORPH_INLINE void sum_kept_tile(const KeptTask& t, const double* weights, double* out) {
  Vec sum[kUnroll][M];
  for (int u = 0; u < kUnroll; ++u)
    for (int m = 0; m < M; ++m) sum[u][m] = Vec{};
  for (std::size_t i = 0; i < t.count; ++i)
    for (int u = 0; u < kUnroll; ++u) {
      Vec value;
      std::memcpy(&value, t.values + i * kTile + u * kLanes, sizeof(Vec));
      for (int m = 0; m < M; ++m) sum[u][m] += value * weights[m * t.weight_stride + t.sources[i]];
    }
  for (int m = 0; m < M; ++m)
    for (int u = 0; u < kUnroll; ++u)
      std::memcpy(out + m * kTile + u * kLanes, &sum[u][m], sizeof(Vec));
}

CADMORPH_INLINE void sum_kept_columns(const KeptTask& t, Index columns, double* out) {
  Index m = 0;
  for (; m + 3 <= columns; m += 3)
    sum_kept_tile<3>(t, t.weights + m * t.weight_stride, out + m * kTile);
  for (; m < columns; ++m) sum_kept_tile<1>(t, t.weights + m * t.weight_stride, out + m * kTile);
}

void sum_kept_plain(const KeptTask& t, Index columns, double* out) {
  sum_kept_columns(t, columns, out);
}

using TileSum = void (*)(const Task&, const double*, Index, double*);
using KeptSum = void (*)(const KeptTask&, Index, double*);

#if defined(__x86_64__)
__attribute__((target("avx2"))) void sum_avx2(const Task& t, const double* x, Index columns,
                                              double* out) {
  sum_columns(t, x, columns, out);
}

__attribute__((target("avx512f"))) void sum_avx512(const Task& t, const double* x, Index columns,
                                                   double* out) {
  sum_columns(t, x, columns, out);
}

__attribute__((target("avx2"))) void sum_kept_avx2(const KeptTask& t, Index columns, double* out) {
  sum_kept_columns(t, columns, out);
}

__attribute__((target("avx512f"))) void sum_kept_avx512(const KeptTask& t, Index columns,
                                                        double* out) {
  sum_kept_columns(t, columns, out);
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

KeptSum kept_sum(simd::InstructionSet set) {
#if defined(__x86_64__)
  if (set == simd::InstructionSet::Avx512) return sum_kept_avx512;
  if (set == simd::InstructionSet::Avx2) return sum_kept_avx2;
#endif
  (void)set;
  return sum_kept_plain;
}

struct Box {
  std::array<double, 3> low, high;
};

bool is_within(const BoxTree::Node& node, const Box& box, double squared_reach) {
  double sum = 0;
  for (int d = 0; d < 3; ++d) {
    const double gap = std::max({node.low[d] - box.high[d], 0.0, box.low[d] - node.high[d]});
    sum += gap * gap;
  }
  return sum <= squared_reach;
}

// Rounding of a box's distance must not cut what is just within the support.
double squared_reach(double support) { return 1.000001 * support * support; }

// Appends the ranges of leaves within reach of a box, in the order of the tree.
void find_near(const BoxTree& tree, int id, const Box& box, double squared_reach,
               std::vector<Range>& ranges) {
  const BoxTree::Node& node = tree.nodes()[id];
  if (!is_within(node, box, squared_reach)) return;
  if (node.left >= 0) {
    find_near(tree, node.left, box, squared_reach, ranges);
    find_near(tree, node.right, box, squared_reach, ranges);
  } else if (!ranges.empty() && ranges.back().second == node.begin) {
    ranges.back().second = node.end;
  } else {
    ranges.emplace_back(node.begin, node.end);
  }
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

// Sums at targets, with the sources near each tile found by near(tile number, tile).
template <class Near>
MatrixXd CompactSum::sum(const Eigen::Ref<const MatrixXd>& targets, const MatrixXd& weights,
                         const Near& near) const {
  const Index columns = weights.cols();
  MatrixXd result(targets.rows(), columns);
  const TileSum sum_tile = tile_sum(set_);
  parallel_for(targets.rows(), kGrain, [&](Index first, Index last) {
    std::vector<Range> buffer;
    std::vector<double> values(kTile * columns);
    for (Index begin = first; begin < last; begin += kTile) {
      const Tile tile(targets, begin);
      const std::span<const Range> ranges = near(begin / kTile, tile, buffer);
      const Task task{points_->data(), points_->rows(), weights.data(), weights.rows(),
                      ranges.data(),   ranges.size(),   support_};
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
             [&](Index, const Tile& tile, std::vector<Range>& buffer) {
               buffer.clear();
               find_near(*tree_, 0, tile.box(), reach, buffer);
               return std::span<const Range>(buffer);
             });
}

CompactMatrix::CompactMatrix(const CompactSum& sum, double most_bytes) : sum_(sum) {
  const MatrixXd& points = *sum.points_;
  near_.resize((points.rows() + kTile - 1) / kTile);
  const double reach = squared_reach(sum.support_);
  parallel_for(static_cast<Index>(near_.size()), kGrain / kTile, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      find_near(*sum.tree_, 0, Tile(points, i * kTile).box(), reach, near_[i]);
  });
  if (most_bytes > 0) keep_values(most_bytes);
}

// Sources beyond the support of all points of a tile add zero, and are left out.
void CompactMatrix::keep_values(double most_bytes) {
  const MatrixXd& points = *sum_.points_;
  const double reach = squared_reach(sum_.support_), one = 1;
  const TileSum sum_tile = tile_sum(sum_.set_);
  std::vector<std::size_t> counts(near_.size(), 0);
  kept_.resize(near_.size());
  const auto for_each_tile = [&](const auto& call) {
    parallel_for(std::ssize(near_), kGrain / kTile, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) call(i, Tile(points, i * kTile));
    });
  };
  for_each_tile([&](Index i, const Tile& tile) {
    for (const auto& [begin, end] : near_[i])
      for (Index j = begin; j < end; ++j) {
        double nearest = reach;
        for (int k = 0; k < kTile; ++k) {
          double square = 0;
          for (int d = 0; d < 3; ++d) {
            const double gap = tile.x[d * kTile + k] - points(j, d);
            square += gap * gap;
          }
          nearest = std::min(nearest, square);
        }
        if (nearest < reach) kept_[i].sources.push_back(j);
      }
    counts[i] = kept_[i].sources.size();
  });
  const double entries = static_cast<double>(std::accumulate(counts.begin(), counts.end(), 0.0));
  if (entries * (kTile + 1) * sizeof(double) > most_bytes) {
    kept_.clear();
    return;
  }
  for_each_tile([&](Index i, const Tile& tile) {
    auto& [sources, values] = kept_[i];
    values.resize(sources.size() * kTile);
    for (std::size_t k = 0; k < sources.size(); ++k) {
      const Range range{0, 1};
      const Task task{points.data() + sources[k], points.rows(), &one, 1, &range, 1, sum_.support_};
      sum_tile(task, tile.x, 1, values.data() + k * kTile);
    }
  });
}

MatrixXd CompactMatrix::multiply_kept(const MatrixXd& weights) const {
  const Index columns = weights.cols(), rows = weights.rows();
  MatrixXd result(rows, columns);
  const KeptSum sum_tile = kept_sum(sum_.set_);
  parallel_for(std::ssize(kept_), kGrain / kTile, [&](Index first, Index last) {
    std::vector<double> values(kTile * columns);
    for (Index t = first; t < last; ++t) {
      const Kept& kept = kept_[t];
      sum_tile({kept.sources.data(), kept.values.data(), kept.sources.size(), weights.data(), rows},
               columns, values.data());
      const Index begin = t * kTile, count = std::min<Index>(kTile, rows - begin);
      for (Index m = 0; m < columns; ++m)
        for (Index i = 0; i < count; ++i) result(begin + i, m) = values[m * kTile + i];
    }
  });
  return result;
}

MatrixXd CompactMatrix::operator*(const Eigen::Ref<const MatrixXd>& coefficients) const {
  const MatrixXd weights = sum_.in_tree_order(coefficients);
  const MatrixXd sums = kept_.empty() ? sum_.sum(*sum_.points_, weights,
                                                 [&](Index tile, const auto&, auto&) {
                                                   return std::span<const Range>(near_[tile]);
                                                 })
                                      : multiply_kept(weights);
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
