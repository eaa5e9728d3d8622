// batch_throughput [COUNT]: prints the time of a variant of bore-hex in a batch of 200 (COUNT) as a
// ratio to the single command's and to reading its STEP file and writing its mesh, and the peak
// memory of batches of 20 and 200 variants. Wall and processor time: the latter bears a busy
// machine.

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "cad/step_reader.h"
#include "core/mesh_file.h"
#include "core/parallel.h"

namespace {

using namespace cadmorph;
namespace fs = std::filesystem;

constexpr int kRuns = 5;
constexpr int kFew = 20;

struct Cost {
  double wall = 0, processor = 0;  // seconds
  double memory = 0;               // bytes
};

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

double wall_clock() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Runs a program, waits for it and for what it started.
Cost run(const std::vector<std::string>& command) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const double start = wall_clock();
  const pid_t child = fork();
  if (child == 0) {
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw std::runtime_error(command[0] + " failed");
  return {wall_clock() - start, seconds(usage.ru_utime) + seconds(usage.ru_stime),
          1024.0 * static_cast<double>(usage.ru_maxrss)};
}

Cost run_here(const std::function<void()>& call) {
  rusage before{}, after{};
  getrusage(RUSAGE_SELF, &before);
  const double start = wall_clock();
  call();
  const double wall = wall_clock() - start;
  getrusage(RUSAGE_SELF, &after);
  return {wall,
          seconds(after.ru_utime) + seconds(after.ru_stime) - seconds(before.ru_utime) -
              seconds(before.ru_stime),
          0};
}

// The median of each figure after a warm-up.
Cost median(const std::function<Cost()>& measure) {
  measure();
  std::vector<Cost> costs;
  for (int i = 0; i < kRuns; ++i) costs.push_back(measure());
  const auto middle = [&](double Cost::*figure) {
    std::ranges::nth_element(costs, costs.begin() + kRuns / 2, {}, figure);
    return costs[kRuns / 2].*figure;
  };
  return {middle(&Cost::wall), middle(&Cost::processor), middle(&Cost::memory)};
}

class Benchmark {
 public:
  explicit Benchmark(fs::path scratch) : scratch_(std::move(scratch)) {}

  void run_all(int count) {
    const Cost single = median([&] {
      return run({CADMORPH_PROGRAM, base_, step_, mesh_, "-o", scratch_ / "one.vtu", "--quiet"});
    });
    const MeshFile mesh(mesh_);
    const Cost files = median([&] {
      return run_here([&] {
        read_step(step_);
        mesh.write(scratch_ / "copy.vtu", mesh.mesh().points);
      });
    });
    const Cost few = run_batch(kFew), many = run_batch(count);
    print("single command", single);
    print("STEP read and VTU write", files);
    print("a variant of " + std::to_string(count),
          {many.wall / count, many.processor / count, many.memory});
    std::printf("of the single command: wall %.3f, processor %.3f (at most 0.2)\n",
                many.wall / count / single.wall, many.processor / count / single.processor);
    std::printf("of STEP read and VTU write: wall %.2f, processor %.2f (at most 2)\n",
                many.wall / count / files.wall, many.processor / count / files.processor);
    std::printf("peak memory of %d variants: %.1f MB, of %d: %.1f MB, ratio %.3f (at most 1.1)\n",
                kFew, 1e-6 * few.memory, count, 1e-6 * many.memory, many.memory / few.memory);
  }

 private:
  static void print(const std::string& name, const Cost& cost) {
    std::printf("%-28s %8.4f s wall, %8.4f s processor\n", name.c_str(), cost.wall, cost.processor);
  }

  Cost run_batch(int count) const {
    std::vector<std::string> command = {CADMORPH_PROGRAM, "batch", base_, mesh_};
    for (int i = 0; i < count; ++i) {
      const fs::path step = scratch_ / ("v" + std::to_string(i) + ".step");
      fs::copy_file(steps_[i % steps_.size()], step, fs::copy_options::overwrite_existing);
      command.push_back(step);
    }
    const fs::path out = scratch_ / ("out" + std::to_string(count));
    command.insert(command.end(), {"-o", out, "--quiet"});
    return run(command);
  }

  fs::path scratch_;
  fs::path models_ = fs::path(CADMORPH_SOURCE_DIR) / "models/bore";
  std::string base_ = models_ / "base.step", mesh_ = models_ / "hex.vtu";
  std::vector<fs::path> steps_ = {models_ / "step05.step", models_ / "step10.step",
                                  models_ / "step20.step"};
  std::string step_ = steps_[1];
};

}  // namespace

int main(int argc, char** argv) {
  const fs::path scratch =
      fs::temp_directory_path() / ("batch_throughput." + std::to_string(getpid()));
  fs::create_directory(scratch);
  std::printf("%d threads\n", thread_count());
  int code = 0;
  try {
    Benchmark(scratch).run_all(argc > 1 ? std::atoi(argv[1]) : 200);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "batch_throughput: %s\n", error.what());
    code = 1;
  }
  fs::remove_all(scratch);
  return code;
}
