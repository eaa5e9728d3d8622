// cadmorph-picture: a picture of a mesh before and after morphing.

#include <vtkObject.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <optional>

#include "apps/picture/picture_display.h"
#include "apps/picture/picture_renderer.h"
#include "apps/picture/scratch_folder.h"
#include "apps/picture/visible_surface.h"
#include "apps/pipeline/exit_code.h"
#include "apps/pipeline/output_file.h"
#include "core/interrupt.h"
#include "core/mesh_file.h"
#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

struct PictureOptions {
  fs::path before, after, output;
  bool is_quality = false;
  int cut_axis = 1;
  std::string unit = "mm";
  std::vector<double> box;  ///< opposite corners
  fs::path scene;           ///< folder of a prepared scene, drawn instead
};

void draw_on_private_display(const Scene& scene, const fs::path& folder) {
  const PrivateDisplay display;
  draw(scene, folder);
}

std::optional<Eigen::AlignedBox3d> box_of(const std::vector<double>& corners) {
  if (corners.empty()) return std::nullopt;
  const Eigen::Vector3d a(corners.data()), b(corners.data() + 3);
  return Eigen::AlignedBox3d(a.cwiseMin(b), a.cwiseMax(b));
}

void draw_meshes(const PictureOptions& options) {
  check_output(options.output, {options.before, options.after});
  const MeshFile before_file(options.before), after_file(options.after);
  const std::optional<Mesh> turned = in_one_sense(before_file.mesh());
  const Mesh &before = turned ? *turned : before_file.mesh(), &after = after_file.mesh();
  if (before.types != after.types || before_file.mesh().connectivity != after.connectivity)
    throw InvalidInputError(options.after.string() + " does not have the cells of " +
                            options.before.string() + ": give a mesh and its morph");
  const Orientation orientation = detect_orientation(before);
  const CellNeighbours neighbours = find_cell_neighbours(before);
  const QualityReport quality_before = measure_quality(before, before.points, orientation);
  const QualityReport quality_after = measure_quality(before, after.points, orientation);
  const DrawnMesh drawn{.mesh = before,
                        .neighbours = neighbours,
                        .before = quality_before,
                        .moved = &after.points,
                        .after = &quality_after,
                        .unit = options.unit,
                        .cut_axis = options.cut_axis,
                        .box = box_of(options.box)};
  if (drawn.box && std::ranges::count(cells_in_box(before, *drawn.box), 1) == 0)
    throw InvalidInputError("no element of " + options.before.string() +
                            " has its centre in the box: give two opposite corners in its unit");
  const ScratchFolder folder;
  write_surfaces(drawn, folder.path());
  const Picture picture = overview(drawn, options.is_quality);
  draw_on_private_display({.cut_axis = options.cut_axis, .pictures = {picture}}, folder.path());
  write_text(options.output, read_bytes(folder.path() / picture.output));
}

PictureOptions parse(CLI::App& app, int argc, char** argv) {
  PictureOptions options;
  auto* before = app.add_option("before", options.before, "Mesh before morphing (.vtu, .vtk)");
  auto* after = app.add_option("after", options.after, "The same mesh after morphing");
  auto* output = app.add_option("output", options.output, "Picture to write (.png)");
  const std::map<std::string, bool> fields{{"displacement", false}, {"quality", true}};
  app.add_option("--field", options.is_quality, "What colours show: displacement or quality")
      ->transform(CLI::CheckedTransformer(fields))
      ->option_text("FIELD [displacement]");
  const std::map<std::string, int> axes{{"x", 0}, {"y", 1}, {"z", 2}};
  app.add_option("--cut", options.cut_axis, "Axis normal to the cut: x, y or z")
      ->transform(CLI::CheckedTransformer(axes))
      ->option_text("AXIS [y]");
  app.add_option("--box", options.box, "Draw the elements in this box alone, before morphing")
      ->expected(6)
      ->delimiter(',')
      ->type_name("X,Y,Z,X,Y,Z");
  app.add_option("--unit", options.unit, "Unit of the coordinates, for the labels")
      ->capture_default_str();
  app.add_option("--scene", options.scene,
                 "Draw the pictures of a scene that cadmorph left in this folder, into it")
      ->type_name("FOLDER")
      ->excludes(before);
  app.parse(argc, argv);
  if (options.scene.empty())
    for (const CLI::Option* needed : {before, after, output})
      if (needed->count() == 0) throw CLI::RequiredError(needed->get_name());
  return options;
}

void run(const PictureOptions& options) {
  if (options.scene.empty())
    draw_meshes(options);
  else
    draw_on_private_display(read_scene(options.scene), options.scene);
}

}  // namespace
}  // namespace cadmorph

int main(int argc, char** argv) {
  CLI::App app{
      "Draws a mesh before and after morphing: both surfaces, and both cut open with the "
      "worst elements in red."};
  vtkObject::GlobalWarningDisplayOff();  // failures are told once, by us
  cadmorph::remove_temporaries_at_interrupt();
  try {
    cadmorph::run(cadmorph::parse(app, argc, argv));
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cadmorph-picture: %s\n", error.what());
    return static_cast<int>(cadmorph::exit_code_of(error));
  }
}
