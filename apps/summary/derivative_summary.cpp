#include "apps/summary/derivative_summary.h"

#include "apps/batch/csv.h"
#include "apps/summary/json_text.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "core/length_units.h"

namespace cadmorph {
namespace {

using Json = nlohmann::ordered_json;

Json mesh_json(const std::filesystem::path& file, Index nodes, Index surface_nodes, double unit) {
  return {{"file", file.string()},
          {"nodes", nodes},
          {"surface_nodes", surface_nodes},
          {"unit_mm", unit}};
}

std::string mesh_text(const std::filesystem::path& file, Index nodes, Index surface_nodes,
                      double unit) {
  return format("%-14s%s (unit %s, %s nodes, %s of them prescribed by the surface)\n", "Mesh",
                file.c_str(), unit_name(unit).c_str(), with_commas(nodes).c_str(),
                with_commas(surface_nodes).c_str());
}

}  // namespace

std::string velocity_text(const VelocityReport& report) {
  std::string text =
      mesh_text(report.mesh, report.nodes, report.surface_nodes, report.mesh_unit_mm);
  text += format("%-14s%g, which moves the surface by %s at most (CAD tolerance %s)\n", "Step",
                 report.step, millimetres(report.motion).c_str(),
                 millimetres(report.cad_tolerance).c_str());
  text += format("%-14s%.2g %% of the motion between the base and the middle of both models\n",
                 "Evenness", 100 * report.unevenness);
  text += format("%-14s%.9g mesh units a unit of the parameter, node %lld at %.6g %.6g %.6g\n",
                 "Largest speed", report.max_speed, static_cast<long long>(report.fastest_node),
                 report.fastest_place[0], report.fastest_place[1], report.fastest_place[2]);
  if (report.max_error)
    text += format("%-14s%.2g at most, estimated from two steps\n", "Error", *report.max_error);
  text += format("%-14s%.2f s\n", "Time", report.seconds);
  text += format("%-14s%s (point array cadmorph_velocity: the derivative of the plain morph)\n",
                 "Written", report.written.c_str());
  return text;
}

std::string velocity_json(const VelocityReport& report, int exit_code) {
  Json json = json_header(exit_code);
  json["base_cad"] = report.base_cad.string();
  json["mesh"] = mesh_json(report.mesh, report.nodes, report.surface_nodes, report.mesh_unit_mm);
  json["step"] = report.step;
  json["motion_mm"] = json_number(report.motion);
  json["cad_tolerance_mm"] = json_number(report.cad_tolerance);
  json["unevenness"] = json_number(report.unevenness);
  json["max_speed"] = json_number(report.max_speed);
  json["fastest_node"] = report.fastest_node;
  json["fastest_place"] = {report.fastest_place[0], report.fastest_place[1],
                           report.fastest_place[2]};
  json["max_error"] = report.max_error ? json_number(*report.max_error) : Json(nullptr);
  json["warnings"] = report.warnings;
  json["seconds"] = report.seconds;
  json["written"] = report.written.string();
  return json_text(json);
}

std::string gradient_text(const GradientReport& report) {
  std::string text =
      mesh_text(report.mesh, report.nodes, report.surface_nodes, report.mesh_unit_mm);
  text += format("%-14s|dJ/dX| %.6g of all nodes, %.6g carried to the surface\n", "Sensitivity",
                 report.sensitivity_norm, report.surface_norm);
  text += format("%-14s%.2f s, adjoint %.2f s\n\n", "Time", report.seconds, report.adjoint_seconds);
  std::vector<std::vector<std::string>> rows = {
      {"Parameter", "dJ/dp", "step", "largest speed", "motion"}};
  for (const GradientEntry& entry : report.entries)
    rows.push_back({entry.name, format("%.9g", entry.gradient), format("%g", entry.step),
                    format("%.4g", entry.max_speed), millimetres(entry.motion)});
  return text + align(rows);
}

std::string gradient_json(const GradientReport& report, int exit_code) {
  Json json = json_header(exit_code);
  json["base_cad"] = report.base_cad.string();
  json["mesh"] = mesh_json(report.mesh, report.nodes, report.surface_nodes, report.mesh_unit_mm);
  json["sensitivity_norm"] = json_number(report.sensitivity_norm);
  json["surface_sensitivity_norm"] = json_number(report.surface_norm);
  json["gradient"] = Json::array();
  for (const GradientEntry& entry : report.entries)
    json["gradient"].push_back({{"name", entry.name},
                                {"value", json_number(entry.gradient)},
                                {"step", entry.step},
                                {"max_speed", json_number(entry.max_speed)},
                                {"motion_mm", json_number(entry.motion)}});
  json["warnings"] = report.warnings;
  json["adjoint_seconds"] = report.adjoint_seconds;
  json["seconds"] = report.seconds;
  return json_text(json);
}

std::string gradient_csv(const GradientReport& report) {
  std::string text = csv_line({"name", "gradient", "step", "max_speed"});
  for (const GradientEntry& entry : report.entries)
    text += csv_line({entry.name, format("%.17g", entry.gradient), format("%.17g", entry.step),
                      format("%.17g", entry.max_speed)});
  return text;
}

}  // namespace cadmorph
