#pragma once

#include <TopoDS_Shape.hxx>
#include <string>
#include <vector>

#include "models/tet_mesher.h"

namespace cadmorph::models {

/// A small part for tests, the same with other parameters, and how coarsely to mesh the first.
struct SmallShape {
  std::string name;
  TopoDS_Shape base, variant;
  TetOptions tets;
};

/// Makes all small parts; lengths in millimetres.
std::vector<SmallShape> make_small_shapes();

}  // namespace cadmorph::models
