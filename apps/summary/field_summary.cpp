#include "apps/summary/field_summary.h"

#include "apps/summary/json_text.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "core/length_units.h"

namespace cadmorph {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const QualityReport& quality, const ValidityReport& validity) {
  return {{"min_scaled_jacobian", json_number(quality.min)},
          {"mean_scaled_jacobian", json_number(quality.mean)},
          {"worst_cell", quality.worst_cell},
          {"inverted_corner_jacobian", quality.inverted},
          {"invalid_exact", validity.invalid}};
}

std::string quality_table(const ApplyReport& report) {
  return align(
      {{"", "before", "after"},
       {"Scaled Jacobian, min", format("%.4f", report.quality_before.min),
        format("%.4f", report.quality_after.min)},
       {"Scaled Jacobian, mean", format("%.4f", report.quality_before.mean),
        format("%.4f", report.quality_after.mean)},
       {"Inverted elements (corner Jacobians)", with_commas(report.quality_before.inverted),
        with_commas(report.quality_after.inverted)},
       {"Invalid elements (exact test)", with_commas(report.validity_before.invalid),
        with_commas(report.validity_after.invalid)}});
}

}  // namespace

std::string field_text(const FieldFigures& field) {
  return format("%-14s%s (%s centres, %d step%s, unit %s; %s to %s, made with %s)\n", "Field",
                field.file.c_str(), with_commas(field.centres).c_str(), field.steps,
                field.steps == 1 ? "" : "s", unit_name(field.mesh_unit_mm).c_str(),
                field.base_cad.c_str(), field.variant_cad.c_str(), field.mesh.c_str());
}

std::string apply_text(const ApplyReport& report) {
  std::string text = field_text(report.field);
  text += format("%-14s%s (%s, unit %s, %s nodes, %s cells)\n", "Mesh", report.mesh.c_str(),
                 report.mesh_format.c_str(), unit_name(report.mesh_unit_mm).c_str(),
                 with_commas(report.nodes).c_str(), with_commas(report.cells).c_str());
  text += format("%-14s%s put exactly where the CAD put them, %s by the field\n", "Nodes",
                 with_commas(report.at_nodes).c_str(),
                 with_commas(report.nodes - report.at_nodes).c_str());
  text += format("%-14s%.6g mesh units\n", "Largest move", report.max_displacement);
  text.append("\n").append(quality_table(report)).append("\n");
  text += format("%-14s%.2f s\n", "Time", report.seconds);
  if (report.rounding.node >= 0) text += labelled("Rounding", rounding_text(report.rounding));
  text +=
      format("%-14s%s\n", report.bad_cells.empty() ? "Written" : "Refused", report.written.c_str());
  return text;
}

std::string apply_json(const ApplyReport& report, int exit_code) {
  const FieldFigures& field = report.field;
  Json json = json_header(exit_code);
  json["field"] = {{"file", field.file.string()},
                   {"base_cad", field.base_cad},
                   {"variant_cad", field.variant_cad},
                   {"mesh", field.mesh},
                   {"mesh_unit_mm", field.mesh_unit_mm},
                   {"centres", field.centres},
                   {"steps", field.steps}};
  json["mesh"] = {{"file", report.mesh.string()},
                  {"format", report.mesh_format},
                  {"unit_mm", report.mesh_unit_mm},
                  {"nodes", report.nodes},
                  {"cells", report.cells}};
  json["exact_nodes"] = report.at_nodes;
  json["nodes_outside"] = report.outside;
  json["max_displacement"] = json_number(report.max_displacement);
  json["before"] = to_json(report.quality_before, report.validity_before);
  json["after"] = to_json(report.quality_after, report.validity_after);
  json["bad_cells"] = report.bad_cells;
  json["seconds"] = report.seconds;
  json["written"] = report.written.string();
  return json_text(json);
}

}  // namespace cadmorph
