#pragma once

#include <string>
#include <vector>

#include "core/rbf/anchors.h"
#include "core/rbf/rbf_system.h"
#include "volume/morph_part.h"

namespace cadmorph {

/// Whether anchors hold fields with these options. Full solvers that were asked for answer without:
/// they are what others compare with.
bool is_bounded(const VolumeMorphOptions& options);

/// A field with what it does at the volume nodes.
struct BoundedField {
  RbfField field;
  RowMatrix displacements;
  std::string remark = {};
};

/// Holds a field of a part by anchors among its targets (find_anchors) while one of them moves
/// too far; one that does so near the surface alone is left as it is (docs/adaptive-centres.md).
/// `values`: at the part's centres. Only nodes of cells bound and hold the field; those of no cell
/// follow what results.
void hold_back(const MorphPart& part, const RowMatrix& values, const PartTargets& targets,
               const VolumeMorphOptions& options, BoundedField& bounded);

/// The derivative of the field, plain or held, that these values at the part's centres take;
/// `base`: positions of all nodes.
FieldMap held_derivative(const MorphPart& part, const RowMatrix& values, const Points& base,
                         const VolumeMorphOptions& options);

/// One linear map for several motions of a part.
struct LinearField {
  FieldMap map;
  Index kernels = 0;     ///< of the centres and the anchors
  Index anchors = 0;     ///< that hold what is none of these motions
  double overshoot = 0;  ///< the largest of these motions
};

/// A linear map by which each of these motions (N x 3 values at the part's centres) does what its
/// own field does, held by its own anchors where it needs some: the map of the one with the most
/// anchors, and a correction by the share of each motion in the values. Affine motions are exact in
/// that map, too. Without anchors the map has kernels for all. Motions count by their direction
/// where they are less than a tenth of what moves. `base`: positions of all nodes. Throws what
/// RbfSystem throws. Memory: 24 bytes a target and motion where anchors are needed.
LinearField linear_field(const MorphPart& part, const std::vector<RowMatrix>& motions,
                         const Points& base, const VolumeMorphOptions& options);

}  // namespace cadmorph
