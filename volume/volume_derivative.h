#pragma once

#include <vector>

#include "core/rbf/anchors.h"
#include "core/types.h"

namespace cadmorph {

/// A volume morph as a linear map, its kernels and anchors held (VolumeMorph::derivative), and the
/// transpose of that map to rounding. Both act on each column by itself: displacements have three
/// columns, several sets of them side by side three each. No more than about a morph each. The map
/// is that of one plain morph, without steps and repair.
class VolumeDerivative {
 public:
  /// What one component does.
  struct Part {
    std::vector<Index> surface;  ///< positions in the list of surface nodes
    std::vector<Index> volume;   ///< node ids
    FieldMap map;
  };

  VolumeDerivative(Index node_count, std::vector<Index> surface_nodes, std::vector<Part> parts);

  /// Returns the displacements of all nodes (N x M) for those of the m surface nodes (m x M), which
  /// themselves are displaced just so; nodes of a component without surface nodes not at all.
  /// Throws InvalidInputError on a wrong size or a number that is not finite.
  RowMatrix forward(const RowMatrix& surface) const;

  /// Returns the derivative of a quantity by the surface nodes' positions (m x M) for that by the
  /// positions of all nodes (N x M). Throws InvalidInputError on a wrong size or a number that is
  /// not finite.
  RowMatrix adjoint(const RowMatrix& volume) const;

  const std::vector<Index>& surface_nodes() const { return surface_nodes_; }
  Index node_count() const { return node_count_; }

 private:
  Index node_count_;
  std::vector<Index> surface_nodes_;
  std::vector<Part> parts_;
};

}  // namespace cadmorph
