#pragma once

#include <string>

#include "core/types.h"

namespace cadmorph::test {

/// A surface with prescribed displacements and points of the volume beside it.
struct RbfSet {
  std::string name;
  RowMatrix surface;       ///< N x 3
  RowMatrix displacement;  ///< N x 3
  RowMatrix volume;        ///< T x 3; two in five close to the surface
};

/// A box with a through hole that turns by 20 degrees and grows by 15 %: kinks along its rims.
RbfSet turning_hole(Index surface_nodes, Index volume_nodes);

/// A sphere in a box that moves and warps.
RbfSet sphere_in_box(Index surface_nodes, Index volume_nodes);

/// A half wing in a far field that twists and bends; a symmetry plane graded from 1e-5 of the chord
/// (2.5e-7 of the diagonal at a million nodes, where nodes of the section come close).
RbfSet graded_wing(Index surface_nodes, Index volume_nodes);

enum class SheetShape { Plate, Tube };

/// Two sheets (a plate's sides with their rim, or a tube's walls) at a distance of `gap` node
/// spacings that bend, change thickness by up to half and turn about a hole's axis; node patterns
/// equal on both sides (matched) or not.
RbfSet thin_sheets(SheetShape shape, Index surface_nodes, double gap, bool is_matched);

}  // namespace cadmorph::test
