#pragma once

#include <string>

namespace cadmorph {

/// How the volume nodes follow the surface nodes.
enum class MorphMethod {
  Rbf,            ///< RBF space warp (Sieger et al. 2013, sect. 3)
  Femwarp,        ///< harmonic finite-element weights (Baker 2002; Staten et al. 2011)
  Lbwarp,         ///< log-barrier weights (Shontz, Vavasis 2003)
  SimplexLinear,  ///< barycentric coordinates in the Delaunay tetrahedra of the surface nodes
};

/// Name as the literature writes it: RBF, FEMWARP, LBWARP, simplex-linear.
std::string to_string(MorphMethod method);

}  // namespace cadmorph
