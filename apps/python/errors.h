#pragma once

#include <pybind11/pybind11.h>

namespace cadmorph::python {

/// Adds the exceptions to the module, and the turning of the library's errors into them.
void add_errors(pybind11::module_& module);

}  // namespace cadmorph::python
