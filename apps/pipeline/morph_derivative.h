#pragma once

#include <optional>
#include <vector>

#include "surface/patch_slide.h"
#include "volume/volume_derivative.h"

namespace cadmorph {

/// The volume morph of a job as a linear map (VolumeDerivative), if asked for with the planes that
/// slide, and its transpose.
class MorphDerivative {
 public:
  explicit MorphDerivative(VolumeDerivative volume) : volume_(std::move(volume)) {}

  /// Nodes on planes that slide follow the others. `rows`: of the surface nodes, among the `count`
  /// that `slide` takes.
  MorphDerivative(VolumeDerivative volume, SlideDerivative slide, std::vector<RowId> rows,
                  Index count);

  /// As VolumeDerivative has them. With planes that slide, the columns are displacements, three
  /// each; what is given for nodes that follow is not read, and the adjoint by them is 0.
  RowMatrix forward(const RowMatrix& surface) const;
  RowMatrix adjoint(const RowMatrix& volume) const;

  const std::vector<Index>& surface_nodes() const { return volume_.surface_nodes(); }
  Index node_count() const { return volume_.node_count(); }

 private:
  RowMatrix spread(const RowMatrix& surface) const;

  VolumeDerivative volume_;
  std::optional<SlideDerivative> slide_;
  std::vector<RowId> rows_;
  Index count_ = 0;
};

}  // namespace cadmorph
