// Writes the CAD families, the small shapes, and their meshes.

#include <CLI/CLI.hpp>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <numeric>
#include <optional>
#include <random>
#include <sstream>

#include "core/boundary.h"
#include "core/errors.h"
#include "core/mesh_file.h"
#include "core/quality.h"
#include "models/bore.h"
#include "models/canister.h"
#include "models/courier.h"
#include "models/pipe.h"
#include "models/shapes.h"
#include "models/star_cells.h"
#include "models/step_files.h"
#include "models/tet_mesher.h"
#include "models/wing.h"

namespace cadmorph::models {
namespace {

namespace fs = std::filesystem;

constexpr int step_count = 20;
constexpr int most_checked_nodes = 12000;
constexpr double exact = 1e-12;            // mm; rounding of coordinates of 100 mm
constexpr double curved_tolerance = 1e-6;  // mm; OCCT's fillets and projections on domes
constexpr double not_on_cad = 1e300;       // most of the mesh's surface is a far field
constexpr double gmsh_tolerance = 1e-6;    // mm; gmsh's nodes are on the curve, not the surface

/// A mesh of a family's base.
struct ModelMesh {
  std::string file;
  std::function<Mesh(const fs::path&)> make;  ///< given the base's STEP file
  double tolerance;                           ///< mm; largest distance of surface nodes to the CAD
};

struct Family {
  std::string name;
  std::function<TopoDS_Shape(double)> make;
  std::vector<ModelMesh> meshes;
  std::vector<std::string> changes = {};  ///< names of single ones
  std::function<TopoDS_Shape(const std::string&)> make_changed = {};
};

struct Request {
  fs::path out;
  std::vector<std::string> families;  ///< empty: all, and the small shapes
  std::vector<int> further_steps;     ///< beyond the last one
};

std::string counts_text(const EntityCounts& counts) {
  return std::to_string(counts.faces) + " faces, " + std::to_string(counts.edges) + " edges, " +
         std::to_string(counts.vertices) + " vertices";
}

void write_model_mesh(const fs::path& path, const Mesh& mesh) {
  const QualityReport quality = measure_quality(mesh, mesh.points, detect_orientation(mesh));
  if (quality.inverted > 0) {
    throw InvalidInputError(path.string() + " has " + std::to_string(quality.inverted) +
                            " inverted elements");
  }
  write_mesh(path, mesh);
  std::printf("%s: %lld nodes, %lld cells, scaled Jacobian %.3f / %.3f\n", path.c_str(),
              static_cast<long long>(mesh.node_count()), static_cast<long long>(mesh.cell_count()),
              quality.min, quality.mean);
}

/// Checks that the surface of `mesh` lies on the CAD it is meant for, and writes it. Of a large
/// mesh a random choice of the surface nodes is checked, always the same.
void write_checked(const fs::path& path, const Mesh& mesh, const fs::path& step, double tolerance) {
  if (tolerance == not_on_cad) return write_model_mesh(path, mesh);
  const std::vector<Index> all_nodes = extract_boundary(mesh).nodes;
  std::vector<Index> nodes;
  std::ranges::sample(all_nodes, std::back_inserter(nodes), most_checked_nodes, std::mt19937(1));
  const double distance = largest_distance(mesh.points(nodes, Eigen::all), read_step(step));
  if (distance > tolerance) {
    std::ostringstream text;
    text << path.string() << " is off its CAD by " << distance << " mm";
    throw InvalidInputError(text.str());
  }
  write_model_mesh(path, mesh);
}

fs::path step_path(const fs::path& folder, int step) {
  if (step == 0) return folder / "base.step";
  char name[16];
  std::snprintf(name, sizeof name, "step%02d.step", step);
  return folder / name;
}

/// Writes all steps; every one is valid and has as many entities as the base, read back as well.
void write_steps(const fs::path& folder, const Family& family,
                 const std::vector<int>& further_steps) {
  std::vector<int> steps(step_count + 1);
  std::iota(steps.begin(), steps.end(), 0);
  steps.insert(steps.end(), further_steps.begin(), further_steps.end());
  std::vector<std::pair<fs::path, TopoDS_Shape>> shapes;
  for (const int step : steps)
    shapes.emplace_back(step_path(folder, step),
                        family.make(static_cast<double>(step) / step_count));
  for (const std::string& change : family.changes)
    shapes.emplace_back(folder / (change + ".step"), family.make_changed(change));
  const EntityCounts base = count_entities(shapes.front().second);
  for (const auto& [path, made] : shapes) {
    check_valid(made, path.string());
    write_step(path, made, family.name);
    const TopoDS_Shape read = read_step(path);
    check_valid(read, path.string() + ", read back,");
    const EntityCounts counts = count_entities(read);
    if (counts != base) {
      throw TopologyError(path.string() + " has " + counts_text(counts) + ", the base " +
                          counts_text(base));
    }
  }
  std::printf("%s: base and %zu variants, each %s\n", folder.c_str(), shapes.size() - 1,
              counts_text(base).c_str());
}

void write_family(const Request& request, const Family& family) {
  const fs::path folder = request.out / family.name;
  fs::create_directories(folder);
  write_steps(folder, family, request.further_steps);
  const fs::path base = step_path(folder, 0);
  for (const ModelMesh& mesh : family.meshes) {
    write_checked(folder / mesh.file, mesh.make(base), base, mesh.tolerance);
  }
}

/// Writes base and variant; the variant has as many entities, read back as well.
void write_pair(const fs::path& folder, const SmallShape& small) {
  const fs::path base = folder / (small.name + ".step");
  const fs::path variant = folder / (small.name + "_variant.step");
  check_valid(small.base, base.string());
  check_valid(small.variant, variant.string());
  write_step(base, small.base, small.name);
  write_step(variant, small.variant, small.name);
  const EntityCounts counts = count_entities(read_step(base));
  if (count_entities(read_step(variant)) != counts)
    throw TopologyError(variant.string() + " has other entities than its base");
  std::printf("%s and its variant: %s\n", base.c_str(), counts_text(counts).c_str());
}

void write_small_shapes(const fs::path& folder) {
  fs::create_directories(folder);
  for (const SmallShape& small : make_small_shapes()) {
    const fs::path step = folder / (small.name + ".step");
    write_pair(folder, small);
    const fs::path path = folder / (small.name + ".vtu");
    const Mesh mesh = mesh_with_tets(step, small.tets);
    if (small.tets.far_field_width > 0) {
      write_model_mesh(path, mesh);  // most of its surface is not in the CAD
    } else {
      write_checked(path, mesh, step, gmsh_tolerance);
    }
  }
}

ModelMesh hexes(std::function<Mesh()> make, double tolerance = exact) {
  return {"hex.vtu", [make](const fs::path&) { return make(); }, tolerance};
}

ModelMesh tets(const std::string& file, const TetOptions& options) {
  return {file, [options](const fs::path& base) { return mesh_with_tets(base, options); },
          gmsh_tolerance};
}

std::vector<Family> all_families() {
  return {{"bore",
           make_bore,
           {hexes(make_bore_hex), tets("tet.vtu", {.size = 4.6, .elements_per_turn = 30}),
            tets("tet_quadratic.vtu",
                 {.size = 14, .minimum_size = 5, .elements_per_turn = 12, .order = 2})}},
          {"pipe",
           make_pipe,
           {hexes([] { return make_pipe_hex(); }), tets("tet.vtu", {.size = 2.3}),
            tets("tet_quadratic.vtu", {.size = 9, .order = 2})}},
          {"courier",
           make_courier,
           {hexes(make_courier_hex, curved_tolerance), tets("tet.vtu", {.size = 1.3})}},
          {"canister",
           make_canister,
           {hexes(make_canister_hex, curved_tolerance), tets("tet.vtu", {.size = 3.2})}},
          {"wing",
           make_wing,
           {{"layers.vtu", make_wing_layers, not_on_cad},
            {"poly.vtu", [](const fs::path& base) { return join_stars(make_wing_layers(base)); },
             not_on_cad}},
           wing_changes(),
           make_wing_changed}};
}

bool is_wanted(const Request& request, const std::string& name) {
  return request.families.empty() || std::ranges::count(request.families, name) > 0;
}

void generate(const Request& request) {
  for (const Family& family : all_families()) {
    if (is_wanted(request, family.name)) write_family(request, family);
  }
  if (is_wanted(request, "shapes")) write_small_shapes(request.out / "shapes");
}

/// Sets `exit_code` when the program is to end at once, help or a wrong argument having been shown.
Request parse(int argc, char** argv, std::optional<int>& exit_code) {
  Request request;
  CLI::App app("Writes CAD families and their meshes.");
  app.add_option("OUTDIR", request.out, "folder to write to")->required();
  std::vector<std::string> names = {"shapes"};
  for (const Family& family : all_families()) names.push_back(family.name);
  app.add_option("--family", request.families, "write these alone")->check(CLI::IsMember(names));
  app.add_option("--step", request.further_steps,
                 "write these steps as well; 30 is 150 % of the full change")
      ->check(CLI::Range(step_count + 1, 99));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    exit_code = app.exit(error);
  }
  return request;
}

}  // namespace
}  // namespace cadmorph::models

int main(int argc, char** argv) {
  Message::DefaultMessenger()->ChangePrinters().Clear();  // OCCT tells of every transfer
  try {
    std::optional<int> exit_code;
    const cadmorph::models::Request request = cadmorph::models::parse(argc, argv, exit_code);
    if (exit_code) return *exit_code;
    cadmorph::models::generate(request);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cadmorph-models: %s\n", error.what());
    return 2;
  }
  return 0;
}
