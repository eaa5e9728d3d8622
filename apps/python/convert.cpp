#include "apps/python/convert.h"

#include <limits>
#include <map>

namespace cadmorph::python {
namespace {

// "float32 of shape (5, 3)"
std::string type_and_shape(const py::array& array) {
  return std::string(py::str(array.dtype())) + " of shape " +
         std::string(py::str(array.attr("shape")));
}

py::array to_array(const py::object& object, const std::string& what, const char* expected) {
  py::array array = py::array::ensure(object);
  if (array) return array;
  PyErr_Clear();
  throw InvalidInputError(what + ": expected " + expected + ", not " +
                          std::string(py::str(py::type::of(object))));
}

bool is_integral(const py::array& array) {
  return array.dtype().kind() == 'i' || array.dtype().kind() == 'u';
}

std::vector<Index> integers_of(const py::array& array, const std::string& what) {
  if (array.size() > 0 && !is_integral(array))
    throw InvalidInputError(what + ": expected an array of integers, not " + type_and_shape(array));
  if (array.dtype().kind() == 'u' && array.itemsize() == 8 && array.size() > 0 &&
      array.attr("max")().cast<std::uint64_t>() > std::uint64_t(std::numeric_limits<Index>::max()))
    throw InvalidInputError(what + ": a number is above 2^63 - 1");
  const auto flat = py::array_t<Index, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!flat) throw py::error_already_set();
  return {flat.data(), flat.data() + flat.size()};
}

// An array of a shape that fits, as doubles.
template <class Fits>
RowMatrix rows_of(const py::object& object, const std::string& name, const std::string& expected,
                  const Fits& fits) {
  const py::array array = to_array(object, name, expected.c_str());
  if (!fits(array))
    throw InvalidInputError(name + ": expected " + expected + ", not " + type_and_shape(array));
  const bool is_float64 = array.dtype().kind() == 'f' && array.itemsize() == 8;
  if (!is_float64 && !is_integral(array))
    throw InvalidInputError(name + ": expected " + expected + ", not " + type_and_shape(array) +
                            "; where fewer digits do, convert it by .astype(float)");
  const auto rows = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!rows) throw py::error_already_set();
  return Eigen::Map<const RowMatrix>(rows.data(), rows.shape(0), rows.shape(1));
}

struct CellKind {
  std::uint8_t vtk;
  Index nodes;  ///< 0: any number
};

// The types of meshio that cadmorph takes; node orders are VTK's.
const std::map<std::string, CellKind>& meshio_types() {
  static const std::map<std::string, CellKind> all = {
      {"vertex", {1, 1}},         {"line", {3, 2}},           {"triangle", {5, 3}},
      {"polygon", {7, 0}},        {"quad", {9, 4}},           {"tetra", {10, 4}},
      {"hexahedron", {12, 8}},    {"wedge", {13, 6}},         {"pyramid", {14, 5}},
      {"line3", {21, 3}},         {"triangle6", {22, 6}},     {"quad8", {23, 8}},
      {"tetra10", {24, 10}},      {"hexahedron20", {25, 20}}, {"wedge15", {26, 15}},
      {"pyramid13", {27, 13}},    {"quad9", {28, 9}},         {"hexahedron27", {29, 27}},
      {"quad6", {30, 6}},         {"wedge12", {31, 12}},      {"wedge18", {32, 18}},
      {"hexahedron24", {33, 24}}, {"triangle7", {34, 7}}};
  return all;
}

CellKind kind_of(const py::object& type, const std::string& what) {
  if (py::isinstance<py::str>(type)) {
    const auto name = type.cast<std::string>();
    if (name.starts_with("polygon")) return {7, 0};
    if (const auto kind = meshio_types().find(name); kind != meshio_types().end())
      return kind->second;
    throw InvalidInputError(what + ": cells of the type '" + name +
                            "' can't be used; those of first and second order can, by meshio's "
                            "names ('tetra', 'hexahedron20')");
  }
  if (PyIndex_Check(type.ptr())) {
    const auto number = py::int_(type).cast<Index>();
    for (const auto& [name, kind] : meshio_types())
      if (kind.vtk == number) return kind;
    if (number > 0 && number < 256) return {std::uint8_t(number), 0};
  }
  throw InvalidInputError(what + ": " + std::string(py::repr(type)) +
                          " is no type of cells; give meshio's name or VTK's number");
}

void add_block(const py::object& type, const py::object& data, MeshArrays& arrays,
               std::size_t number) {
  const std::string what = "cells[" + std::to_string(number) + "]";
  const CellKind kind = kind_of(type, what);
  const py::array block = to_array(data, what, "an array of shape (cells, nodes of one)");
  if (block.size() == 0) return;
  if (block.ndim() != 2 || (kind.nodes > 0 && block.shape(1) != kind.nodes))
    throw InvalidInputError(what + ": expected an array of shape (cells, " +
                            (kind.nodes > 0 ? std::to_string(kind.nodes) : "nodes of one") +
                            ") for " + std::string(py::repr(type)) + ", not " +
                            type_and_shape(block));
  const std::vector<Index> nodes = integers_of(block, what);
  arrays.connectivity.insert(arrays.connectivity.end(), nodes.begin(), nodes.end());
  for (py::ssize_t row = 0; row < block.shape(0); ++row) {
    arrays.types.push_back(kind.vtk);
    arrays.offsets.push_back(arrays.offsets.back() + block.shape(1));
  }
}

void add_blocks(const py::object& cells, MeshArrays& arrays) {
  const py::object blocks =
      py::isinstance<py::dict>(cells) ? py::object(cells.attr("items")()) : cells;
  if (!py::isinstance<py::iterable>(blocks) || py::isinstance<py::array>(blocks))
    throw InvalidInputError(
        "cells: expected a list of (type, array) as in meshio, or, with celltypes, VTK's flat "
        "array "
        "(number of nodes, node ids, number, ...); not " +
        std::string(py::str(py::type::of(cells))));
  std::size_t number = 0;
  for (const py::handle& handle : blocks) {
    const auto block = py::reinterpret_borrow<py::object>(handle);
    if (py::hasattr(block, "type") && py::hasattr(block, "data"))
      add_block(block.attr("type"), block.attr("data"), arrays, number);
    else if (py::isinstance<py::sequence>(block) && py::len(block) == 2)
      add_block(block[py::int_(0)], block[py::int_(1)], arrays, number);
    else
      throw InvalidInputError("cells[" + std::to_string(number) +
                              "]: expected a pair (type, array), not " +
                              std::string(py::str(py::type::of(block))));
    ++number;
  }
}

void add_flat_cells(const py::object& cells, const py::object& celltypes, MeshArrays& arrays) {
  const std::vector<Index> flat = to_integers(cells, "cells");
  const std::vector<Index> types = to_integers(celltypes, "celltypes");
  std::size_t at = 0;
  for (const Index type : types) {
    const std::string cell = "cell " + std::to_string(arrays.types.size());
    if (type < 0 || type > 255)
      throw InvalidInputError("celltypes: " + cell + " has the type " + std::to_string(type) +
                              ", which is none of VTK's");
    if (at >= flat.size())
      throw InvalidInputError("cells: ends before " + cell + "; celltypes has " +
                              std::to_string(types.size()));
    const Index count = flat[at++];
    if (count < 0 || count > std::ssize(flat) - Index(at))
      throw InvalidInputError("cells: " + cell + " says that it has " + std::to_string(count) +
                              " nodes; the array ends before them");
    const auto first = flat.begin() + std::ptrdiff_t(at);
    arrays.connectivity.insert(arrays.connectivity.end(), first, first + count);
    arrays.types.push_back(std::uint8_t(type));
    arrays.offsets.push_back(std::ssize(arrays.connectivity));
    at += std::size_t(count);
  }
  if (at != flat.size())
    throw InvalidInputError("cells: goes on after the last of " + std::to_string(types.size()) +
                            " cells that celltypes names");
}

}  // namespace

Points to_points(const py::object& object, const char* what, Index nodes) {
  const std::string rows = nodes < 0 ? "N" : std::to_string(nodes);
  const std::string expected = "a float64 array of shape (" + rows + ", 3)";
  return rows_of(object, what, expected, [&](const py::array& array) {
    return array.ndim() == 2 && array.shape(1) == 3 && (nodes < 0 || array.shape(0) == nodes);
  });
}

RowMatrix to_rows(const py::object& object, const char* what) {
  return rows_of(object, what, "a float64 array of shape (nodes, columns)",
                 [](const py::array& array) { return array.ndim() == 2; });
}

std::vector<Index> to_integers(const py::object& object, const std::string& what) {
  const py::array array = to_array(object, what, "an array of integers");
  if (array.ndim() != 1)
    throw InvalidInputError(what + ": expected integers in one dimension, not " +
                            type_and_shape(array));
  return integers_of(array, what);
}

std::vector<Index> to_flat_integers(const py::object& object, const std::string& what) {
  return integers_of(to_array(object, what, "an array of integers"), what);
}

MeshArrays to_mesh_arrays(const py::object& points, const py::object& cells,
                          const py::object& celltypes, const py::object& regions,
                          const py::object& groups) {
  MeshArrays arrays;
  arrays.points = to_points(points, "points");
  arrays.offsets = {0};
  if (celltypes.is_none())
    add_blocks(cells, arrays);
  else
    add_flat_cells(cells, celltypes, arrays);
  if (!regions.is_none())
    for (const Index region : to_integers(regions, "regions")) {
      if (region < std::numeric_limits<int>::min() || region > std::numeric_limits<int>::max())
        throw InvalidInputError("regions: " + std::to_string(region) + " has more than 32 bits");
      arrays.regions.push_back(int(region));
    }
  if (groups.is_none()) return arrays;
  if (!py::isinstance<py::dict>(groups))
    throw InvalidInputError("groups: expected a dict of names and arrays of node ids");
  for (const auto& [name, nodes] : py::dict(groups)) {
    const std::string text = py::str(name);
    arrays.groups.push_back(
        {text, to_integers(py::reinterpret_borrow<py::object>(nodes), "groups['" + text + "']")});
  }
  return arrays;
}

std::string_view Source::view() const {
  return {PyBytes_AS_STRING(bytes.ptr()), std::size_t(PyBytes_GET_SIZE(bytes.ptr()))};
}

Source to_source(const py::object& object) {
  if (py::hasattr(object, "read")) {
    const py::object contents = object.attr("read")();
    if (py::isinstance<py::str>(contents))
      throw InvalidInputError(
          "expected a file that is open in binary mode ('rb'), not in text mode");
    return to_source(contents);
  }
  if (PyObject_CheckBuffer(object.ptr())) {
    auto bytes = py::reinterpret_steal<py::object>(PyBytes_FromObject(object.ptr()));
    if (!bytes) throw py::error_already_set();
    return {"", bytes};
  }
  PyObject* path = nullptr;
  if (!PyUnicode_FSConverter(object.ptr(), &path)) throw py::error_already_set();
  const auto encoded = py::reinterpret_steal<py::bytes>(path);
  return {std::string(encoded)};
}

}  // namespace cadmorph::python
