#pragma once

#include <vector>

#include "cad/brep.h"
#include "surface/association.h"
#include "surface/free_patches.h"
#include "surface/joints.h"
#include "surface/placement.h"

namespace cadmorph {

/// The nodes of a surface mesh at which junctions start. Millimetres.
struct JunctionNodes {
  const Points& base;  ///< on the base CAD, or where they are themselves
  double size = 0;     ///< of the mesh, to which places are rounded
};

/// Has nodes on the CAD and on a patch that slides stay on both: on a symmetry plane that cuts a
/// face, on a hub that a blade goes through. Least steps along the CAD's tangents onto the patches,
/// and from there back to the CAD; where they don't meet nearby, the CAD's place counts. Returns
/// how many nodes that are, and by how much they leave their patches.
PartedJoints settle_junctions(const CadModel& variant, const std::vector<FreePatch>& sliding,
                              const Association& association, const JunctionNodes& nodes,
                              Placement& placed);

}  // namespace cadmorph
