#pragma once

#include <memory>
#include <vector>

#include "surface/face_border.h"
#include "surface/face_domain.h"
#include "surface/face_folds.h"
#include "surface/joints.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// A face's part of the surface mesh, by rows of that, and the domain that carries it.
struct FaceNodes {
  FaceId face;
  std::vector<RowId> rows;  ///< nodes on the face alone, ascending
  std::vector<FacetId> facets;
  std::vector<RowId> around;    ///< the other nodes of the facets, ascending
  Parameters uv;                ///< of the nodes
  Points points;                ///< S(uv)
  std::vector<Index> straight;  ///< of the rows (by number): amid straight edges of a plane face

  std::vector<RowId> joints;  ///< nodes within the face that move with something else
  Parameters joint_uv;
  Index placed_joints = 0;  ///< the first of them, which corners and curves place; then crossings

  int samples_per_curve = 0;           ///< of the domain
  std::unique_ptr<FaceDomain> domain;  ///< null where no node lies on the face
  FaceBorder border;                   ///< empty but where thin cells stand on it
  FaceFolds folds;
};

/// The nodes of all faces of `surface`, by face. `feet`: of all rows on the base.
IdVector<FaceId, FaceNodes> collect_face_nodes(const CadModel& base, const SurfaceMesh& surface,
                                               const Association& association, const Joints& joints,
                                               const Points& feet);

}  // namespace cadmorph
