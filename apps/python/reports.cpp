#include "apps/python/reports.h"

#include <cadmorph/report.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <vector>

namespace cadmorph::python {
namespace {

namespace py = pybind11;

// What as_dict makes of a field.
py::object plain(const py::object& value) {
  if (py::hasattr(value, "as_dict")) return value.attr("as_dict")();
  if (!py::isinstance<py::list>(value)) return value;
  py::list items;
  for (const py::handle& item : value)
    items.append(plain(py::reinterpret_borrow<py::object>(item)));
  return items;
}

// A class of fields alone, which prints as a dataclass does.
template <class Type>
class Record {
 public:
  Record(py::module_& module, const char* name, const char* doc)
      : class_(module, name, doc), names_(std::make_shared<std::vector<std::string>>()) {
    class_.def("__repr__", [title = std::string(name), names = names_](const py::object& self) {
      std::string text = title + "(";
      for (const std::string& field : *names)
        text += (field == names->front() ? "" : ", ") + field + "=" +
                std::string(py::repr(self.attr(field.c_str())));
      return text + ")";
    });
    class_.def(
        "as_dict",
        [names = names_](const py::object& self) {
          py::dict result;
          for (const std::string& field : *names)
            result[field.c_str()] = plain(self.attr(field.c_str()));
          return result;
        },
        "The fields as a dict of plain values, those of its parts, too.");
  }

  template <class Value>
  Record& field(const char* name, Value Type::*member, const char* doc = "") {
    names_->push_back(name);
    class_.def_readonly(name, member, doc);
    return *this;
  }

  template <class Get>
  Record& computed(const char* name, const Get& get, const char* doc) {
    names_->push_back(name);
    class_.def_property_readonly(name, get, doc);
    return *this;
  }

 private:
  py::class_<Type> class_;
  std::shared_ptr<std::vector<std::string>> names_;
};

const char* outcome_name(Outcome outcome) {
  switch (outcome) {
    case Outcome::Inverted:
      return "inverted elements";
    case Outcome::PoorQuality:
      return "quality below what was asked";
    default:
      return "done";
  }
}

}  // namespace

void add_reports(py::module_& module) {
  Record<CadFigures>(module, "CadFigures", "Counts of a CAD model.")
      .field("name", &CadFigures::name)
      .field("unit", &CadFigures::unit, "Length unit named in the file.")
      .field("faces", &CadFigures::faces)
      .field("edges", &CadFigures::edges)
      .field("vertices", &CadFigures::vertices)
      .field("solids", &CadFigures::solids)
      .field("diagonal_mm", &CadFigures::diagonal_mm, "Of the bounding box.");
  Record<NodeFigures>(module, "NodeFigures", "How many nodes of the mesh lie where.")
      .field("vertex", &NodeFigures::vertex)
      .field("edge", &NodeFigures::edge)
      .field("face", &NodeFigures::face)
      .field("amid_straight_edges", &NodeFigures::amid_straight_edges,
             "Of second order, off the CAD.")
      .field("unmatched", &NodeFigures::unmatched, "On the outside, on no CAD face.")
      .field("interior", &NodeFigures::interior)
      .field("loose", &NodeFigures::loose, "Of no element of the mesh's dimension.");
  Record<QualityFigures>(module, "QualityFigures", "How the mesh is.")
      .field("max_distance_mm", &QualityFigures::max_distance_mm, "Of surface nodes to the CAD.")
      .field("mean_distance_mm", &QualityFigures::mean_distance_mm)
      .field("min_scaled_jacobian", &QualityFigures::min_scaled_jacobian)
      .field("mean_scaled_jacobian", &QualityFigures::mean_scaled_jacobian)
      .field("worst_cell", &QualityFigures::worst_cell, "Cell of the smallest scaled Jacobian.")
      .field("inverted_cells", &QualityFigures::inverted_cells,
             "With a corner Jacobian that is not positive.")
      .field("invalid_cells", &QualityFigures::invalid_cells, "That fail the exact test.")
      .field("max_non_orthogonality_deg", &QualityFigures::max_non_orthogonality_deg)
      .field("mean_non_orthogonality_deg", &QualityFigures::mean_non_orthogonality_deg)
      .field("max_skewness", &QualityFigures::max_skewness)
      .field("max_aspect_ratio", &QualityFigures::max_aspect_ratio)
      .field("min_volume", &QualityFigures::min_volume, "In the mesh's unit, cubed.");
  Record<GroupFigures>(module, "GroupFigures", "What a named part of the mesh did.")
      .field("name", &GroupFigures::name)
      .field("kind", &GroupFigures::kind)
      .field("nodes", &GroupFigures::nodes)
      .field("max_displacement_mm", &GroupFigures::max_displacement_mm);
  Record<Diagnosis>(module, "Diagnosis", "Why a result was refused, and where to look.")
      .field("bad_cells", &Diagnosis::bad_cells, "Inverted, or below the quality asked for.")
      .field("bad_cells_in_base", &Diagnosis::bad_cells_in_base,
             "Of these: inverted in the input already.")
      .field("worst_cell", &Diagnosis::worst_cell)
      .computed(
          "location",
          [](const Diagnosis& d) {
            return py::make_tuple(d.location[0], d.location[1], d.location[2]);
          },
          "Of the worst cell, (x, y, z) in the mesh's unit.")
      .field("nearest_face", &Diagnosis::nearest_face,
             "Base CAD face near most bad cells, from 1; 0: none.")
      .field("first_inversion", &Diagnosis::first_inversion,
             "Share of the change at which the first element inverts.")
      .field("advice", &Diagnosis::advice, "What to try.");
  Record<Report>(module, "Report", "All figures of a morph, or of the base side alone.")
      .computed(
          "outcome", [](const Report& report) { return outcome_name(report.outcome); },
          "'done', 'inverted elements' or 'quality below what was asked'.")
      .field("base_cad", &Report::base_cad)
      .field("variant_cad", &Report::variant_cad)
      .field("mesh_name", &Report::mesh_name)
      .field("mesh_format", &Report::mesh_format)
      .field("node_count", &Report::node_count)
      .field("cell_count", &Report::cell_count)
      .field("mesh_unit_mm", &Report::mesh_unit_mm, "Millimetres per mesh unit.")
      .field("is_unit_detected", &Report::is_unit_detected)
      .field("nodes", &Report::nodes)
      .field("groups", &Report::groups)
      .field("matched_by", &Report::matched_by, "What decided which face became which.")
      .field("least_confidence", &Report::least_confidence, "Of any pair of faces, in (0, 1].")
      .field("before", &Report::before)
      .field("after", &Report::after)
      .field("max_displacement_mm", &Report::max_displacement_mm)
      .field("max_surface_displacement_mm", &Report::max_surface_displacement_mm)
      .field("solver", &Report::solver, "The one used; empty for another method than 'rbf'.")
      .field("centres", &Report::centres, "Of the radial basis functions.")
      .field("iterations", &Report::iterations)
      .field("steps", &Report::steps, "That the change was split into.")
      .field("repaired_cells", &Report::repaired_cells,
             "Inverted before optimisation, and not after.")
      .field("raised_cells", &Report::raised_cells, "Below improve_below before, and not after.")
      .field("is_raised", &Report::is_raised,
             "Whether elements that lost shape were raised (quality='best').")
      .field("is_plain", &Report::is_plain,
             "Whether it took one step, no repair and nothing raised: positions are then a linear "
             "function of the surface's.")
      .computed(
          "diagnosis",
          [](const Report& report) -> py::object {
            return report.diagnosis ? py::cast(*report.diagnosis) : py::none();
          },
          "Of a result that was refused, else None.")
      .field("warnings", &Report::warnings)
      .field("notes", &Report::notes, "What took an effort and asks for nothing.")
      .computed(
          "phase_seconds",
          [](const Report& report) {
            py::dict result;
            for (const PhaseTime& phase : report.phases) {
              const double before =
                  result.contains(phase.name) ? result[phase.name.c_str()].cast<double>() : 0;
              result[phase.name.c_str()] = before + phase.seconds;
            }
            return result;
          },
          "Seconds by phase.")
      .field("seconds", &Report::seconds, "Of all phases, those of the base side, too.")
      .field("threads", &Report::threads)
      .field("blas_kernel", &Report::blas_kernel, "OpenBLAS's code; empty for another BLAS.");
}

}  // namespace cadmorph::python
