#include "apps/pipeline/morph_details.h"

#include <algorithm>
#include <cmath>

#include "apps/pipeline/nearest_face.h"

namespace cadmorph {
namespace {

std::size_t bin_of(double value, double low, double high, std::size_t bins) {
  const double position = (value - low) / (high - low) * static_cast<double>(bins);
  return static_cast<std::size_t>(std::clamp(position, 0.0, static_cast<double>(bins) - 1));
}

std::vector<Index> count(const std::vector<double>& values, double low, double high, int bins) {
  std::vector<Index> counts(bins, 0);
  for (const double value : values)
    if (!std::isnan(value)) ++counts[bin_of(value, low, high, counts.size())];
  return counts;
}

// From 0, or from -1 where there are negative values, to 1: histograms of several meshes compare.
Histogram jacobian_histogram(const QualityReport& before, const QualityReport& after, int bins) {
  Histogram result;
  result.low = std::min(before.min, after.min) < 0 ? -1 : 0;
  result.before = count(before.values, result.low, result.high, bins);
  result.after = count(after.values, result.low, result.high, bins);
  return result;
}

// Logarithms of the distances of nodes on CAD entities that are at least `least`.
std::vector<double> deviations(const Association& association, const Eigen::VectorXd& distance,
                               double least) {
  std::vector<double> result;
  for (const RowId i : association.dimension.ids())
    if (association.dimension[i] != CadDimension::None && distance[i] >= least)
      result.push_back(std::log10(distance[i]));
  return result;
}

void fill_deviation(MorphDetails& details, const MorphResult& result,
                    const DetailOptions& options) {
  const Association& association = result.base->association();
  const double largest = std::max(association.max_distance, result.report.after.max_distance);
  const auto before = deviations(association, association.distance, options.least_deviation);
  const auto after = deviations(association, result.surface.distance, options.least_deviation);
  const Index matched = association.vertex_nodes + association.edge_nodes + association.face_nodes;
  details.exact_before = matched - static_cast<Index>(before.size());
  details.exact_after = matched - static_cast<Index>(after.size());
  Histogram& bins = details.deviation;
  bins.low = std::round(std::log10(options.least_deviation));
  bins.high = std::max(bins.low + 1, std::ceil(std::log10(std::max(largest, 1e-300))));
  const int bin_count = static_cast<int>(bins.high - bins.low) * options.bins_per_decade;
  bins.before = count(before, bins.low, bins.high, bin_count);
  bins.after = count(after, bins.low, bins.high, bin_count);
}

// Ids of the measured cells with the smallest scaled Jacobians, worst first, equal ones by id.
std::vector<Index> worst_cells(const QualityReport& quality, Index count) {
  std::vector<Index> cells;
  for (Index c = 0; c < static_cast<Index>(quality.values.size()); ++c)
    if (!std::isnan(quality.values[c])) cells.push_back(c);
  const auto end = cells.begin() + std::min<Index>(count, static_cast<Index>(cells.size()));
  std::partial_sort(cells.begin(), end, cells.end(), [&](Index a, Index b) {
    return std::pair(quality.values[a], a) < std::pair(quality.values[b], b);
  });
  cells.erase(end, cells.end());
  return cells;
}

}  // namespace

MorphDetails gather_details(const MorphResult& result, const DetailOptions& options) {
  const BaseSide& base = *result.base;
  MorphDetails details;
  details.scaled_jacobian = jacobian_histogram(base.quality, result.quality, options.jacobian_bins);
  fill_deviation(details, result, options);
  const NearestFace nearest(base.boundary, base.association().facet_face, result.positions);
  for (const Index c : worst_cells(result.quality, options.worst)) {
    const Eigen::Vector3d centre = centre_of(base.mesh().cell(c), result.positions);
    const FaceId face = nearest(centre);
    details.worst.push_back({.cell = c,
                             .name = cell_name(base.mesh(), c),
                             .before = base.quality.values[c],
                             .after = result.quality.values[c],
                             .centre = centre,
                             .face = face < 0 ? face : result.match.faces[face]});
  }
  return details;
}

}  // namespace cadmorph
