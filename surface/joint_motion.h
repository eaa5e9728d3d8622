#pragma once

#include <map>
#include <string>
#include <vector>

#include "surface/curve_map.h"
#include "surface/face_nodes.h"
#include "surface/joints.h"

namespace cadmorph {

/// Leads the curves through what stands on them or crosses them: to where the images of all that
/// cross meet. Parallel.
void join_curves(const ModelPair& pair, const Joints& joints, const Association& association,
                 CurveMaps& curve_maps);

/// The nodes of a surface mesh on the CAD.
struct SurfaceFeet {
  const SurfaceMesh& surface;
  const Points& base;     ///< on the base CAD
  const Points& variant;  ///< on the variant, as far as they are placed there: corners and curves
};

/// Places of nodes on the variant, millimetres.
using Crossings = std::map<RowId, Eigen::Vector3d>;

/// Where the nodes go at which faces pass through each other: to where the faces' images meet, near
/// the places that the faces' own warps give, or the predicted one where these differ by a mesh
/// edge. Parallel.
Crossings cross_faces(const ModelPair& pair, const CurveMaps& curve_maps, const Joints& joints,
                      const IdVector<FaceId, FaceNodes>& faces, const SurfaceFeet& nodes);

/// Joints that the variant parts: nodes that go, at `placed`, off a face or a curve on which they
/// lay.
PartedJoints find_parted_joints(const ModelPair& pair, const CurveMaps& curve_maps,
                                const Joints& joints, const SurfaceMesh& surface,
                                const Points& placed);

}  // namespace cadmorph
