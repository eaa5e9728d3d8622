#pragma once

#include <vector>

#include "core/face_quality.h"
#include "core/mesh.h"
#include "core/quality.h"
#include "core/validity.h"

namespace cadmorph {

/// Judges the cells of a mesh by their scaled Jacobians or, where its solver works by finite
/// volumes, by face_quality, and tells which are not valid.
class CellJudge {
 public:
  /// `volumes`, `validity` (of the mesh as it came): null where there are none. All must outlive
  /// this.
  CellJudge(const Mesh& mesh, const Orientation& orientation, const FiniteVolumes* volumes,
            const ValidityReport* validity);

  /// With the nodes at `positions` (N x 3); of faces their smallest and all values alone.
  QualityReport measure(const Points& positions) const;
  /// The same where nodes of these cells alone have moved since `before`.
  QualityReport measure_again(QualityReport before, const Points& positions,
                              const std::vector<Index>& cells) const;

  /// Of these cells. Those of a plane mesh that turned over are not valid.
  std::vector<Index> find_invalid(const Points& positions, const std::vector<Index>& cells) const;
  /// Of all, with the nodes where they came.
  std::vector<Index> find_invalid(const Points& positions) const;

 private:
  const Mesh& mesh_;
  const Orientation& orientation_;
  const FiniteVolumes* volumes_;
  const ValidityReport* validity_;
};

}  // namespace cadmorph
