#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <optional>

#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/commands/number_checks.h"
#include "apps/commands/options.h"
#include "apps/picture/picture_process.h"
#include "apps/pipeline/output_file.h"
#include "apps/summary/json_report.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

struct QualityCommand {
  std::filesystem::path mesh;
  std::optional<double> min_scaled_jacobian;
  std::filesystem::path picture;
  std::string json;
  int threads = 0;  ///< 0: all
};

void draw(const QualityCommand& command, const DrawnMesh& drawn) {
  PictureProcess drawing(drawn, {overview(drawn)});
  const DrawnPictures pictures = drawing.wait();
  if (pictures.failure.empty())
    write_text(command.picture, pictures.bytes.begin()->second);
  else
    std::fprintf(stderr, "cadmorph: warning: there is no picture: %s\n", pictures.failure.c_str());
}

ExitCode run_quality(const QualityCommand& command) {
  set_thread_count(command.threads);
  const MeshFile file(command.mesh);
  const std::optional<Mesh> turned = in_one_sense(file.mesh());
  const Mesh& mesh = turned ? *turned : file.mesh();
  const Orientation orientation = detect_orientation(mesh);
  const QualityReport quality = measure_quality(mesh, mesh.points, orientation);
  const ValidityReport validity = check_validity(mesh, mesh.points, orientation);
  const CellNeighbours neighbours = find_cell_neighbours(mesh);
  const QualityChecks checks = check_quality(mesh, mesh.points, neighbours, orientation);
  const bool is_poor = command.min_scaled_jacobian && quality.min < *command.min_scaled_jacobian;
  const bool is_good = quality.inverted == 0 && validity.invalid == 0 && !is_poor;
  const ExitCode code = is_good ? ExitCode::Done : ExitCode::Quality;
  hand_over(command.json, false, quality_text(command.mesh, mesh, quality, validity, checks),
            quality_json(command.mesh, mesh.node_count(), quality, validity, checks,
                         static_cast<int>(code)));
  if (!command.picture.empty())
    draw(command, {.mesh = mesh, .neighbours = neighbours, .before = quality});
  if (!is_good)
    std::fprintf(stderr, "cadmorph: error: %s: %s\n", command.mesh.c_str(),
                 quality.inverted + validity.invalid > 0
                     ? "inverted elements"
                     : format("the smallest scaled Jacobian is %.4g, below the %g asked for",
                              quality.min, *command.min_scaled_jacobian)
                           .c_str());
  return code;
}

}  // namespace

void add_quality_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<QualityCommand>();
  CLI::App* parser = app.add_subcommand("quality", "measure the elements of a mesh");
  parser->footer(help_end(
      {"quality wing.vtu", "quality wing.vtu --min-scaled-jacobian 0.1 --picture wing.png"},
      {0, 1, 2, 5, 6}));
  parser->add_option("MESH", command->mesh, "mesh of any format of 'cadmorph help formats'")
      ->required();
  parser
      ->add_option("--min-scaled-jacobian", command->min_scaled_jacobian,
                   "exit 5 when an element is below")
      ->check(number_between(-1, 1));
  parser
      ->add_option("--picture", command->picture,
                   "write a picture: scaled Jacobian, and the worst elements in a cut")
      ->type_name("FILE.png");
  add_json_option(*parser, command->json);
  add_threads_option(*parser, command->threads);
  parser->callback([&action, command] {
    action.json = command->json;
    check_outputs({json_output(command->json), {"--picture", command->picture}}, {command->mesh});
    action.run = [command] { return run_quality(*command); };
  });
}

}  // namespace cadmorph
