#pragma once

#include <TopoDS_Shape.hxx>
#include <string>
#include <vector>

#include "models/tet_mesher.h"

namespace cadmorph::models {

/// A small part for tests and how coarsely to mesh it.
struct SmallShape {
  std::string name;
  TopoDS_Shape shape;
  TetOptions tets;
};

/// Makes all small parts; lengths in millimetres.
std::vector<SmallShape> make_small_shapes();

}  // namespace cadmorph::models
