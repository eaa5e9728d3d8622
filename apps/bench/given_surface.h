#pragma once

#include "cad/topology_match.h"
#include "core/boundary.h"
#include "surface/association.h"

namespace cadmorph::bench {

/// Stands in for the surface nodes that the paper's comparison was given (Staten et al. 2011: nodes
/// on CAD curves at the curve's parameter, nodes on faces by a lower-dimensional warp): nodes on
/// curves and corners as in `positions`; those on each face follow them by the Laplace equation on
/// the face's own mesh, linear elements, and go to the nearest point of the variant's face.
/// `base` (rows of Boundary::nodes) in the mesh's unit.
Points harmonic_surface(const Points& base, const Boundary& boundary,
                        const Association& association, const CadModel& variant,
                        const TopologyMatch& match, const Points& positions);

}  // namespace cadmorph::bench
