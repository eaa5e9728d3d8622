#pragma once

#include <cadmorph/cadmorph.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <vector>

namespace cadmorph::python {

namespace py = pybind11;

/// Node positions of a Python object. Throws InvalidInputError that says what was expected for what
/// is no array of shape (N, 3) of float64 or integers; `nodes`, if not negative, is N.
Points to_points(const py::object& object, const char* what, Index nodes = -1);

/// The same of any width.
RowMatrix to_rows(const py::object& object, const char* what);

/// The integers of an array of one dimension. Throws InvalidInputError.
std::vector<Index> to_integers(const py::object& object, const std::string& what);

/// The same of any shape, row after row.
std::vector<Index> to_flat_integers(const py::object& object, const std::string& what);

/// The cells of a Mesh call: blocks of (type, array) as meshio has them, or VTK's flat array with
/// the types. Throws InvalidInputError.
MeshArrays to_mesh_arrays(const py::object& points, const py::object& cells,
                          const py::object& celltypes, const py::object& regions,
                          const py::object& groups);

/// What a CAD model or a mesh is read from.
struct Source {
  std::string path;               ///< of a file, where there are no bytes
  py::object bytes = py::none();  ///< a bytes object that keeps the contents
  std::string_view view() const;
};

/// A path, an object with bytes in memory, or an open file, which is read. Throws TypeError for
/// anything else; what reading throws.
Source to_source(const py::object& object);

/// A view of an array that `owner` keeps; not writable.
template <class Value>
py::array view(const Value* data, std::vector<py::ssize_t> shape, const py::handle& owner) {
  py::array_t<Value> array(std::move(shape), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// An array that takes over a vector.
template <class Value>
py::array take(std::vector<Value> values) {
  auto* const kept = new std::vector<Value>(std::move(values));
  const py::capsule owner(kept, [](void* all) { delete static_cast<std::vector<Value>*>(all); });
  return py::array_t<Value>({py::ssize_t(kept->size())}, kept->data(), owner);
}

}  // namespace cadmorph::python
