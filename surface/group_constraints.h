#pragma once

#include <string>
#include <vector>

#include "core/boundary.h"
#include "core/mesh.h"
#include "surface/association.h"

namespace cadmorph {

/// What parts of the surface do that the mesh file names (see Mesh::groups); the names of groups.
struct GroupConstraints {
  std::vector<std::string> held;       ///< all nodes stay, those on the CAD, too
  std::vector<std::string> sliding;    ///< nodes on no CAD face slide in the plane they lie in
  std::vector<std::string> following;  ///< nodes on no CAD face follow the volume

  bool is_empty() const { return held.empty() && sliding.empty() && following.empty(); }
};

enum class GroupConstraint : std::int8_t { None, Hold, Slide, Follow };

/// The constraint of each boundary node (rows as Boundary::nodes). Throws InvalidInputError for a
/// name that no group has (it lists those there are), and for a node of groups that contradict each
/// other, unless one of them is held: that counts.
std::vector<GroupConstraint> find_constraints(const Mesh& mesh, const Boundary& boundary,
                                              const GroupConstraints& constraints);

/// Takes held nodes from the CAD, and marks following ones that are on no CAD face as free. Again
/// applied, it changes nothing.
void apply_constraints(const std::vector<GroupConstraint>& constraints, const Boundary& boundary,
                       Association& association);

}  // namespace cadmorph
