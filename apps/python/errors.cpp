#include "apps/python/errors.h"

#include <cadmorph/errors.h>

#include <string>

namespace cadmorph::python {
namespace {

namespace py = pybind11;

// Kept for the whole process: exceptions may fly until its end.
struct Exceptions {
  PyObject *error, *invalid_input, *io, *cad, *topology, *association, *quality, *solver, *output,
      *cancelled;
};
Exceptions all;

PyObject* add(py::module_& module, const char* name, const char* doc, int exit_code,
              PyObject* second_base = nullptr) {
  const std::string full = "cadmorph." + std::string(name);
  py::tuple bases = all.error && second_base
                        ? py::make_tuple(py::handle(all.error), py::handle(second_base))
                        : py::make_tuple(py::handle(all.error ? all.error : PyExc_Exception));
  PyObject* exception = PyErr_NewExceptionWithDoc(full.c_str(), doc, bases.ptr(), nullptr);
  if (!exception) throw py::error_already_set();
  py::handle(exception).attr("exit_code") = exit_code;
  module.attr(name) = py::handle(exception);
  return exception;
}

void translate(std::exception_ptr pointer) {
  try {
    if (pointer) std::rethrow_exception(pointer);
  } catch (const InvalidInputError& error) {
    PyErr_SetString(all.invalid_input, error.what());
  } catch (const IoError& error) {
    PyErr_SetString(all.io, error.what());
  } catch (const CadError& error) {
    PyErr_SetString(all.cad, error.what());
  } catch (const TopologyError& error) {
    PyErr_SetString(all.topology, error.what());
  } catch (const AssociationError& error) {
    PyErr_SetString(all.association, error.what());
  } catch (const QualityError& error) {
    PyErr_SetString(all.quality, error.what());
  } catch (const SolverError& error) {
    PyErr_SetString(all.solver, error.what());
  } catch (const OutputError& error) {
    PyErr_SetString(all.output, error.what());
  } catch (const CancelledError& error) {
    PyErr_SetString(all.cancelled, error.what());
  } catch (const Error& error) {
    PyErr_SetString(all.error, error.what());
  }
}

}  // namespace

void add_errors(py::module_& module) {
  all = {};
  all.error = add(module, "Error",
                  "Root of all that cadmorph raises on purpose. The text says what went wrong, "
                  "where, likely why, and what to do next; exit_code is the program's.",
                  6);
  all.invalid_input = add(module, "InvalidInputError",
                          "An argument or an input violates its contract.", 2, PyExc_ValueError);
  all.io = add(module, "IoError", "A file can't be read.", 2, PyExc_OSError);
  all.cad = add(module, "CadError", "CAD geometry can't be read or evaluated.", 2);
  all.topology =
      add(module, "TopologyError", "The two CAD models do not correspond, entity by entity.", 3);
  all.association = add(module, "AssociationError", "The mesh does not lie on the base CAD.", 4);
  all.quality = add(module, "QualityError",
                    "Inverted elements remain, or the quality is below what was asked.", 5);
  all.solver =
      add(module, "SolverError", "A system can't be solved as asked, or memory ran out.", 6);
  all.output = add(module, "OutputError", "A result can't be written.", 6, PyExc_OSError);
  all.cancelled = add(module, "CancelledError", "A progress callback returned False.", 6);
  py::register_exception_translator(translate);
}

}  // namespace cadmorph::python
