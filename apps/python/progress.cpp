#include "apps/python/progress.h"

namespace cadmorph::python {

PythonProgress::PythonProgress(py::object callback) : callback_(std::move(callback)) {
  if (!callback_.is_none() && !PyCallable_Check(callback_.ptr()))
    throw InvalidInputError(
        "progress: expected a function of the phase's name and the fraction done, not " +
        std::string(py::str(py::type::of(callback_))));
}

Progress PythonProgress::function() {
  return [this](std::string_view phase, double fraction) { return tell(phase, fraction); };
}

bool PythonProgress::tell(std::string_view phase, double fraction) {
  const py::gil_scoped_acquire acquire;
  if (error_) return false;
  try {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return callback_.is_none() || !callback_(phase, fraction).is(py::bool_(false));
  } catch (py::error_already_set& error) {
    error_.emplace(std::move(error));
    return false;
  }
}

void PythonProgress::raise_error() {
  if (error_) throw py::error_already_set(*error_);
}

}  // namespace cadmorph::python
