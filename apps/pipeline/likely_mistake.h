#pragma once

#include <string>

#include "cad/brep.h"
#include "core/mesh.h"

namespace cadmorph {

/// What the user is likely to have mistaken where `mesh` does not lie on `base`, as the beginning
/// of a sentence that ends with "; ": it lies on the CAD after a shift or in another unit than that
/// given (millimetres; 0: detected), or cells have their nodes in a wrong order, so that their
/// faces bound holes. Empty where nothing that is known fits.
std::string likely_mistake(const CadModel& base, const Mesh& mesh, double given_mm);

/// The same where `mesh` may have been made of another model, `variant`, that was given, too.
std::string likely_mistake(const CadModel& base, const CadModel& variant, const Mesh& mesh,
                           double given_mm);

}  // namespace cadmorph
