#include "apps/picture/picture_scene.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/picture/visible_surface.h"
#include "apps/pipeline/output_file.h"
#include "core/mesh_file.h"

namespace cadmorph {

NLOHMANN_JSON_SERIALIZE_ENUM(Colouring, {{Colouring::Plain, "plain"},
                                         {Colouring::Scale, "scale"},
                                         {Colouring::ReversedScale, "reversed scale"},
                                         {Colouring::Marks, "marks"}})
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Panel, surface, is_moved, colouring, array, title, subtitle,
                                   is_cut)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Picture, output, width, height, columns, is_transparent,
                                   bar_title, low, high, panels)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Scene, cut_axis, pictures)

namespace {

namespace fs = std::filesystem;

constexpr double kWorstShare = 0.05;  // the twentieth that the figures tell of
constexpr const char* kSurface = "surface.vtu";
constexpr const char* kScene = "scene.json";
constexpr const char* kCut = "cut.vtu";

// 1 for each of the worst cells of those measured, else 0.
std::vector<char> mark_worst(const std::vector<double>& quality) {
  std::vector<Index> measured;
  for (Index c = 0; c < static_cast<Index>(quality.size()); ++c)
    if (!std::isnan(quality[c])) measured.push_back(c);
  const auto count = std::ceil(kWorstShare * static_cast<double>(measured.size()));
  const auto end = measured.begin() + static_cast<std::ptrdiff_t>(count);
  std::partial_sort(measured.begin(), end, measured.end(), [&](Index a, Index b) {
    return std::pair(quality[a], a) < std::pair(quality[b], b);
  });
  std::vector<char> marks(quality.size(), 0);
  std::for_each(measured.begin(), end, [&](Index c) { marks[c] = 1; });
  return marks;
}

template <class Values>
RowMatrix pick(const Values& values, const std::vector<Index>& cells) {
  RowMatrix result(cells.size(), 1);
  for (std::size_t i = 0; i < cells.size(); ++i)
    result(static_cast<Index>(i), 0) = static_cast<double>(values[cells[i]]);
  return result;
}

void write_surface(const fs::path& path, const DrawnMesh& drawn, const VisibleSurface& surface,
                   const std::vector<char>& worst_before, const std::vector<char>& worst_after) {
  ExtraArrays extra;
  extra.cell_arrays["quality_before"] = pick(drawn.before.values, surface.cells);
  extra.cell_arrays["worst_before"] = pick(worst_before, surface.cells);
  if (drawn.moved) {
    const Points moved = (*drawn.moved)(surface.nodes, Eigen::all);
    extra.point_arrays["displacement"] = moved - surface.mesh.points;
    extra.cell_arrays["quality_after"] = pick(drawn.after->values, surface.cells);
    extra.cell_arrays["worst_after"] = pick(worst_after, surface.cells);
  }
  write_mesh(path, surface.mesh, extra);
}

std::vector<char> drawn_cells(const DrawnMesh& drawn) {
  return drawn.box ? cells_in_box(drawn.mesh, *drawn.box)
                   : std::vector<char>(drawn.mesh.cell_count(), 1);
}

// The box around what moved of a surface, where that is a small part of it: a body in a far field
// would be lost in it, or hidden by it.
std::optional<Eigen::AlignedBox3d> box_of_body(const DrawnMesh& drawn,
                                               const VisibleSurface& surface) {
  // Planes that slide move less the farther away, the nearest still a little. A quarter of the body
  // around it on each side shows where it lies; a box of half of all would show little more.
  constexpr double kMoved = 0.1, kMargin = 1.5, kSmall = 0.5;
  if (!drawn.moved) return std::nullopt;
  const Points moved = (*drawn.moved)(surface.nodes, Eigen::all);
  const Eigen::VectorXd distance = (moved - surface.mesh.points).rowwise().norm();
  Eigen::AlignedBox3d box, whole;
  for (Index n = 0; n < moved.rows(); ++n) {
    whole.extend(surface.mesh.points.row(n).transpose());
    if (distance(n) <= kMoved * distance.maxCoeff()) continue;
    box.extend(surface.mesh.points.row(n).transpose());
    box.extend(moved.row(n).transpose());
  }
  if (box.isEmpty()) return std::nullopt;
  // As deep as it is long: a flat part has surroundings, too.
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(kMargin / 2 * box.sizes().maxCoeff());
  const Eigen::AlignedBox3d around(box.center() - reach, box.center() + reach);
  if (around.sizes().maxCoeff() > kSmall * whole.sizes().maxCoeff()) return std::nullopt;
  return around;
}

std::vector<char> cut_cells(const DrawnMesh& drawn) {
  const Eigen::AlignedBox3d box = drawn.box.value_or(box_of(drawn.mesh));
  std::vector<char> result = cells_above_middle(drawn.mesh, box, drawn.cut_axis);
  const std::vector<char> is_drawn = drawn_cells(drawn);
  for (std::size_t c = 0; c < result.size(); ++c) result[c] = result[c] && is_drawn[c];
  return result;
}

double largest_displacement(const DrawnMesh& drawn) {
  return (*drawn.moved - drawn.mesh.points).rowwise().norm().maxCoeff();
}

double least_quality(const DrawnMesh& drawn) {
  return std::min({0.0, drawn.before.min, drawn.after ? drawn.after->min : 0.0});
}

std::string size_text(const Mesh& mesh) {
  return std::to_string(mesh.node_count()) + " nodes, " + std::to_string(mesh.cell_count()) +
         " elements";
}

std::string quality_text(const QualityReport& quality) {
  char text[160];
  std::snprintf(text, sizeof text, "scaled Jacobian: min %.3f, mean %.3f; inverted: %lld",
                quality.min, quality.mean, static_cast<long long>(quality.inverted));
  return text;
}

Panel surface_panel(bool is_moved, Colouring colouring, const std::string& array) {
  Panel panel;
  panel.surface = kSurface;
  panel.is_moved = is_moved;
  panel.colouring = colouring;
  panel.array = array;
  return panel;
}

Panel cut_panel(bool is_moved) {
  Panel panel =
      surface_panel(is_moved, Colouring::Marks, is_moved ? "worst_after" : "worst_before");
  panel.surface = kCut;
  panel.is_cut = true;
  return panel;
}

Panel titled(Panel panel, const std::string& title, const std::string& subtitle) {
  panel.title = title;
  panel.subtitle = subtitle;
  return panel;
}

Picture overview_of_mesh(const DrawnMesh& drawn) {
  Picture picture;
  picture.height = 700;
  picture.columns = 2;
  picture.bar_title = "Scaled\nJacobian";
  picture.low = least_quality(drawn);
  picture.panels = {titled(surface_panel(false, Colouring::ReversedScale, "quality_before"),
                           "Surface", size_text(drawn.mesh)),
                    titled(cut_panel(false), "Cut open: worst 5 % of the elements in red",
                           quality_text(drawn.before))};
  return picture;
}

Picture overview_of_morph(const DrawnMesh& drawn, bool is_quality) {
  Picture picture;
  picture.columns = 2;
  picture.bar_title = is_quality ? "Scaled\nJacobian" : "Displacement\n[" + drawn.unit + "]";
  picture.low = is_quality ? least_quality(drawn) : 0;
  picture.high = is_quality ? 1 : largest_displacement(drawn);
  const Panel before = is_quality ? surface_panel(false, Colouring::ReversedScale, "quality_before")
                                  : surface_panel(false, Colouring::Plain, "");
  const Panel after = is_quality ? surface_panel(true, Colouring::ReversedScale, "quality_after")
                                 : surface_panel(true, Colouring::Scale, "displacement");
  picture.panels = {titled(before, "Before", size_text(drawn.mesh)),
                    titled(after, "After", size_text(drawn.mesh)),
                    titled(cut_panel(false), "Before, cut open: worst 5 % of the elements in red",
                           quality_text(drawn.before)),
                    titled(cut_panel(true), "After, cut open: worst 5 % of the elements in red",
                           quality_text(*drawn.after))};
  return picture;
}

Picture picture_of(const char* output, const Panel& panel, double high) {
  Picture result;
  result.output = output;
  result.width = 640;
  result.height = 480;
  result.is_transparent = true;
  result.high = high;
  result.panels = {panel};
  return result;
}

}  // namespace

void write_surfaces(const DrawnMesh& drawn, const fs::path& folder) {
  const std::vector<char> worst_before = mark_worst(drawn.before.values);
  const std::vector<char> worst_after =
      drawn.after ? mark_worst(drawn.after->values) : std::vector<char>();
  VisibleSurface surface = visible_surface(drawn.mesh, drawn.neighbours, drawn_cells(drawn));
  DrawnMesh cut = drawn;
  if (!drawn.box) cut.box = box_of_body(drawn, surface);
  if (cut.box && !drawn.box) surface = facets_in_box(surface, *cut.box);
  write_surface(folder / kSurface, drawn, surface, worst_before, worst_after);
  write_surface(folder / kCut, drawn, visible_surface(drawn.mesh, drawn.neighbours, cut_cells(cut)),
                worst_before, worst_after);
}

Picture overview(const DrawnMesh& drawn, bool is_quality) {
  Picture picture = drawn.moved ? overview_of_morph(drawn, is_quality) : overview_of_mesh(drawn);
  picture.output = "overview.png";
  return picture;
}

std::vector<Picture> separate_pictures(const DrawnMesh& drawn) {
  return {picture_of("base.png", surface_panel(false, Colouring::Plain, ""), 1),
          picture_of("variant.png", surface_panel(true, Colouring::Plain, ""), 1),
          picture_of("displacement.png", surface_panel(true, Colouring::Scale, "displacement"),
                     largest_displacement(drawn)),
          picture_of("cut.png", cut_panel(true), 1)};
}

Picture thumbnail(const DrawnMesh& drawn) {
  Picture picture =
      picture_of("thumbnail.png", surface_panel(true, Colouring::Scale, "displacement"),
                 largest_displacement(drawn));
  picture.width = 400;
  picture.height = 300;
  return picture;
}

void write_scene(const fs::path& folder, const Scene& scene) {
  write_text(folder / kScene, nlohmann::json(scene).dump());
}

Scene read_scene(const fs::path& folder) {
  const fs::path path = folder / kScene;
  std::ifstream file(path);
  if (!file) throw IoError("can't read " + path.string());
  try {
    return nlohmann::json::parse(file).get<Scene>();
  } catch (const nlohmann::json::exception& error) {
    throw InvalidInputError(path.string() + " is no scene: " + error.what());
  }
}

}  // namespace cadmorph
