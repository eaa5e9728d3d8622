#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/commands/number_checks.h"
#include "apps/commands/options.h"
#include "apps/pipeline/output_file.h"
#include "apps/summary/json_text.h"
#include "apps/summary/text_table.h"
#include "core/mesh_comparison.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

struct CompareCommand {
  fs::path reference, mesh, difference;
  CompareOptions options;
  std::string json;
  bool is_quiet = false;
};

const char* location_name(ArrayLocation location) {
  switch (location) {
    case ArrayLocation::Point:
      return "point";
    case ArrayLocation::Cell:
      return "cell";
    default:
      return "field";
  }
}

std::string nodes_text(const CompareCommand& command, const MeshComparison& comparison) {
  const bool is_one = comparison.moved_nodes == 1;
  std::string text = with_commas(comparison.moved_nodes) + (is_one ? " node is" : " nodes are") +
                     " elsewhere by more than " +
                     (command.options.absolute
                          ? format("%g", *command.options.absolute)
                          : format("%g of the shortest edge there", command.options.tolerance)) +
                     "; the worst:\n";
  // In the order of what they are judged by, which comes first.
  std::vector<std::vector<std::string>> rows = {{"node", "distance (mesh unit)"}};
  if (!command.options.absolute)
    rows[0] = {"node", "of the shortest edge", "distance (mesh unit)", "shortest edge"};
  for (const NodeDifference& node : comparison.nodes) {
    const std::string distance = format("%.3g", node.distance);
    rows.push_back({std::to_string(node.node), distance});
    if (!command.options.absolute)
      rows.back() = {std::to_string(node.node), format("%.3g", node.distance / node.edge), distance,
                     format("%.3g", node.edge)};
  }
  return text + align(rows);
}

std::string arrays_text(const MeshComparison& comparison) {
  std::string text;
  for (const ArrayDifference& array : comparison.arrays) {
    text +=
        std::string(location_name(array.location)) + " array '" + array.name + "': " + array.what;
    if (array.worst_row >= 0)
      text += format(", most in row %lld by %.3g", static_cast<long long>(array.worst_row),
                     array.largest);
    text += "\n";
  }
  return text;
}

std::string comparison_text(const CompareCommand& command, const MeshComparison& comparison) {
  std::string text = comparison.is_same() ? "same: " : "different: ";
  text += command.mesh.string() + " and the reference " + command.reference.string() + "\n";
  for (const std::string& line : comparison.structure) text += line + "\n";
  if (comparison.moved_nodes > 0)
    text += nodes_text(command, comparison);
  else if (comparison.displacement.rows() > 0)
    text += format("largest distance of a node %.3g\n", comparison.largest_distance);
  return text + arrays_text(comparison);
}

std::string comparison_json(const CompareCommand& command, const MeshComparison& comparison,
                            ExitCode code) {
  nlohmann::ordered_json json = json_header(static_cast<int>(code));
  json["is_same"] = comparison.is_same();
  json["reference"] = command.reference.string();
  json["mesh"] = command.mesh.string();
  if (command.options.absolute)
    json["absolute_tolerance"] = *command.options.absolute;
  else
    json["tolerance"] = command.options.tolerance;
  json["structure"] = comparison.structure;
  json["moved_nodes"] = comparison.moved_nodes;
  json["largest_distance"] = comparison.largest_distance;
  json["nodes"] = nlohmann::json::array();
  for (const NodeDifference& node : comparison.nodes)
    json["nodes"].push_back(
        {{"node", node.node}, {"distance", node.distance}, {"shortest_edge", node.edge}});
  json["arrays"] = nlohmann::json::array();
  for (const ArrayDifference& array : comparison.arrays)
    json["arrays"].push_back({{"name", array.name},
                              {"location", location_name(array.location)},
                              {"what", array.what},
                              {"differing_rows", array.differing},
                              {"worst_row", array.worst_row},
                              {"largest", array.largest}});
  return json_text(json);
}

// The reference with the displacement from it to the mesh, which has as many nodes, as a point
// array.
void write_difference(const MeshFile& reference, const MeshComparison& comparison,
                      const fs::path& path) {
  ExtraArrays extra;
  extra.point_arrays["cadmorph_difference"] = comparison.displacement;
  as_output([&] { reference.write(path, reference.mesh().points, extra); });
}

ExitCode run_compare(const CompareCommand& command) {
  const MeshFile reference(command.reference), mesh(command.mesh);
  const MeshComparison comparison = compare_meshes(reference, mesh, command.options);
  const ExitCode code = comparison.is_same() ? ExitCode::Done : ExitCode::Different;
  hand_over(command.json, command.is_quiet, comparison_text(command, comparison),
            comparison_json(command, comparison, code));
  if (command.difference.empty()) return code;
  if (comparison.displacement.rows() > 0)
    write_difference(reference, comparison, command.difference);
  else if (!command.is_quiet)
    std::fprintf(stderr, "cadmorph: warning: there is no %s: the meshes have not as many nodes\n",
                 command.difference.c_str());
  return code;
}

}  // namespace

void add_compare_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<CompareCommand>();
  CLI::App* parser = app.add_subcommand("compare", "tell what differs between two meshes");
  parser->footer(help_end({"compare nightly/part_b.vtu part_b.vtu --tolerance 1e-9",
                           "compare wing.vtu wing_thick.vtu --difference moved.vtu"},
                          {0, 1, 2, 6, 7}));
  parser
      ->add_option("REFERENCE", command->reference, "mesh of any format of 'cadmorph help formats'")
      ->required();
  parser->add_option("MESH", command->mesh, "mesh of any format of 'cadmorph help formats'")
      ->required();
  auto* tolerance =
      parser
          ->add_option("--tolerance", command->options.tolerance,
                       "of positions, in a node's shortest edge; of arrays, in their largest value")
          ->check(number_from_zero())
          ->capture_default_str();
  parser
      ->add_option("--absolute", command->options.absolute,
                   "tolerance of positions in the mesh's unit instead")
      ->check(number_from_zero())
      ->excludes(tolerance);
  parser->add_option("--ignore", command->options.ignored, "array to leave out; may be repeated")
      ->type_name("NAME");
  parser
      ->add_option("--difference", command->difference,
                   "write the reference with the differences as array cadmorph_difference")
      ->type_name("OUT.vtu");
  parser->add_flag("--quiet", command->is_quiet, "print errors only");
  add_json_option(*parser, command->json);
  parser->callback([&action, command] {
    action.json = command->json;
    check_outputs({json_output(command->json), {"--difference", command->difference}},
                  {command->reference, command->mesh});
    action.run = [command] { return run_compare(*command); };
  });
}

}  // namespace cadmorph
