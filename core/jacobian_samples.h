#pragma once

#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// The Jacobian determinant of a cell's map as a polynomial: where to sample it so that the samples
/// determine it, and its Bernstein form, whose smallest coefficient bounds it from below (Johnen,
/// Remacle, Geuzaine: Geometrical validity of curvilinear finite elements, 2013).
struct JacobianSamples {
  int nodes;    ///< of the cell, in VTK's order
  int samples;  ///< points of the reference domain
  /// (3 * samples) x nodes: rows 3s, 3s+1, 3s+2 applied to the node positions give the derivatives
  /// of the map by the three reference coordinates at sample s.
  Eigen::MatrixXd derivatives;
  /// Determinants at the samples -> Bernstein coefficients. For pyramids, whose map collapses at
  /// the apex, those of the determinant divided by its known positive factor there.
  Eigen::MatrixXd to_bernstein;
  /// Coefficients -> coefficients on each part of the domain cut in halves.
  std::vector<Eigen::MatrixXd> children;
  /// Coefficients that are values at the corners of the domain.
  std::vector<int> corners;
};

/// Returns the samples of a solid cell type, built at first use; null for polyhedra and types
/// without a map. Linear tetrahedra have one sample.
const JacobianSamples* jacobian_samples(CellType type);

}  // namespace cadmorph
