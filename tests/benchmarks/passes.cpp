// passes [N | FILE]: the time of each pass over a mesh of 6 N^3 tetrahedra, and over one of about
// as many corners in hexahedra (N: 95, 885,000 nodes); or over the mesh of a file, whose nodes and
// cells need not lie in memory as they lie in space. The passes run for the base mesh and, from the
// quality on, for each variant. Wall time is the best of three runs, processor time that of all
// threads in it.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <utility>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/edge_lengths.h"
#include "core/mesh_file.h"
#include "core/parallel.h"
#include "core/quality_checks.h"
#include "core/stopwatch.h"
#include "core/validity.h"

namespace cadmorph {
namespace {

struct Times {
  double wall = 1e300, cpu = 1e300;
};

Times best_of_three(const std::function<void()>& pass) {
  Times best;
  for (int run = 0; run < 3; ++run) {
    const std::clock_t cpu = std::clock();
    const Stopwatch watch;
    pass();
    best.wall = std::min(best.wall, watch.seconds());
    best.cpu = std::min(best.cpu, static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC);
  }
  return best;
}

void print(const char* pass, const Times& times, Index cells) {
  std::printf("  %-28s %8.3f s %8.3f s %8.0f ns a cell\n", pass, times.wall, times.cpu,
              1e9 * times.cpu / static_cast<double>(cells));
}

// Smooth, so that the cells keep the order in memory that a mesh generator gives them.
Points wavy(const Points& points, int n) {
  const double size = 0.2 / n;
  Points result = points;
  for (Index i = 0; i < points.rows(); ++i) {
    const Eigen::RowVector3d x = 40 * points.row(i);
    result.row(i) += size * Eigen::RowVector3d(std::sin(x[1] + x[2]), std::cos(x[2] - 2 * x[0]),
                                               std::sin(x[0] + 3 * x[1]));
  }
  return result;
}

void measure(const char* name, const Mesh& mesh) {
  const Index cells = mesh.cell_count();
  std::printf("%s: %lld cells, %lld nodes, %d threads; wall, processor\n", name,
              static_cast<long long>(cells), static_cast<long long>(mesh.node_count()),
              thread_count());
  Boundary boundary;
  CellNeighbours neighbours;
  Orientation orientation;
  QualityReport quality;
  ValidityReport validity;
  QualityChecks checks;
  print("neighbours", best_of_three([&] { neighbours = find_cell_neighbours(mesh); }), cells);
  print("boundary, of them", best_of_three([&] { boundary = extract_boundary(mesh, neighbours); }),
        cells);
  print("orientation", best_of_three([&] { orientation = detect_orientation(mesh); }), cells);
  print("scaled Jacobians",
        best_of_three([&] { quality = measure_quality(mesh, mesh.points, orientation); }), cells);
  print("exact validity",
        best_of_three([&] { validity = check_validity(mesh, mesh.points, orientation); }), cells);
  print("finite-volume checks",
        best_of_three([&] { checks = check_quality(mesh, mesh.points, neighbours, orientation); }),
        cells);
  print("edges at nodes", best_of_three([&] { incident_edges(mesh); }), cells);
  std::printf(
      "  %lld facets, smallest scaled Jacobian %.17g, mean %.17g, invalid %lld,\n"
      "  non-orthogonality %.17g, mean %.17g, skewness %.17g, aspect %.17g\n\n",
      static_cast<long long>(boundary.facet_count()), quality.min, quality.mean,
      static_cast<long long>(validity.invalid), checks.max_non_orthogonality_deg,
      checks.mean_non_orthogonality_deg, checks.max_skewness, checks.max_aspect_ratio);
}

}  // namespace
}  // namespace cadmorph

int main(int argc, char** argv) {
  using namespace cadmorph;
  const std::string argument = argc > 1 ? argv[1] : "95";
  const int n = std::atoi(argument.c_str());
  if (n == 0) {
    measure(argument.c_str(), MeshFile(argument).mesh());
    return 0;
  }
  for (const auto& [name, type] :
       {std::pair("Tetrahedra", CellType::Tetra), std::pair("Hexahedra", CellType::Hexahedron)}) {
    Mesh mesh = testing::cube(type, std::max(2, n));
    mesh.points = wavy(mesh.points, n);
    measure(name, mesh);
  }
  return 0;
}
