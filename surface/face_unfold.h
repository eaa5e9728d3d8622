#pragma once

#include "surface/face_folds.h"

namespace cadmorph {

/// Lays the facets of a face out anew where a map folded them: the nodes within the face, `rows`
/// (ascending), that lie within `rings` rings of facets round `folded` ones move on it so that the
/// map of the facets from `surface.points` has the least distortion without folds
/// (core/foldover.h); all others stay at `mapped.points`. Returns the parameters of `rows`, from
/// `mapped.uv` on. Facets are taken as flat, in the metric where they start. For faces without seam
/// or pole among these nodes; O(facets in the rings) a step.
Parameters unfold_face(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                       const std::vector<RowId>& rows, const FaceSide& mapped,
                       const std::vector<FacetId>& folded, int rings);

/// The same with all nodes.
Parameters unfold_face(const SurfaceMesh& surface, const std::vector<FacetId>& facets,
                       const std::vector<RowId>& rows, const FaceSide& mapped);

}  // namespace cadmorph
