#pragma once

#include <vector>

#include "core/cell_topology.h"

namespace cadmorph {

/// The isoparametric map of a quadratic cell type.
struct Element {
  Shape shape;
  int nodes;
  /// Per sample, nodes x 3: derivatives of the shape functions along the sample's three directions.
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, 3>> samples;
};

/// Returns the map of a quadratic cell type, solid or shell, sampled at its nodes (but a pyramid's
/// apex) and its centre. Throws std::out_of_range for another type.
const Element& element_of(CellType type);

}  // namespace cadmorph
