#pragma once

#include <memory>
#include <vector>

#include "core/mesh.h"
#include "volume/morph_method.h"

namespace cadmorph {

/// A morphing method that the RBF warp is compared with. Holds what depends on the base mesh alone.
/// All of them are linear: the displacements inside are weighted sums of those on the surface.
class Baseline {
 public:
  virtual ~Baseline() = default;

  /// Displacements of all nodes (N x 3) for those of the surface nodes (m x 3), which are kept
  /// exactly. Nodes that no cell ties to a surface node stay. Throws SolverError when the linear
  /// system can't be solved.
  virtual Points displacements(const Points& surface) const = 0;
};

/// Sets up a method other than Rbf. `surface_nodes`: distinct ids of the m prescribed nodes. Throws
/// InvalidInputError on a cell that the method does not know, SolverError when the mesh does not
/// admit its weights, and for simplex-linear when cadmorph was built without CGAL.
std::unique_ptr<Baseline> make_baseline(MorphMethod method, const Mesh& mesh,
                                        const std::vector<Index>& surface_nodes);

}  // namespace cadmorph
