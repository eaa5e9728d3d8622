#pragma once

#include "cad/brep.h"
#include "core/boundary.h"

namespace cadmorph {

/// Millimetres per unit of the mesh: of mm, m, cm, inch and foot the one that brings surface nodes
/// to most places of the CAD; where several do equally well, the one in which mesh and CAD are of
/// one size, else millimetres.
double detect_mesh_unit(const CadModel& base, const Mesh& mesh, const Boundary& boundary);

/// "mm", "m", "cm", "inch" or "foot" for a factor of detect_mesh_unit, else "<factor> mm".
std::string mesh_unit_name(double mm_per_unit);

}  // namespace cadmorph
