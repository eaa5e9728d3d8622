#pragma once

#include <optional>

#include "cad/brep.h"
#include "core/boundary.h"

namespace cadmorph {

/// Millimetres per unit of the mesh: of mm, m, cm, inch and foot the one in which all surface nodes
/// lie on the CAD, else the one in which most of them do and over most of it; where none fits, the
/// one in which mesh and CAD are of one size, else millimetres. Looks at some 400 nodes. Throws
/// AssociationError that names two units when they fit nearly alike.
double detect_mesh_unit(const CadModel& base, const Mesh& mesh, const Boundary& boundary);

/// How a mesh must be taken to lie on a CAD model.
struct MeshPlace {
  double mm = 1;                                    ///< millimetres per unit of the mesh
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  ///< millimetres, of the mesh
};

/// Finds how nearly all of a mesh's surface lies on `cad` and over nearly all of it: as it is, in
/// `mm` or else in another unit, or shifted by the way between the middles of their boxes. Nothing
/// where neither is so.
std::optional<MeshPlace> find_place(const CadModel& cad, const Mesh& mesh, const Boundary& boundary,
                                    double mm);

}  // namespace cadmorph
