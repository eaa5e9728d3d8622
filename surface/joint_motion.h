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
                 std::vector<CurveMap>& curve_maps);

/// Places of nodes on the variant, millimetres, by row of the surface mesh.
using Crossings = std::map<int, Eigen::Vector3d>;

/// Where the nodes go at which faces pass through each other: to where the faces' images meet, near
/// the places that the faces' own warps give, or the predicted one where these differ by a mesh
/// edge. `feet`: of all rows on the base. `placed`: on the variant, corners and curves. Parallel.
Crossings cross_faces(const ModelPair& pair, const std::vector<CurveMap>& curve_maps,
                      const Joints& joints, const std::vector<FaceNodes>& faces,
                      const SurfaceMesh& surface, const Points& feet, const Points& placed);

/// Joints that the variant parts: nodes that go, at `placed`, off a face or a curve on which they
/// lay.
PartedJoints find_parted_joints(const ModelPair& pair, const std::vector<CurveMap>& curve_maps,
                                const Joints& joints, const SurfaceMesh& surface,
                                const Points& placed);

}  // namespace cadmorph
