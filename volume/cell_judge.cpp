#include "volume/cell_judge.h"

#include <numeric>
#include <utility>

#include "core/plane_mesh.h"
#include "volume/worst_cells.h"

namespace cadmorph {

CellJudge::CellJudge(const Mesh& mesh, const Orientation& orientation, const FiniteVolumes* volumes,
                     const ValidityReport* validity)
    : mesh_(mesh), orientation_(orientation), volumes_(volumes), validity_(validity) {}

QualityReport CellJudge::measure(const Points& positions) const {
  if (!volumes_) return measure_quality(mesh_, positions, orientation_);
  return quality_of_faces(face_quality(*volumes_, positions));
}

QualityReport CellJudge::measure_again(QualityReport before, const Points& positions,
                                       const std::vector<Index>& cells) const {
  if (!volumes_)
    return cadmorph::measure_again(std::move(before), mesh_, positions, orientation_, cells);
  return quality_of_faces(
      face_quality_again(std::move(before.values), *volumes_, positions, cells));
}

std::vector<Index> CellJudge::find_invalid(const Points& positions,
                                           const std::vector<Index>& cells) const {
  if (flat_axis(mesh_, positions) < 0)
    return check_validity(mesh_, positions, orientation_, cells).invalid_cells;
  const Mesh layer = one_layer(mesh_, positions);
  return check_validity(layer, layer.points, Orientation(orientation_.size(), 1), cells)
      .invalid_cells;
}

std::vector<Index> CellJudge::find_invalid(const Points& positions) const {
  if (validity_ && flat_axis(mesh_, positions) < 0) return validity_->invalid_cells;
  std::vector<Index> all(mesh_.cell_count());
  std::iota(all.begin(), all.end(), Index{0});
  return find_invalid(positions, all);
}

}  // namespace cadmorph
