// Writes the CAD families bore and pipe, the small shapes, and their meshes.

#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "core/boundary.h"
#include "core/errors.h"
#include "core/mesh_file.h"
#include "models/bore.h"
#include "models/pipe.h"
#include "models/shapes.h"
#include "models/step_files.h"
#include "models/tet_mesher.h"

namespace cadmorph::models {
namespace {

namespace fs = std::filesystem;

constexpr int step_count = 20;
constexpr double exact = 1e-12;          // mm; rounding of coordinates of 100 mm
constexpr double gmsh_tolerance = 1e-6;  // mm; gmsh's nodes are on the curve, not the surface

struct Family {
  std::string name;
  std::function<TopoDS_Shape(double)> make;
  std::function<Mesh()> make_hex;
  TetOptions tets;
  TetOptions quadratic_tets;
};

std::string counts_text(const EntityCounts& counts) {
  return std::to_string(counts.faces) + " faces, " + std::to_string(counts.edges) + " edges, " +
         std::to_string(counts.vertices) + " vertices";
}

void write_model_mesh(const fs::path& path, const Mesh& mesh) {
  write_mesh(path, mesh);
  std::printf("%s: %lld nodes, %lld cells\n", path.c_str(),
              static_cast<long long>(mesh.node_count()), static_cast<long long>(mesh.cell_count()));
}

/// Checks that the surface of `mesh` lies on the CAD it is meant for, and writes it.
void write_checked(const fs::path& path, const Mesh& mesh, const fs::path& step, double tolerance) {
  const std::vector<Index> nodes = extract_boundary(mesh).nodes;
  const double distance = largest_distance(mesh.points(nodes, Eigen::all), read_step(step));
  if (distance > tolerance) {
    throw InvalidInputError(path.string() + " is off its CAD by " + std::to_string(distance));
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
void write_steps(const fs::path& folder, const Family& family) {
  EntityCounts base;
  for (int step = 0; step <= step_count; ++step) {
    const fs::path path = step_path(folder, step);
    const TopoDS_Shape made = family.make(static_cast<double>(step) / step_count);
    check_valid(made, path.string());
    write_step(path, made, family.name);
    const TopoDS_Shape read = read_step(path);
    check_valid(read, path.string() + ", read back,");
    const EntityCounts counts = count_entities(read);
    if (step == 0) base = counts;
    if (counts != base) {
      throw TopologyError(path.string() + " has " + counts_text(counts) + ", the base " +
                          counts_text(base));
    }
  }
  std::printf("%s: base and %d steps, each %s\n", folder.c_str(), step_count,
              counts_text(base).c_str());
}

void write_family(const fs::path& out, const Family& family) {
  const fs::path folder = out / family.name;
  fs::create_directories(folder);
  write_steps(folder, family);
  const fs::path base = step_path(folder, 0);
  write_checked(folder / "hex.vtu", family.make_hex(), base, exact);
  write_checked(folder / "tet.vtu", mesh_with_tets(base, family.tets), base, gmsh_tolerance);
  write_checked(folder / "tet_quadratic.vtu", mesh_with_tets(base, family.quadratic_tets), base,
                gmsh_tolerance);
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

void generate(const fs::path& out) {
  write_family(out, {"bore",
                     make_bore,
                     make_bore_hex,
                     {.size = 4.6, .elements_per_turn = 30},
                     {.size = 14, .minimum_size = 5, .elements_per_turn = 12, .order = 2}});
  write_family(
      out,
      {"pipe", make_pipe, [] { return make_pipe_hex(); }, {.size = 2.3}, {.size = 9, .order = 2}});
  write_small_shapes(out / "shapes");
}

}  // namespace
}  // namespace cadmorph::models

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: cadmorph-models OUTDIR\n");
    return 1;
  }
  Message::DefaultMessenger()->ChangePrinters().Clear();  // OCCT tells of every transfer
  try {
    cadmorph::models::generate(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cadmorph-models: %s\n", error.what());
    return 2;
  }
  return 0;
}
