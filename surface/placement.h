#pragma once

#include <Eigen/Dense>
#include <vector>

#include "cad/brep.h"
#include "surface/association.h"
#include "surface/face_nodes.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// Of the largest coordinate: what a node's way through the CAD loses by rounding, some hundred
/// operations of 1e-16 each.
inline constexpr double kWayRounding = 1e-13;

/// Surface nodes on the base CAD. Millimetres.
struct BasePlacement {
  const CadModel& base;
  const SurfaceMesh& surface;
  const Association& association;
  const IdVector<FaceId, FaceNodes>& faces;
  const Points& feet;     ///< of all nodes
  const Points& offsets;  ///< of the nodes from these; of those on faces in the face's own frame
};

/// Surface nodes on the variant CAD, their entities and parameters there, and what they keep of
/// their offset from the base CAD, turned with the entity but not yet stretched. Millimetres.
struct Placement {
  explicit Placement(Points base_feet);

  Placement rows(const std::vector<RowId>& nodes) const;
  void set_rows(const std::vector<RowId>& nodes, const Placement& values);
  void cross(RowId row, const Eigen::Vector3d& to);

  Points feet, offsets;
  Parameters uv;                      ///< face (u, v), edge (t, 0)
  IdVector<RowId, int> entity;        ///< variant face or edge; -1
  IdVector<RowId, char> is_crossing;  ///< on several faces: the foot stays
};

/// Orthonormal frame of a surface: tangent, bitangent, normal. Identity at a pole.
Eigen::Matrix3d surface_frame(const SurfacePoint& s);

}  // namespace cadmorph
