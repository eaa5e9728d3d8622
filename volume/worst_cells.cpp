#include "volume/worst_cells.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <iterator>
#include <numeric>
#include <span>

#include "core/parallel.h"

namespace cadmorph {
namespace {

// Of the values of cells, -1 to 1: a thousandth wide, of which the last one alone needs an order.
constexpr std::size_t kBins = 2048;

double share(double after, double base) { return base > 0 ? std::min(after / base, 1.0) : 1; }

}  // namespace

QualityReport quality_of_faces(std::vector<double> values) {
  QualityReport result;
  result.min = 1;
  for (const double value : values) {
    if (!is_measured(value)) continue;
    ++result.cells;
    result.min = std::min(result.min, value);
  }
  result.values = std::move(values);
  return result;
}

std::size_t quality_bin(double value) {
  return std::size_t(std::clamp((value + 1) / 2, 0.0, 1.0) * (kBins - 1));
}

double least_share(const WorstCells& after, const WorstCells& base) {
  return std::min(share(after.min, base.min), share(after.worst_twentieth, base.worst_twentieth));
}

double sum_of_shares(const WorstCells& after, const WorstCells& base) {
  return (base.min > 0 ? after.min / base.min : 0) +
         (base.worst_twentieth > 0 ? after.worst_twentieth / base.worst_twentieth : 0);
}

WorstCells worst_cells(const QualityReport& quality) {
  // Few values need an order: those of the bins that hold the least.
  constexpr Index kGrain = 1 << 16;
  const Index cells = std::ssize(quality.values);
  const auto chunk = [&](Index begin, Index end) {
    return std::span(quality.values).subspan(std::size_t(begin), std::size_t(end - begin));
  };
  std::array<std::atomic<std::size_t>, kBins> sizes{};
  parallel_for(cells, kGrain, [&](Index begin, Index end) {
    std::array<std::size_t, kBins> some{};
    for (const double value : chunk(begin, end))
      if (is_measured(value)) ++some[quality_bin(value)];
    for (std::size_t i = 0; i < kBins; ++i) sizes[i] += some[i];
  });
  const std::size_t measured = std::accumulate(sizes.begin(), sizes.end(), std::size_t{0});
  if (measured == 0) return {};
  const std::size_t count = std::max<std::size_t>(measured / 20, 1);
  std::size_t last = 0, held = sizes[0];
  while (held < count) held += sizes[++last];
  std::vector<double> values(held);
  std::atomic<std::size_t> next = 0;
  parallel_for(cells, kGrain, [&](Index begin, Index end) {
    std::vector<double> least;
    std::ranges::copy_if(chunk(begin, end), std::back_inserter(least), [&](double value) {
      return is_measured(value) && quality_bin(value) <= last;
    });
    std::ranges::copy(least, values.begin() + std::ptrdiff_t(next.fetch_add(least.size())));
  });
  std::ranges::nth_element(values, values.begin() + std::ptrdiff_t(count - 1));
  values.resize(count);
  std::ranges::sort(values);  // the sum in one order
  return {quality.min, std::accumulate(values.begin(), values.end(), 0.0) / double(count)};
}

WorstCells worst_faces(const FiniteVolumes& volumes, const Points& points) {
  return worst_cells(quality_of_faces(face_quality(volumes, points)));
}

}  // namespace cadmorph
