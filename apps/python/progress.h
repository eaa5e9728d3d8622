#pragma once

#include <cadmorph/errors.h>
#include <cadmorph/progress.h>
#include <pybind11/pybind11.h>

#include <optional>

namespace cadmorph::python {

namespace py = pybind11;

/// Calls a Python callback from work that runs without the interpreter's lock, and lets Ctrl-C end
/// that. A Python error stays here until the work has ended.
class PythonProgress {
 public:
  explicit PythonProgress(py::object callback);
  PythonProgress(const PythonProgress&) = delete;
  PythonProgress& operator=(const PythonProgress&) = delete;

  Progress function();
  /// Raises what the callback raised, or the interrupt, if there was one.
  void raise_error();

 private:
  bool tell(std::string_view phase, double fraction);

  py::object callback_;
  std::optional<py::error_already_set> error_;
};

/// Runs work(progress) without the interpreter's lock.
template <class Work>
auto run_unlocked(const py::object& callback, const Work& work) {
  PythonProgress progress(callback);
  try {
    const py::gil_scoped_release release;
    return work(progress.function());
  } catch (const CancelledError&) {
    progress.raise_error();
    throw;
  }
}

}  // namespace cadmorph::python
