// main_job: prints the time of the bore-hex main job as a whole process, as a ratio to a process
// that only reads and writes the same VTU with VTK, and the time of projecting a point onto the
// CAD.

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "cad/step_reader.h"
#include "core/parallel.h"
#include "core/stopwatch.h"

namespace {

using namespace cadmorph;
namespace fs = std::filesystem;

constexpr int kRuns = 7;
constexpr Index kSamples = 1'000'000;
constexpr Index kPoints = 100'000;

double seconds_of(const auto& call) {
  const Stopwatch watch;
  call();
  return watch.seconds();
}

// Runs a program and waits for it.
void run(const std::vector<std::string>& command) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw std::runtime_error(command[0] + " failed");
}

// Median over some runs, after one that warms the caches.
double median_seconds(const std::vector<std::string>& command) {
  run(command);
  std::vector<double> times;
  for (int i = 0; i < kRuns; ++i) times.push_back(seconds_of([&] { run(command); }));
  std::ranges::nth_element(times, times.begin() + kRuns / 2);
  return times[kRuns / 2];
}

void time_main_job(const fs::path& models, const fs::path& scratch) {
  const std::string mesh = (models / "bore/hex.vtu").string();
  const std::string out = (scratch / "out.vtu").string();
  const double round_trip = median_seconds({CADMORPH_ROUND_TRIP, mesh, out});
  std::printf("%-34s %8.3f s\n", "VTK reads and writes bore/hex.vtu", round_trip);
  for (const char* step : {"step05", "step20"}) {
    const std::string variant = (models / "bore" / step).string() + ".step";
    const double job = median_seconds({CADMORPH_PROGRAM, (models / "bore/base.step").string(),
                                       variant, mesh, "-o", out, "--quiet"});
    std::printf("main job, bore hex, %-14s %8.3f s   ratio %5.1f (at most 8)\n", step, job,
                job / round_trip);
  }
}

// Points within a hundredth of the diagonal of the surface.
RowMatrix points_near(const FaceSamples& samples, double diagonal) {
  std::mt19937 random(1);
  std::uniform_int_distribution<Index> pick(0, samples.points.rows() - 1);
  std::normal_distribution<double> offset(0, 1e-3 * diagonal);
  RowMatrix points(kPoints, 3);
  for (Index i = 0; i < kPoints; ++i) {
    points.row(i) = samples.points.row(pick(random));
    for (int d = 0; d < 3; ++d) points(i, d) += offset(random);
  }
  return points;
}

void time_projection(const fs::path& step) {
  const CadModel model = read_step(step);
  FaceSamples samples;
  const double sampling = seconds_of([&] { samples = sample_faces(model, kSamples); });
  std::unique_ptr<KdTree> tree;
  const double building = seconds_of([&] { tree = std::make_unique<KdTree>(samples.points); });
  const RowMatrix points = points_near(samples, model.diagonal());
  double sum = 0;
  const double projecting = seconds_of([&] {
    for (Index i = 0; i < kPoints; ++i) {
      const Eigen::Vector3d x = points.row(i).transpose();
      const Index seed = tree->nearest(x.data(), 1).front().index;
      sum += project_on_face(model, samples.face[seed], x, samples.uv[seed]).distance;
    }
  });
  std::printf(
      "projection on %-20s %8.2f us a node and core (at most 15); %lld samples in %.2f s, "
      "tree %.2f s, mean distance %.3g mm\n",
      step.parent_path().filename().c_str(), 1e6 * projecting / kPoints,
      static_cast<long long>(samples.points.rows()), sampling, building, sum / kPoints);
}

}  // namespace

int main() {
  const fs::path models = fs::path(CADMORPH_SOURCE_DIR) / "models";
  const fs::path scratch = fs::temp_directory_path() / ("main_job." + std::to_string(getpid()));
  fs::create_directory(scratch);
  std::printf("%d threads\n", thread_count());
  int code = 0;
  try {
    time_main_job(models, scratch);
    time_projection(models / "bore/base.step");
    time_projection(models / "pipe/base.step");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "main_job: %s\n", error.what());
    code = 1;
  }
  fs::remove_all(scratch);
  return code;
}
