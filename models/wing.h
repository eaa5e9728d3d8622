#pragma once

#include <TopoDS_Shape.hxx>
#include <filesystem>
#include <string>
#include <vector>

#include "core/mesh.h"

namespace cadmorph::models {

/// Makes the wing model: half a wing with a blunt trailing edge, its root in the plane y = 0. As
/// `change` goes from 0 to 1 span, tip chord, sweep, dihedral, twist, thickness and camber change.
TopoDS_Shape make_wing(double change);

/// Names of what changes alone in make_wing_changed.
std::vector<std::string> wing_changes();

/// Makes make_wing(0) with one of wing_changes() as in make_wing(1).
TopoDS_Shape make_wing_changed(const std::string& what);

/// Meshes the air around the wing of `step`, make_wing(0), up to a far-field box: wedges on the
/// wing, the first 1e-5 of the root chord high, tetrahedra outside.
Mesh make_wing_layers(const std::filesystem::path& step);

}  // namespace cadmorph::models
