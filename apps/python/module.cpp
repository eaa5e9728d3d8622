// The Python module cadmorph._native: the public interface for numpy arrays.

#include <cadmorph/cadmorph.h>
#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <sstream>

#include "apps/python/convert.h"
#include "apps/python/errors.h"
#include "apps/python/progress.h"
#include "apps/python/reports.h"

namespace cadmorph::python {
namespace {

using namespace py::literals;

template <class Choice>
Choice choose(const char* option, const std::string& text,
              std::initializer_list<std::pair<const char*, Choice>> choices) {
  std::string names;
  for (const auto& [name, choice] : choices) {
    if (text == name) return choice;
    names += (names.empty() ? "'" : ", '") + std::string(name) + "'";
  }
  throw InvalidInputError(std::string(option) + ": '" + text + "' is no choice; give one of " +
                          names);
}

Unmatched unmatched_of(const std::string& text) {
  return choose<Unmatched>("unmatched", text,
                           {{"auto", Unmatched::Auto},
                            {"error", Unmatched::Error},
                            {"fix", Unmatched::Fix},
                            {"slide", Unmatched::Slide}});
}

Method method_of(const std::string& text) {
  return choose<Method>("method", text,
                        {{"rbf", Method::Rbf},
                         {"femwarp", Method::Femwarp},
                         {"lbwarp", Method::Lbwarp},
                         {"simplex-linear", Method::SimplexLinear}});
}

Solver solver_of(const std::string& text) {
  return choose<Solver>("solver", text,
                        {{"auto", Solver::Auto},
                         {"adaptive", Solver::Adaptive},
                         {"lu", Solver::Lu},
                         {"ldlt", Solver::Ldlt},
                         {"cholesky", Solver::Cholesky},
                         {"iqr", Solver::Iqr},
                         {"fast", Solver::Fast}});
}

Untangle untangle_of(const std::string& text) {
  return choose<Untangle>(
      "untangle", text,
      {{"auto", Untangle::Auto}, {"never", Untangle::Never}, {"always", Untangle::Always}});
}

Quality quality_of(const std::string& text) {
  return choose<Quality>("quality", text, {{"best", Quality::Best}, {"fast", Quality::Fast}});
}

Kernel kernel_of(const std::string& text) {
  return choose<Kernel>("kernel", text,
                        {{"triharmonic", Kernel::Triharmonic},
                         {"biharmonic", Kernel::Biharmonic},
                         {"quadharmonic", Kernel::Quadharmonic},
                         {"gaussian", Kernel::Gaussian},
                         {"multiquadric", Kernel::Multiquadric},
                         {"inverse-multiquadric", Kernel::InverseMultiquadric},
                         {"wendland-c2", Kernel::WendlandC2},
                         {"wendland-c4", Kernel::WendlandC4}});
}

SolverFamily solver_family_of(const std::string& text) {
  return choose<SolverFamily>("solver_family", text,
                              {{"auto", SolverFamily::OfFormat},
                               {"fe", SolverFamily::FiniteElements},
                               {"fv", SolverFamily::FiniteVolumes}});
}

std::string path_of(const py::object& path) {
  const Source source = to_source(path);
  if (!source.bytes.is_none())
    throw InvalidInputError("expected a path, not the contents of a file");
  return source.path;
}

std::string name_of(const py::object& name, const py::object& source, const char* otherwise) {
  if (!name.is_none()) return py::str(name);
  if (py::hasattr(source, "name")) return py::str(source.attr("name"));
  return otherwise;
}

CadModel read_step_source(const py::object& object, const py::object& name) {
  const Source source = to_source(object);
  if (source.bytes.is_none()) {
    const py::gil_scoped_release release;
    return CadModel::from_step(source.path);
  }
  const std::string called = name_of(name, object, "STEP in memory");
  const std::string_view bytes = source.view();
  const py::gil_scoped_release release;
  return CadModel::from_step_bytes(bytes, called);
}

CadModel read_brep_source(const py::object& object, const py::object& name) {
  const bool is_text = py::isinstance<py::str>(object);
  const Source source = to_source(is_text ? object.attr("encode")() : object);
  if (source.bytes.is_none())
    throw InvalidInputError(
        "expected a shape's BREP data as bytes, text or an open file, not a path");
  const std::string called = name_of(name, object, "BREP in memory");
  const std::string_view bytes = source.view();
  const py::gil_scoped_release release;
  return CadModel::from_brep_bytes(bytes, called);
}

// CAD programs agree on the format, not on how to ask for it.
CadModel read_shape(const py::object& shape, const py::object& name) {
  if (py::hasattr(shape, "exportBrepToString"))  // FreeCAD
    return read_brep_source(shape.attr("exportBrepToString")(), name);
  const py::object buffer = py::module_::import("io").attr("BytesIO")();
  if (py::hasattr(shape, "exportBrep"))  // CadQuery
    shape.attr("exportBrep")(buffer);
  else if (py::hasattr(shape, "val"))  // CadQuery's workplane
    return read_shape(shape.attr("val")(), name);
  else if (py::hasattr(shape, "wrapped"))  // build123d
    py::module_::import("build123d").attr("export_brep")(shape, buffer);
  else
    throw InvalidInputError("expected a shape of FreeCAD, CadQuery or build123d, not " +
                            std::string(py::str(py::type::of(shape))) +
                            "; of another program give its BREP data to from_brep");
  return read_brep_source(buffer.attr("getvalue")(), name);
}

std::string describe(const CadModel& model) {
  std::ostringstream text;
  text << "CadModel('" << model.name() << "', " << model.face_count() << " faces, "
       << model.diagonal_mm() << " mm)";
  return text.str();
}

void add_cad_model(py::module_& module) {
  py::class_<CadModel>(module, "CadModel",
                       "A CAD model in millimetres. It does not change; threads may share it.")
      .def_static("from_step", &read_step_source, "source"_a, "name"_a = py::none(),
                  "Reads STEP (AP203, AP214, AP242) from a path, from bytes in memory or from an "
                  "open binary file; `name` stands for the path in reports and messages. Raises "
                  "IoError, CadError.")
      .def_static("from_brep", &read_brep_source, "data"_a, "name"_a = py::none(),
                  "Reads a shape in OCCT's BREP format (bytes, text or an open file), lengths in "
                  "millimetres. Raises CadError.")
      .def_static("from_shape", &read_shape, "shape"_a, "name"_a = py::none(),
                  "Takes a shape of FreeCAD (Part.Shape), CadQuery or build123d, without a file. "
                  "Raises CadError.")
      .def_property_readonly("name", &CadModel::name)
      .def_property_readonly("unit", &CadModel::unit,
                             "Length unit named in the file; the model is in millimetres.")
      .def_property_readonly("face_count", &CadModel::face_count)
      .def_property_readonly("edge_count", &CadModel::edge_count)
      .def_property_readonly("vertex_count", &CadModel::vertex_count)
      .def_property_readonly("solid_count", &CadModel::solid_count)
      .def_property_readonly("lower_mm", &CadModel::lower_mm, "Corner of the bounding box, (3,).")
      .def_property_readonly("upper_mm", &CadModel::upper_mm, "Corner of the bounding box, (3,).")
      .def_property_readonly("diagonal_mm", &CadModel::diagonal_mm, "Of the bounding box.")
      .def("__repr__", &describe);
}

Mesh make_mesh(const py::object& points, const py::object& cells, const py::object& celltypes,
               const py::object& regions, const py::object& groups, const std::string& name) {
  const MeshArrays arrays = to_mesh_arrays(points, cells, celltypes, regions, groups);
  const py::gil_scoped_release release;
  return Mesh(arrays, name);
}

Mesh mesh_of_gmsh(const py::object& node_tags, const py::object& coordinates,
                  const py::object& element_types, const py::object& element_node_tags,
                  const std::string& name) {
  const auto tags_of = [](const py::object& object, const std::string& what) {
    std::vector<std::size_t> tags;
    for (const Index tag : to_integers(object, what)) tags.push_back(std::size_t(tag));
    return tags;
  };
  const std::vector<std::size_t> tags = tags_of(node_tags, "node_tags");
  const py::object rows =
      py::module_::import("numpy").attr("asarray")(coordinates).attr("reshape")(-1, 3);
  const Points points = to_points(rows, "coordinates", std::ssize(tags));
  const std::vector<Index> types = to_integers(element_types, "element_types");
  if (!py::isinstance<py::sequence>(element_node_tags) ||
      py::len(element_node_tags) != types.size())
    throw InvalidInputError("element_node_tags: expected a list of " +
                            std::to_string(types.size()) + " arrays, one for each element type");
  std::vector<GmshElements> elements;
  for (std::size_t i = 0; i < types.size(); ++i)
    elements.push_back({int(types[i]), tags_of(element_node_tags[py::int_(i)],
                                               "element_node_tags[" + std::to_string(i) + "]")});
  const py::gil_scoped_release release;
  return Mesh::from_gmsh(tags, points, elements, name);
}

Mesh mesh_of_meshio(const py::object& mesh) {
  const py::object groups = py::module_::import("cadmorph._meshio").attr("groups_of")(mesh);
  return make_mesh(mesh.attr("points"), mesh.attr("cells"), py::none(), py::none(), groups,
                   "mesh of meshio");
}

Mesh mesh_of_pyvista(const py::object& grid) {
  return make_mesh(grid.attr("points"), grid.attr("cells"), grid.attr("celltypes"), py::none(),
                   py::none(), "mesh of PyVista");
}

py::array points_of(const py::object& self) {
  const Points& points = self.cast<const Mesh&>().points();
  return view(points.data(), {points.rows(), 3}, self);
}

// VTK's flat array: number of nodes, their ids, the next cell's number, ...
py::array flat_cells(const Mesh& mesh) {
  std::vector<Index> flat;
  flat.reserve(mesh.connectivity().size() + std::size_t(mesh.cell_count()));
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const Index first = mesh.offsets()[c], end = mesh.offsets()[c + 1];
    flat.push_back(end - first);
    flat.insert(flat.end(), mesh.connectivity().begin() + first, mesh.connectivity().begin() + end);
  }
  return take(std::move(flat));
}

py::dict groups_of(const Mesh& mesh) {
  py::dict result;
  for (MeshGroup& group : mesh.groups()) result[py::str(group.name)] = take(std::move(group.nodes));
  return result;
}

py::object path_object(const std::filesystem::path& path) {
  return py::module_::import("pathlib").attr("Path")(path.string());
}

py::object write_mesh(const Mesh& mesh, const py::object& path, const py::object& positions) {
  const std::string target = path_of(path);
  const Points points =
      positions.is_none() ? mesh.points() : to_points(positions, "positions", mesh.node_count());
  const auto written = [&] {
    const py::gil_scoped_release release;
    return mesh.write(target, points);
  }();
  return path_object(written.path);
}

void add_mesh(py::module_& module) {
  py::class_<Mesh>(module, "Mesh",
                   "A mesh: shells and solids of first and second order, polyhedra from files. It "
                   "does not change; threads may share it.")
      .def(py::init(&make_mesh), "points"_a, "cells"_a, "celltypes"_a = py::none(), py::kw_only(),
           "regions"_a = py::none(), "groups"_a = py::none(), "name"_a = "mesh in memory",
           "Takes arrays. points: float64 (N, 3), in the mesh's own unit. cells: a list of (type, "
           "array (cells, nodes of one)) with meshio's names or VTK's numbers, node ids from 0 in "
           "VTK's order; or VTK's flat array (number of nodes, ids, number, ...) with celltypes "
           "(C,). regions: integers (C,). groups: a dict of names and node ids. Raises "
           "InvalidInputError.")
      .def_static(
          "read",
          [](const py::object& path) {
            const std::string name = path_of(path);
            const py::gil_scoped_release release;
            return Mesh::read(name);
          },
          "path"_a,
          "Reads a file or folder of any format of docs/formats.md. Raises IoError, "
          "InvalidInputError.")
      .def_static("from_gmsh", &mesh_of_gmsh, "node_tags"_a, "coordinates"_a, "element_types"_a,
                  "element_node_tags"_a, "name"_a = "mesh of gmsh",
                  "Takes what gmsh.model.mesh.getNodes() (the first two) and getElements() (the "
                  "first and the last) return; nodes keep their order. Raises InvalidInputError.")
      .def_static(
          "from_meshio", &mesh_of_meshio, "mesh"_a,
          "Takes a meshio.Mesh: its points and cells, and as groups its point sets, cell sets "
          "and named physical groups of gmsh. Raises InvalidInputError.")
      .def_static("from_pyvista", &mesh_of_pyvista, "grid"_a,
                  "Takes a pyvista.UnstructuredGrid: its points, which must be of double "
                  "precision, and cells. Raises InvalidInputError.")
      .def(
          "at",
          [](const Mesh& mesh, const py::object& positions) {
            return mesh.at(to_points(positions, "positions", mesh.node_count()));
          },
          "positions"_a,
          "The same mesh at other positions (N, 3), float64: where a morph begins that goes on "
          "from "
          "another one. Raises InvalidInputError.")
      .def("write", &write_mesh, "path"_a, "positions"_a = py::none(),
           "Writes a copy at positions (N, 3): of a file to the byte as it was but for coordinates "
           "that changed; of arrays as .vtu or .vtk. Returns the path. Raises OutputError, "
           "InvalidInputError.")
      .def_property_readonly("points", &points_of,
                             "float64 (N, 3), in the mesh's own unit; a view, not writable.")
      .def_property_readonly(
          "celltypes", [](const Mesh& mesh) { return take(mesh.types()); },
          "uint8 (C,): VTK's numbers.")
      .def_property_readonly(
          "offsets",
          [](const py::object& self) {
            const auto& offsets = self.cast<const Mesh&>().offsets();
            return view(offsets.data(), {py::ssize_t(offsets.size())}, self);
          },
          "int64 (C + 1,): where each cell begins in connectivity; a view, not writable.")
      .def_property_readonly(
          "connectivity",
          [](const py::object& self) {
            const auto& nodes = self.cast<const Mesh&>().connectivity();
            return view(nodes.data(), {py::ssize_t(nodes.size())}, self);
          },
          "int64: node ids, cell after cell; a view, not writable.")
      .def_property_readonly("cells", &flat_cells,
                             "int64: VTK's flat array, as pyvista.UnstructuredGrid takes it.")
      .def_property_readonly(
          "regions",
          [](const py::object& self) {
            const auto& regions = self.cast<const Mesh&>().regions();
            return view(regions.data(), {py::ssize_t(regions.size())}, self);
          },
          "int32 (C,), or empty; a view, not writable.")
      .def_property_readonly("groups", &groups_of, "A dict of names and node ids.")
      .def_property_readonly("node_count", &Mesh::node_count)
      .def_property_readonly("cell_count", &Mesh::cell_count)
      .def_property_readonly("format", &Mesh::format)
      .def_property_readonly("name", &Mesh::name)
      .def_property_readonly("remarks", &Mesh::remarks, "What the file's user should know.")
      .def("__repr__", [](const Mesh& mesh) {
        return "Mesh('" + mesh.name() + "', " + std::to_string(mesh.node_count()) + " nodes, " +
               std::to_string(mesh.cell_count()) + " cells)";
      });
}

void add_result(py::module_& module) {
  py::class_<MorphResult>(module, "MorphResult", "A mesh morphed onto a variant.")
      .def_property_readonly(
          "positions",
          [](const py::object& self) {
            const Points& points = self.cast<const MorphResult&>().positions();
            return view(points.data(), {points.rows(), 3}, self);
          },
          "float64 (N, 3), in the mesh's unit; a view, not writable.")
      .def_property_readonly("report", &MorphResult::report, py::return_value_policy::copy)
      .def_property_readonly("mesh", &MorphResult::mesh, py::return_value_policy::copy,
                             "The one morphed, as it was.")
      .def("summary", &MorphResult::summary, "The report as the program prints it.")
      .def("json", &MorphResult::json, "The report as the program's --json writes it.")
      .def(
          "write",
          [](const MorphResult& result, const py::object& path, bool has_diagnostics) {
            const std::string target = path_of(path);
            const auto written = [&] {
              const py::gil_scoped_release release;
              return result.write(target, has_diagnostics);
            }();
            return path_object(written.path);
          },
          "path"_a, "diagnostics"_a = false,
          "Writes the mesh with the new positions, as Mesh.write; a refused one, its bad cells "
          "marked in cadmorph_bad, to <stem>.failed.<ext> beside. diagnostics adds the arrays of "
          "the program's --diagnostics. Returns the path. Raises OutputError, InvalidInputError.")
      .def("__repr__", [](const MorphResult& result) {
        return "MorphResult(" + std::to_string(result.positions().rows()) + " nodes, moved by at " +
               "most " + std::string(py::str(py::float_(result.report().max_displacement_mm))) +
               " mm)";
      });
}

void add_derivative(py::module_& module) {
  const auto apply = [](RowMatrix (Derivative::*map)(const RowMatrix&) const, const char* what) {
    return [map, what](const Derivative& self, const py::object& rows) {
      const RowMatrix values = to_rows(rows, what);
      const py::gil_scoped_release release;
      return (self.*map)(values);
    };
  };
  py::class_<Derivative>(module, "Derivative",
                         "The volume morph as a linear map, the centres that it chose held, and "
                         "its transpose: of one plain morph, without steps and repair. It does not "
                         "change; threads may share it.")
      .def(
          "forward", apply(&Derivative::forward, "surface"), "surface"_a,
          "Returns the displacements of all nodes, float64 (N, M), for those of the surface nodes, "
          "(m, M); each column counts by itself. Raises InvalidInputError, SolverError.")
      .def(
          "adjoint", apply(&Derivative::adjoint, "volume"), "volume"_a,
          "Returns the derivative of a quantity by the surface nodes' positions, float64 (m, M), "
          "for that by the positions of all nodes, (N, M). Raises InvalidInputError, SolverError.");
  py::class_<Velocity>(
      module, "Velocity",
      "How the nodes move with a CAD parameter, in the mesh's unit per unit of it.")
      .def_property_readonly(
          "surface",
          [](const py::object& self) {
            const Points& rows = self.cast<const Velocity&>().surface();
            return view(rows.data(), {rows.rows(), 3}, self);
          },
          "float64 (m, 3), rows as Morpher.surface_nodes; a view, not writable.")
      .def_property_readonly(
          "nodes",
          [](const py::object& self) {
            const Points& rows = self.cast<const Velocity&>().nodes();
            return view(rows.data(), {rows.rows(), 3}, self);
          },
          "float64 (N, 3); a view, not writable.")
      .def_property_readonly("motion_mm", &Velocity::motion_mm,
                             "Most that the step moves a surface node.")
      .def_property_readonly(
          "errors",
          [](const py::object& self) -> py::object {
            const RowMatrix& rows = self.cast<const Velocity&>().errors();
            if (rows.cols() == 0) return py::none();
            return view(rows.data(), {rows.rows()}, self);
          },
          "float64 (N,), estimated; None without a second pair.")
      .def_property_readonly("unevenness", &Velocity::unevenness,
                             "Of the present surface between both models, in parts of the motion.")
      .def_property_readonly("warnings", &Velocity::warnings);
  py::class_<ParameterGradient>(module, "ParameterGradient", "What a parameter came to.")
      .def_readonly("name", &ParameterGradient::name)
      .def_readonly("gradient", &ParameterGradient::gradient, "dJ/dp.")
      .def_readonly("max_speed", &ParameterGradient::max_speed,
                    "Of a surface node, in the mesh's unit per unit of the parameter.")
      .def_readonly("motion_mm", &ParameterGradient::motion_mm,
                    "Most that the step moves a surface node.")
      .def_readonly("warnings", &ParameterGradient::warnings)
      .def("__repr__", [](const ParameterGradient& g) {
        return "ParameterGradient(" + std::string(py::repr(py::str(g.name))) + ", " +
               std::string(py::repr(py::float_(g.gradient))) + ")";
      });
}

// Options of no such name, with the one that was meant, in place of pybind11's list of all types.
void refuse_options(const py::kwargs& others) {
  if (others.empty()) return;
  const py::str name(others.begin()->first);
  const py::object signature =
      py::type::of<Morpher>().attr("__init__").attr("__doc__").attr("splitlines")()[py::int_(0)];
  const py::list names = py::module_::import("re").attr("findall")(R"((\w+): )", signature);
  // The program's names are parts of these: improve_below, kernel_shape.
  py::list near;
  for (const py::handle known : names)
    if (known.contains(name)) near.append(known);
  if (near.empty())
    near = py::module_::import("difflib").attr("get_close_matches")(name, names, 1, 0.5);
  const std::string meant =
      near.empty() ? "" : "did you mean '" + std::string(py::str(near[0])) + "'? ";
  throw py::type_error("Morpher has no option '" + std::string(name) + "': " + meant +
                       "help(cadmorph.Morpher) lists them");
}

std::unique_ptr<Morpher> make_morpher(
    const CadModel& base, const Mesh& mesh, const py::object& progress,
    std::optional<double> mesh_unit_mm, double association_tolerance, bool snap,
    const std::string& unmatched, std::vector<std::string> hold, std::vector<std::string> rigid,
    std::vector<std::string> slide, std::vector<std::string> follow,
    std::vector<std::pair<std::string, std::string>> periodic,
    std::vector<std::pair<int, int>> face_map, const std::string& method, const std::string& kernel,
    std::optional<double> kernel_shape, const std::string& solver, double solver_tolerance,
    double memory_limit_bytes, int steps, int max_steps, const std::string& untangle,
    const std::string& quality, const std::string& solver_family,
    std::optional<double> improve_below, std::optional<double> min_scaled_jacobian,
    bool keep_layers, bool accept_inverted_input, const py::kwargs& others) {
  refuse_options(others);
  const MorphOptions options{.mesh_unit_mm = mesh_unit_mm,
                             .association_tolerance = association_tolerance,
                             .snap = snap,
                             .unmatched = unmatched_of(unmatched),
                             .hold = std::move(hold),
                             .rigid = std::move(rigid),
                             .slide = std::move(slide),
                             .follow = std::move(follow),
                             .periodic = std::move(periodic),
                             .face_map = std::move(face_map),
                             .method = method_of(method),
                             .kernel = kernel_of(kernel),
                             .kernel_shape = kernel_shape,
                             .solver = solver_of(solver),
                             .solver_tolerance = solver_tolerance,
                             .memory_limit_bytes = memory_limit_bytes,
                             .steps = steps,
                             .max_steps = max_steps,
                             .untangle = untangle_of(untangle),
                             .quality = quality_of(quality),
                             .solver_family = solver_family_of(solver_family),
                             .improve_below = improve_below,
                             .min_scaled_jacobian = min_scaled_jacobian,
                             .keep_layers = keep_layers,
                             .accept_inverted_input = accept_inverted_input};
  return run_unlocked(progress, [&](const Progress& tell) {
    return std::make_unique<Morpher>(base, mesh, options, tell);
  });
}

std::vector<ParameterFiles> files_in_table(const py::object& table) {
  py::dict rows;
  try {
    rows = py::module_::import("cadmorph._parameters").attr("read_table")(table);
  } catch (py::error_already_set& error) {
    if (!error.matches(PyExc_TypeError)) throw;
    throw InvalidInputError("parameters: expected a dict, or the path of a table");
  }
  std::vector<ParameterFiles> files;
  for (const auto& [name, row] : rows) {
    const auto [plus, minus, step] =
        py::cast<std::tuple<std::filesystem::path, std::filesystem::path, double>>(row);
    files.push_back({py::str(name), plus, minus, step});
  }
  return files;
}

void add_morpher(py::module_& module) {
  const MorphOptions defaults;
  py::class_<Morpher>(
      module, "Morpher",
      "The base side of a morph: all that depends on the base CAD, its mesh and the "
      "options alone, for any number of variants. It serves one thread at a time.")
      .def(
          py::init(&make_morpher), "base"_a, "mesh"_a, py::kw_only(), "progress"_a = py::none(),
          "mesh_unit_mm"_a = py::none(), "association_tolerance"_a = defaults.association_tolerance,
          "snap"_a = false, "unmatched"_a = "auto", "hold"_a = defaults.hold,
          "rigid"_a = defaults.rigid, "slide"_a = defaults.slide, "follow"_a = defaults.follow,
          "periodic"_a = defaults.periodic, "face_map"_a = defaults.face_map, "method"_a = "rbf",
          "kernel"_a = "triharmonic", "kernel_shape"_a = py::none(), "solver"_a = "auto",
          "solver_tolerance"_a = defaults.solver_tolerance,
          "memory_limit_bytes"_a = defaults.memory_limit_bytes, "steps"_a = defaults.steps,
          "max_steps"_a = defaults.max_steps, "untangle"_a = "auto", "quality"_a = "best",
          "solver_family"_a = "auto", "improve_below"_a = py::none(),
          "min_scaled_jacobian"_a = py::none(), "keep_layers"_a = false,
          "accept_inverted_input"_a = false,
          R"(Finds the CAD entity of each surface node, measures the mesh and sets up the volume morph.

progress: called with the phase's name and the fraction of it done; returns False to cancel.
mesh_unit_mm: millimetres per mesh unit; None: detected.
association_tolerance: largest distance of a surface node from the CAD, in its shortest mesh edge.
snap: puts nodes exactly on the CAD instead of keeping their offset.
unmatched: what surface on no CAD face does: 'auto', 'error', 'fix', 'slide'.
hold, rigid, slide, follow: names of parts of the mesh that stay, move as one piece with the
    nearest part of the CAD, slide along their own surface, follow the volume.
periodic: pairs of names of sides a period apart, by a translation or a rotation: the second moves
    as the first does, turned with it.
face_map: pairs of base and variant face numbers, from 1 as 'cadmorph match' prints them.
method: 'rbf', 'femwarp', 'lbwarp', 'simplex-linear'.
kernel: of 'rbf': 'triharmonic', 'biharmonic', 'quadharmonic', 'gaussian', 'multiquadric',
    'inverse-multiquadric', 'wendland-c2', 'wendland-c4'.
kernel_shape: of the last five: epsilon, for Wendland's 1 / support; 1 / mesh unit.
solver: 'auto', 'adaptive', 'lu', 'ldlt', 'cholesky', 'iqr', 'fast'.
solver_tolerance: residual of the iterative solvers, in local edge lengths.
steps: 0: one, more (up to max_steps) while elements are inverted; or how many.
untangle: repair of inverted elements by optimisation: 'auto', 'never', 'always'.
quality: 'best' raises the worst elements where they lost shape, 'fast' does not.
solver_family: what 'best' goes by: 'fe', finite elements: the scaled Jacobian; 'fv', finite volumes:
    non-orthogonality and skewness of faces; 'auto': by the format of the mesh's file.
improve_below: raises elements with a scaled Jacobian below, by optimisation.
min_scaled_jacobian: refuses a result with an element below.
keep_layers: layers on walls keep their heights, as far as no element is inverted.
accept_inverted_input: elements that are inverted in the input may stay so.

Raises AssociationError, InvalidInputError, SolverError, CancelledError.)")
      .def(
          "morph",
          [](const Morpher& morpher, const CadModel& variant, const py::object& progress,
             bool keep_refused) {
            return run_unlocked(progress, [&](const Progress& tell) {
              return morpher.morph(variant, {.progress = tell, .keep_refused = keep_refused});
            });
          },
          "variant"_a, py::kw_only(), "progress"_a = py::none(), "keep_refused"_a = false,
          "Morphs onto a variant: to the last bit what the program writes. progress: as above. "
          "keep_refused returns a result with inverted or too poor elements instead of raising "
          "QualityError. Raises TopologyError, QualityError, SolverError, CancelledError; "
          "InvalidInputError while another call is at work on this object.")
      .def(
          "warp",
          [](const Morpher& morpher, const py::object& surface_positions) {
            const Points positions = to_points(surface_positions, "surface_positions",
                                               std::ssize(morpher.surface_nodes()));
            const py::gil_scoped_release release;
            return morpher.warp(positions);
          },
          "surface_positions"_a,
          "Returns the positions of all nodes, float64 (N, 3), for those of the surface nodes, "
          "(m, 3) in the order of surface_nodes: the volume morph alone, in one step, nothing "
          "repaired. Raises InvalidInputError, SolverError.")
      .def(
          "derivative",
          [](const Morpher& morpher, const py::object& surface_positions, bool slide) {
            if (surface_positions.is_none()) {
              const py::gil_scoped_release release;
              return morpher.derivative({.slide = slide});
            }
            const Points positions = to_points(surface_positions, "surface_positions",
                                               std::ssize(morpher.surface_nodes()));
            const py::gil_scoped_release release;
            return morpher.derivative(positions, {.slide = slide});
          },
          "surface_positions"_a = py::none(), py::kw_only(), "slide"_a = false,
          "The derivative of warp at these positions, (m, 3); None: at the base. slide: that of "
          "warp after slide; what is given for nodes that follow is not read, the adjoint by them "
          "is 0, and columns come in threes. Raises InvalidInputError, also for methods other than "
          "'rbf' and the solver 'iqr'; SolverError.")
      .def(
          "linearise",
          [](Morpher& morpher, const std::vector<CadModel>& models) {
            const py::gil_scoped_release release;
            morpher.linearise(models);
          },
          "models"_a,
          "Makes the volume morph one linear map from now on, its kernels and anchors chosen for "
          "the motions onto these models: one a step away from the base for each parameter. morph "
          "(with quality='fast'), warp, derivative, velocity and gradient then agree to rounding, "
          "and the mesh is a smooth function of the parameters. Models equal to the base count for "
          "nothing. A second call takes the place of the first. Raises InvalidInputError where no "
          "model is given or none moves the surface, for methods other than 'rbf' and the solver "
          "'iqr'; TopologyError, SolverError.")
      .def(
          "slide",
          [](const Morpher& morpher, const py::object& surface_positions) {
            const Points positions = to_points(surface_positions, "surface_positions",
                                               std::ssize(morpher.surface_nodes()));
            const py::gil_scoped_release release;
            return morpher.slide(positions);
          },
          "surface_positions"_a,
          "Returns the positions of the surface nodes, float64 (m, 3), with those on planes that "
          "slide where the others take them. Raises InvalidInputError.")
      .def(
          "velocity",
          [](const Morpher& morpher, const CadModel& plus, const CadModel& minus, double step,
             const std::optional<CadModel>& at,
             const std::optional<std::pair<CadModel, CadModel>>& half) {
            VelocityCall call{.present = at};
            if (half) call.half = ParameterPair{half->first, half->second, step / 2};
            const py::gil_scoped_release release;
            return morpher.velocity({plus, minus, step}, call);
          },
          "plus"_a, "minus"_a, "step"_a, py::kw_only(), "at"_a = py::none(), "half"_a = py::none(),
          "How the nodes move with a CAD parameter: central differences of the surface morphs onto "
          "the models with the parameter larger and smaller by step, carried inside by the "
          "derivative. at: the model between them; None: the base. half: a second pair of models, "
          "(plus, minus), of half the step: the velocity is then Richardson's extrapolation, and "
          "`errors` estimates the second's error. Raises TopologyError, InvalidInputError, "
          "SolverError.")
      .def(
          "gradient",
          [](const Morpher& morpher, const py::object& sensitivity, const py::object& parameters,
             const std::optional<CadModel>& at, const py::object& progress) {
            const RowMatrix slopes = to_rows(sensitivity, "sensitivity");
            if (!py::isinstance<py::dict>(parameters)) {
              const std::vector<ParameterFiles> files = files_in_table(parameters);
              return run_unlocked(progress, [&](const Progress& tell) {
                return morpher.gradient_of_files(slopes, files, {.present = at, .progress = tell});
              });
            }
            std::vector<Parameter> given;
            for (const auto& [name, models] : py::reinterpret_borrow<py::dict>(parameters)) {
              try {
                const auto [plus, minus, step] =
                    py::cast<std::tuple<CadModel, CadModel, double>>(models);
                given.push_back({py::str(name), {plus, minus, step}});
              } catch (const py::builtin_exception&) {
                throw InvalidInputError("parameters[" + std::string(py::repr(name)) +
                                        "]: expected (plus, minus, step): two CadModels, a number");
              }
            }
            return run_unlocked(progress, [&](const Progress& tell) {
              return morpher.gradient(slopes, given, {.present = at, .progress = tell});
            });
          },
          "sensitivity"_a, "parameters"_a, py::kw_only(), "at"_a = py::none(),
          "progress"_a = py::none(),
          "dJ/dp of parameters from dJ/dX, sensitivity (N, 3), per the mesh's unit: one adjoint of "
          "the volume, and for each parameter the velocity of the surface alone. parameters: the "
          "path of the table that `cadmorph gradient` takes, whose models are read while others "
          "are at work; or a dict of names and (plus, minus, step), as read_parameters returns it. "
          "at: the model where dJ/dX is taken; None: the base. Returns a list of "
          "ParameterGradient. Raises TopologyError, InvalidInputError, SolverError, IoError, "
          "CadError, CancelledError.")
      .def_property_readonly("base", &Morpher::base, py::return_value_policy::copy)
      .def_property_readonly("mesh", &Morpher::mesh, py::return_value_policy::copy)
      .def_property_readonly("report", &Morpher::report, py::return_value_policy::copy,
                             "Of the base side: what 'after' and the like would say is empty.")
      .def_property_readonly(
          "surface_nodes",
          [](const py::object& self) {
            const auto& nodes = self.cast<const Morpher&>().surface_nodes();
            return view(nodes.data(), {py::ssize_t(nodes.size())}, self);
          },
          "int64: ids of the nodes whose positions the CAD prescribes; a view, not writable.")
      .def("__repr__", [](const Morpher& morpher) {
        return "Morpher('" + morpher.base().name() + "', '" + morpher.mesh().name() + "')";
      });
}

}  // namespace

PYBIND11_MODULE(_native, module) {
  use_fitting_blas_kernel();
  module.attr("__version__") = version();
  add_errors(module);
  add_reports(module);
  add_cad_model(module);
  add_mesh(module);
  add_result(module);
  add_derivative(module);
  add_morpher(module);
  module.def(
      "set_thread_count", &set_thread_count, "count"_a,
      "Limits the number of threads that cadmorph, and its OpenBLAS, use; 0: all processors. "
      "Results are the same to the last bit whatever the number.");
  module.def("thread_count", &thread_count, "The number of threads in use.");
}

}  // namespace cadmorph::python
