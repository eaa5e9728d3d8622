#include "apps/bench/measure.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/validity.h"

namespace cadmorph::bench {
namespace {

constexpr double kWorstShare = 0.05;  // Sieger et al. 2013, Fig. 4

}  // namespace

double mean_of_worst(std::vector<double> values) {
  std::erase_if(values, [](double v) { return std::isnan(v); });
  if (values.empty()) return 0;
  const auto count =
      static_cast<std::ptrdiff_t>(std::ceil(kWorstShare * static_cast<double>(values.size())));
  std::ranges::nth_element(values, values.begin() + count - 1);
  return std::accumulate(values.begin(), values.begin() + count, 0.0) / static_cast<double>(count);
}

double cpu_seconds() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
}

double physical_memory() {
  return static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
}

Figures measure(const Series& series, const Points& positions) {
  const QualityReport quality = measure_quality(series.mesh, positions, series.orientation);
  return {.min = quality.min,
          .mean_worst = mean_of_worst(quality.values),
          .mean = quality.mean,
          .inverted = quality.inverted,
          .invalid = check_validity(series.mesh, positions, series.orientation).invalid};
}

}  // namespace cadmorph::bench
