#include "apps/pipeline/diagnosis.h"

#include <algorithm>
#include <map>

#include "apps/pipeline/base_side.h"
#include "apps/pipeline/nearest_face.h"

namespace cadmorph {
namespace {

constexpr double kShareTolerance = 0.01;  // of the change: it is told in whole percent

// Counts as pairs (key, count), the largest count first, equal ones by key.
template <class Key>
std::vector<std::pair<Key, Index>> most_first(const std::map<Key, Index>& counts) {
  std::vector<std::pair<Key, Index>> result(counts.begin(), counts.end());
  std::ranges::stable_sort(result, std::greater{}, &std::pair<Key, Index>::second);
  return result;
}

FaceId most_frequent_face(const BaseSide& base, const std::vector<Index>& bad_cells) {
  const Mesh& mesh = base.mesh();
  const NearestFace nearest(base.boundary, base.association().facet_face, mesh.points);
  std::map<FaceId, Index> votes;
  for (const Index c : bad_cells) ++votes[nearest(centre_of(mesh.cell(c), mesh.points))];
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

Diagnosis diagnose(const BaseSide& base, const std::vector<Index>& bad_cells,
                   const PositionsAt& positions_at) {
  Diagnosis result;
  result.bad_cells = static_cast<Index>(bad_cells.size());
  std::map<int, Index> regions;
  for (const Index c : bad_cells) {
    ++regions[base.mesh().region(c)];
    if (std::ranges::binary_search(base.validity.invalid_cells, c)) ++result.bad_in_base;
  }
  result.regions = most_first(regions);
  result.face = most_frequent_face(base, bad_cells);
  if (result.face >= 0) {
    const CadFace& face = base.cad->faces()[result.face];
    result.face_type = to_string(face.type);
    result.face_name = face.name;
  }
  result.first_inversion = first_inversion(base.mesh(), base.orientation, positions_at);
  return result;
}

}  // namespace cadmorph
