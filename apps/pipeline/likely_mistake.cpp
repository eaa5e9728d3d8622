#include "apps/pipeline/likely_mistake.h"

#include <cmath>
#include <sstream>

#include "core/boundary.h"
#include "core/errors.h"
#include "core/length_units.h"
#include "core/remedies.h"
#include "core/validity.h"
#include "surface/mesh_unit.h"

namespace cadmorph {
namespace {

// Of the diagonal: a mesh of edges of a thousandth that is shifted by less still lies on the CAD.
constexpr double kNoShift = 1e-4;

std::string wrong_node_order(const Mesh& mesh) {
  const Orientation orientation = detect_orientation(mesh);
  const auto cells = misordered_cells(mesh, find_cell_neighbours(mesh), orientation,
                                      check_validity(mesh, mesh.points, orientation).invalid_cells);
  if (cells.empty()) return "";
  std::string which = cell_name(mesh, cells.front());
  if (cells.size() > 1)
    which = std::to_string(cells.size()) + " cells (the first is " + which + ")";
  return "the nodes of " + which +
         " are in a wrong order, so that faces match those of no cell around: mend that where the "
         "mesh comes from; ";
}

// What was given, or what is taken without.
double unit_of(const CadModel& base, const Mesh& mesh, const Boundary& boundary, double given_mm) {
  if (given_mm > 0) return given_mm;
  try {
    return detect_mesh_unit(base, mesh, boundary);
  } catch (const AssociationError&) {
    return 1;
  }
}

}  // namespace

std::string likely_mistake(const CadModel& base, const Mesh& mesh, double given_mm) {
  const Boundary boundary = extract_boundary(mesh);
  const double mm = unit_of(base, mesh, boundary, given_mm);
  const auto place = find_place(base, mesh, boundary, mm);
  if (!place) return wrong_node_order(mesh);
  const bool is_shifted = place->shift.norm() > kNoShift * base.diagonal();
  const bool is_other_unit = std::abs(place->mm / mm - 1) > 1e-9;
  if (!is_shifted && !is_other_unit) return wrong_node_order(mesh);
  std::ostringstream text;
  text.precision(6);
  text << "the mesh fits " << base.file_name();
  if (is_other_unit) text << " in " << unit_name(place->mm);
  if (is_shifted) {
    const Eigen::Vector3d shift =
        (place->shift.array().abs() > kNoShift * base.diagonal()).select(place->shift, 0.0);
    text << " after a shift by (" << shift.x() << ", " << shift.y() << ", " << shift.z()
         << ") mm: bring both into one frame";
  } else {
    text << ": give " << words_for(Remedy::MeshUnit) << " so";
  }
  return text.str() + "; ";
}

std::string likely_mistake(const CadModel& base, const CadModel& variant, const Mesh& mesh,
                           double given_mm) {
  std::string mistake = likely_mistake(base, mesh, given_mm);
  if (!mistake.empty() || variant.file_name() == base.file_name()) return mistake;
  const Boundary boundary = extract_boundary(mesh);
  const double mm = unit_of(base, mesh, boundary, given_mm);
  // A mesh that fits both as well lies on neither.
  if (find_place(base, mesh, boundary, mm)) return "";
  const auto place = find_place(variant, mesh, boundary, mm);
  if (!place || place->shift.norm() > kNoShift * variant.diagonal()) return "";
  return "the mesh lies on " + variant.file_name() + ", the second CAD model, not on " +
         base.file_name() +
         ", the first: swap the two, or give the mesh that was made of the first; ";
}

}  // namespace cadmorph
