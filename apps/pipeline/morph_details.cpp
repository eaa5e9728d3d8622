#include "apps/pipeline/morph_details.h"

#include <algorithm>
#include <cmath>

#include "core/kd_tree.h"

namespace cadmorph {
namespace {

Eigen::Vector3d centre_of(std::span<const Index> nodes, const Points& positions) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Index node : nodes) sum += positions.row(node).transpose();
  return sum / static_cast<double>(nodes.size());
}

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
  for (std::size_t i = 0; i < association.dimension.size(); ++i)
    if (association.dimension[i] != CadDimension::None && distance[i] >= least)
      result.push_back(std::log10(distance[i]));
  return result;
}

void fill_deviation(MorphDetails& details, const MorphJob& job, const MorphResult& result,
                    const DetailOptions& options) {
  const Association& association = job.association();
  const double largest = std::max(association.max_distance, result.report.after.max_distance);
  const auto before = deviations(association, association.distance, options.least_deviation);
  const auto after = deviations(association, result.surface_distance, options.least_deviation);
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

// The facets on a CAD face as points to search: the nearest facet's face is the nearest face.
class FaceFinder {
 public:
  FaceFinder(const MorphJob& job, const MorphResult& result) : match_(result.match) {
    const Boundary& boundary = job.boundary();
    for (Index f = 0; f < boundary.facet_count(); ++f)
      if (job.association().facet_face[f] >= 0)
        faces_.push_back(match_.faces[job.association().facet_face[f]]);
    RowMatrix centres(faces_.size(), 3);
    for (Index f = 0, row = 0; f < boundary.facet_count(); ++f)
      if (job.association().facet_face[f] >= 0)
        centres.row(row++) = centre_of(boundary.facet(f), result.positions).transpose();
    if (!faces_.empty()) tree_.emplace(centres);
  }

  int nearest(const Eigen::Vector3d& x) const {
    return tree_ ? faces_[tree_->nearest(x.data(), 1).front().index] : -1;
  }

 private:
  const TopologyMatch& match_;
  std::vector<int> faces_;  // of the variant, one a facet
  std::optional<KdTree> tree_;
};

}  // namespace

MorphDetails gather_details(const MorphJob& job, const MorphResult& result,
                            const DetailOptions& options) {
  MorphDetails details;
  details.scaled_jacobian =
      jacobian_histogram(job.base_quality(), result.quality, options.jacobian_bins);
  fill_deviation(details, job, result, options);
  const FaceFinder faces(job, result);
  for (const Index c : worst_cells(result.quality, options.worst)) {
    const Eigen::Vector3d centre = centre_of(job.mesh().cell(c), result.positions);
    details.worst.push_back({.cell = c,
                             .before = job.base_quality().values[c],
                             .after = result.quality.values[c],
                             .centre = centre,
                             .face = faces.nearest(centre)});
  }
  return details;
}

}  // namespace cadmorph
