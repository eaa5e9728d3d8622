#pragma once

#include <vector>

#include "cad/brep_impl.h"

namespace cadmorph {

/// The use of an edge by a wire of a face.
struct EdgeUse {
  EdgeId edge;
  Pcurve pcurve;
  bool is_reversed;      ///< in the face as its surface lies, whatever the face's own orientation
  bool is_slit = false;  ///< the face is on both sides of it: it bounds nothing
};

/// Mends what files and their readers get wrong about the parameters of a face's edges, where the
/// geometry says better: both sides of a seam on one side of the domain, pieces of a wire a period
/// apart and joined by edges of no length, pcurves that leave their edge, and the arbitrary
/// parameter at a pole. Wires that are sound stay as they are, to the last bit. Needs the model's
/// vertices, edges and the surface of the face.
void repair_pcurves(const CadModel::Impl& model, FaceId face,
                    std::vector<std::vector<EdgeUse>>& wires);

}  // namespace cadmorph
