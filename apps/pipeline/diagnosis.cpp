#include "apps/pipeline/diagnosis.h"

#include <algorithm>
#include <map>

#include "core/kd_tree.h"
#include "volume/held_cells.h"

namespace cadmorph {
namespace {

constexpr double kShareTolerance = 0.01;

Eigen::Vector3d centroid(const Points& points, std::span<const Index> nodes) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Index node : nodes) sum += points.row(node).transpose();
  return sum / static_cast<double>(nodes.size());
}

// Counts as pairs (key, count), the largest count first, equal ones by key.
std::vector<std::pair<int, Index>> most_first(const std::map<int, Index>& counts) {
  std::vector<std::pair<int, Index>> result(counts.begin(), counts.end());
  std::ranges::stable_sort(result, std::greater{}, &std::pair<int, Index>::second);
  return result;
}

int most_frequent_face(const Mesh& mesh, const Boundary& boundary, const Association& association,
                       const std::vector<Index>& bad_cells) {
  std::vector<Index> facets;
  for (Index f = 0; f < boundary.facet_count(); ++f)
    if (association.facet_face[f] >= 0) facets.push_back(f);
  if (facets.empty()) return -1;
  RowMatrix centres(facets.size(), 3);
  for (std::size_t i = 0; i < facets.size(); ++i)
    centres.row(i) = centroid(mesh.points, boundary.facet(facets[i])).transpose();
  const KdTree tree(centres);
  std::map<int, Index> votes;
  for (const Index c : bad_cells) {
    const Eigen::Vector3d centre = centroid(mesh.points, mesh.cell(c));
    ++votes[association.facet_face[facets[tree.nearest(centre.data(), 1).front().index]]];
  }
  return most_first(votes).front().first;
}

double first_inversion(const Mesh& mesh, const Orientation& orientation,
                       const PositionsAt& positions_at) {
  const auto is_valid = [&](double share) {
    return check_validity(mesh, positions_at(share), orientation).invalid == 0;
  };
  if (!is_valid(0)) return 0;
  double valid = 0, invalid = 1;
  if (is_valid(invalid)) return 1;
  while (invalid - valid > kShareTolerance) {
    const double middle = (valid + invalid) / 2;
    (is_valid(middle) ? valid : invalid) = middle;
  }
  return invalid;
}

}  // namespace

Diagnosis diagnose(const CadModel& cad, const Mesh& mesh, const Boundary& boundary,
                   const Association& association, const std::vector<Index>& bad_cells,
                   const Orientation& orientation, const std::vector<char>& is_fixed,
                   const PositionsAt& positions_at) {
  Diagnosis result;
  const Points whole = positions_at(1);
  result.bad_cells = static_cast<Index>(bad_cells.size());
  const auto in_base = check_validity(mesh, mesh.points, orientation).invalid_cells;
  std::map<int, Index> regions;
  for (const Index c : bad_cells) {
    ++regions[mesh.region(c)];
    if (is_held(mesh, whole, is_fixed, c)) ++result.held_cells;
    if (std::ranges::binary_search(in_base, c)) ++result.bad_in_base;
  }
  result.regions = most_first(regions);
  result.face = most_frequent_face(mesh, boundary, association, bad_cells);
  if (result.face >= 0) {
    result.face_type = to_string(cad.faces()[result.face].type);
    result.face_name = cad.faces()[result.face].name;
  }
  result.first_inversion = first_inversion(mesh, orientation, positions_at);
  return result;
}

}  // namespace cadmorph
