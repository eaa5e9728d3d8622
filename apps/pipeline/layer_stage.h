#pragma once

#include <optional>

#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// A mesh whose layers have the heights of the base again.
struct MeshWithLayers {
  Points positions;  ///< N x 3, in the mesh's unit
  RowMatrix slides;  ///< as SlidingNodes::slides
  ValidityReport validity;
  KeptLayers report;
};

/// Gives the layers on the surface of a morphed mesh the heights back that they have at the base:
/// each column of nodes (find_layer_columns) keeps its shape and turns with the surface round its
/// foot; nodes of columns on side walls and symmetry planes slide along these. What is beyond the
/// layers gives way (near_displacements). Where cells would be inverted the columns
/// round them keep their lower nodes alone, or none, and those beside columns without any go a part
/// of the way. Nothing where the mesh has no layers. Cost: a tree of the surface's nodes, and an
/// evaluation at all nodes; up to six times that where cells were inverted.
std::optional<MeshWithLayers> keep_layers(const MorphResult& result, const SlidingNodes& sliding);

}  // namespace cadmorph
