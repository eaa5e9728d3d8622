#pragma once

#include <nlohmann/json_fwd.hpp>

#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// The mesh surface before and after a morph, for the page's 3D view, as JSON:
/// - position, displacement (nodes x 3; mesh unit) and jacobian (nodes x 2: before, after; the
///   smallest scaled Jacobian of the cells at a node): 16 bit numbers q, each column's value being
///   low + size * q / 65535;
/// - deviation (nodes x 2; millimetres; NaN off the CAD): float32;
/// - sizes (uint8) and corners (uint32): the facets' polygons.
/// All arrays in base64, little-endian. A surface of more than `most_triangles` is simplified to
/// about that many triangles between nodes it keeps.
nlohmann::ordered_json surface_data(const MorphResult& result, Index most_triangles = 200'000);

}  // namespace cadmorph
