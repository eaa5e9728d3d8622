// guard [N]: the share of the validity checks in a morph of a million elements (N hexahedra along a
// cube's edge, default 100), hexahedra and tetrahedra. The morph is the volume morph alone: in the
// main job the reading, the surface and the writing come on top.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <utility>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/quality_checks.h"
#include "core/validity.h"
#include "volume/volume_morph.h"

namespace cadmorph {
namespace {

// CPU seconds of all threads.
template <class Call>
double cpu_seconds(Call&& call) {
  const std::clock_t start = std::clock();
  call();
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

Points wavy(const Mesh& mesh, const std::vector<Index>& surface) {
  Points result(surface.size(), 3);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Eigen::RowVector3d x = mesh.points.row(surface[i]);
    const Eigen::RowVector3d wave(std::sin(4 * x[1]), std::cos(3 * x[2]), std::sin(5 * x[0]));
    result.row(i) = x + 0.03 * wave;
  }
  return result;
}

void measure(CellType type, int n, const char* name) {
  const Mesh mesh = testing::cube(type, n);
  const std::vector<Index> surface = extract_boundary(mesh).nodes;
  const Points target = wavy(mesh, surface);
  const Orientation orientation = detect_orientation(mesh);
  Points moved;
  const double morph = cpu_seconds([&] { moved = VolumeMorph(mesh, surface).morph(target); });
  Index invalid = 0;
  const double validity = cpu_seconds([&] {
    invalid = check_validity(mesh, mesh.points, orientation).invalid +
              check_validity(mesh, moved, orientation).invalid;
  });
  const double quality = cpu_seconds([&] {
    measure_quality(mesh, mesh.points, orientation);
    measure_quality(mesh, moved, orientation);
  });
  const CellNeighbours neighbours = find_cell_neighbours(mesh);
  const double checks = cpu_seconds([&] {
    check_quality(mesh, mesh.points, neighbours, orientation);
    check_quality(mesh, moved, neighbours, orientation);
  });
  std::printf("%-4s %9lld %8zu %8.2f %8.3f %6.2f %% %8.3f %6.2f %% %8.3f %7lld\n", name,
              static_cast<long long>(mesh.cell_count()), surface.size(), morph, validity,
              100 * validity / (morph + validity), quality, 100 * quality / (morph + validity),
              checks, static_cast<long long>(invalid));
}

}  // namespace
}  // namespace cadmorph

int main(int argc, char** argv) {
  const int n = argc > 1 ? std::atoi(argv[1]) : 100;
  if (n < 2) {
    std::fprintf(stderr, "usage: guard [N]\n");
    return 1;
  }
  std::printf(
      "CPU seconds, before and after together; shares of morph + exact test\n"
      "cell  elements  surface    morph    exact    share  quality    share   checks invalid\n");
  cadmorph::measure(cadmorph::CellType::Hexahedron, n, "hex");
  cadmorph::measure(cadmorph::CellType::Tetra, static_cast<int>(std::lround(n / std::cbrt(6.0))),
                    "tet");
  return 0;
}
