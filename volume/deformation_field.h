#pragma once

#include <string>
#include <vector>

#include "core/rbf/field_terms.h"
#include "volume/stepping.h"

namespace cadmorph {

/// All that it takes to move points as a morph moved the nodes of its mesh.
struct DeformationTerms {
  std::string base_cad, variant_cad, mesh_file;  ///< what the field was made of, for people
  double mesh_unit_mm = 1;                       ///< millimetres per unit of all coordinates
  Eigen::RowVector3d low, high;                  ///< box of the mesh's nodes
  Points nodes, new_nodes;                       ///< m x 3: prescribed nodes before and after
  std::vector<FieldTerms> steps;                 ///< displacements, to be added one after the other

  template <class Archive>
  void serialize(Archive& archive) {
    archive(base_cad, variant_cad, mesh_file, mesh_unit_mm, low, high, nodes, new_nodes, steps);
  }
};

/// Records the fields of a morph in `steps` steps (see morph_in_steps). Throws InvalidInputError
/// when the morph is not by RBF, the mesh has several components, or nodes at one place go to
/// different places: such a morph is no function of the position. Throws what VolumeMorph throws.
DeformationTerms record_deformation(const Mesh& mesh, const VolumeMorph& first,
                                    const SurfaceMotion& motion, int steps);

/// Where points have gone.
struct MovedPoints {
  Points positions;
  Index at_nodes = 0;  ///< points that coincide with a prescribed node, to the last bit
  Index outside = 0;   ///< points outside the box of the mesh's nodes
};

/// Moves any points as a morph moved the nodes of its mesh. Where a point goes depends on its own
/// position alone, to the last bit (see PointwiseField): pieces of a mesh moved one by one agree on
/// their common nodes.
class DeformationField {
 public:
  explicit DeformationField(DeformationTerms terms);
  ~DeformationField();
  DeformationField(DeformationField&&) noexcept;

  /// Moves T x 3 points. A point at the place of a prescribed node goes exactly where that went;
  /// others follow the interpolant. Parallel; the result does not depend on the thread count.
  MovedPoints apply(const Points& points) const;

  const DeformationTerms& terms() const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace cadmorph
