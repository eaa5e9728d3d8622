#pragma once

#include <pybind11/pybind11.h>

namespace cadmorph::python {

/// Adds the classes of the report to the module.
void add_reports(pybind11::module_& module);

}  // namespace cadmorph::python
