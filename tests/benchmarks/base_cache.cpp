// base_cache [N]: prints the time that the base side of a box of 4 N x 3 N x 2 N hexahedra takes
// without and with its cache, and the size of the cache. Wall and processor time: the latter bears
// a busy machine.

#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "apps/pipeline/morph_job.h"
#include "cad/step_reader.h"
#include "core/blas.h"
#include "core/mesh_file.h"
#include "core/stopwatch.h"

namespace {

using namespace cadmorph;
namespace fs = std::filesystem;

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// models/shapes/box.step in hexahedra.
Mesh box_mesh(Index n) {
  const Index nx = 4 * n, ny = 3 * n, nz = 2 * n;
  const auto node = [&](Index i, Index j, Index k) { return (k * (ny + 1) + j) * (nx + 1) + i; };
  Mesh mesh;
  mesh.points.resize((nx + 1) * (ny + 1) * (nz + 1), 3);
  const double size = 10.0 / static_cast<double>(n);
  for (Index k = 0; k <= nz; ++k)
    for (Index j = 0; j <= ny; ++j)
      for (Index i = 0; i <= nx; ++i)
        mesh.points.row(node(i, j, k)) = size * Eigen::RowVector3d(i, j, k);
  mesh.offsets.push_back(0);
  for (Index k = 0; k < nz; ++k)
    for (Index j = 0; j < ny; ++j)
      for (Index i = 0; i < nx; ++i) {
        for (const Index up : {k, k + 1})
          for (const Index corner :
               {node(i, j, up), node(i + 1, j, up), node(i + 1, j + 1, up), node(i, j + 1, up)})
            mesh.connectivity.push_back(corner);
        mesh.types.push_back(CellType::Hexahedron);
        mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
      }
  return mesh;
}

struct Job {
  std::shared_ptr<const CadModel> cad;
  std::shared_ptr<const MeshFile> mesh;

  void measure(const std::string& name, const PipelineOptions& options) const {
    const Stopwatch watch;
    const double before = processor_seconds();
    const MorphJob job(cad, mesh, options);
    const double wall = watch.seconds();
    std::printf("%-24s %7.2f s wall, %7.2f s processor\n", name.c_str(), wall,
                processor_seconds() - before);
    std::fflush(stdout);
  }
};

void run(const fs::path& scratch, Index n) {
  const fs::path file = scratch / "box.vtu", cache = scratch / "box.cache";
  write_mesh(file, box_mesh(n));
  const fs::path step = fs::path(CADMORPH_SOURCE_DIR) / "models/shapes/box.step";
  const Job job{std::make_shared<const CadModel>(read_step(step)),
                std::make_shared<const MeshFile>(file)};
  PipelineOptions options;
  job.measure("without a cache", options);
  options.cache = cache;
  job.measure("with one to be written", options);
  job.measure("with it", options);
  std::printf("%lld nodes; the cache has %.0f MB\n",
              static_cast<long long>(job.mesh->mesh().node_count()),
              1e-6 * static_cast<double>(fs::file_size(cache)));
}

}  // namespace

int main(int argc, char** argv) {
  use_fitting_blas_kernel();
  const fs::path scratch = fs::temp_directory_path() / ("base_cache." + std::to_string(getpid()));
  fs::create_directory(scratch);
  int code = 0;
  try {
    run(scratch, argc > 1 ? std::atoi(argv[1]) : 36);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "base_cache: %s\n", error.what());
    code = 1;
  }
  fs::remove_all(scratch);
  return code;
}
