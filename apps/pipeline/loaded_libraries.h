#pragma once

#include <string>

namespace cadmorph {

/// A hash that tells whether two processes run with the same shared libraries: of their names and
/// build ids, or of the whole file of one without an id. Throws IoError.
std::string loaded_libraries();

}  // namespace cadmorph
