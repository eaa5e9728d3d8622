// format_speed FILE...: for each mesh file, or folder of one, the time to read it, to write it with
// all nodes moved, and to copy its bytes; the rates, and (reading + writing) / copying. Processor
// time too: it bears a busy machine. The best of three rounds: a virtual machine may take several
// times as long where it gets memory from its host anew.

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "core/mesh_file.h"
#include "core/stopwatch.h"

namespace {

using namespace cadmorph;
namespace fs = std::filesystem;

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

constexpr int kRounds = 3;

struct Times {
  double wall = std::numeric_limits<double>::infinity(), processor = wall;

  void take(const Times& other) {
    wall = std::min(wall, other.wall);
    processor = std::min(processor, other.processor);
  }
};

template <class Call>
Times measure(Call&& call) {
  const Stopwatch watch;
  const double before = processor_seconds();
  call();
  return {watch.seconds(), processor_seconds() - before};
}

// As `cp` does, flushed to disk like a mesh that is written.
void copy_flushed(const fs::path& from, const fs::path& to) {
  fs::copy(from, to, fs::copy_options::recursive);
  sync();
}

double megabytes_of(const fs::path& path) {
  if (!fs::is_directory(path)) return 1e-6 * static_cast<double>(fs::file_size(path));
  double sum = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path))
    if (entry.is_regular_file()) sum += 1e-6 * static_cast<double>(entry.file_size());
  return sum;
}

void run(const fs::path& file, const fs::path& scratch) {
  const double megabytes = megabytes_of(file);
  const fs::path target = scratch / file.filename();
  std::unique_ptr<MeshFile> mesh;
  Times copied, read, written;
  for (int round = 0; round < kRounds; ++round) {
    copied.take(measure([&] { copy_flushed(file, target); }));
    fs::remove_all(target);
    mesh.reset();
    read.take(measure([&] { mesh = std::make_unique<MeshFile>(file); }));
    const Points moved = 1.01 * mesh->mesh().points;
    written.take(measure([&] { mesh->write(target, moved); }));
    fs::remove_all(target);
  }
  std::printf("%-22s %-8s %9lld %8.1f %7.2f %7.2f %6.0f %7.2f %7.2f %6.0f %7.2f %6.1f\n",
              file.filename().c_str(), mesh->format().c_str(),
              static_cast<long long>(mesh->mesh().node_count()), megabytes, read.wall,
              read.processor, megabytes / read.processor, written.wall, written.processor,
              megabytes / written.processor, copied.wall, (read.wall + written.wall) / copied.wall);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const fs::path scratch = fs::temp_directory_path() / ("format_speed." + std::to_string(getpid()));
  fs::create_directory(scratch);
  std::printf("%-22s %-8s %9s %8s %7s %7s %6s %7s %7s %6s %7s %6s\n", "file", "format", "nodes",
              "MB", "read s", "CPU s", "MB/s", "write s", "CPU s", "MB/s", "copy s", "ratio");
  int code = 0;
  for (int i = 1; i < argc; ++i) {
    try {
      run(argv[i], scratch);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "format_speed: %s\n", error.what());
      code = 1;
    }
  }
  fs::remove_all(scratch);
  return code;
}
