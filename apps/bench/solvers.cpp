#include "apps/bench/solvers.h"

#include <dlfcn.h>
#include <malloc.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "apps/bench/measure.h"
#include "apps/bench/results_file.h"
#include "apps/summary/text_table.h"
#include "core/errors.h"
#include "volume/volume_morph.h"

namespace cadmorph::bench {
namespace {

using Row = std::vector<std::string>;

const Row kSolverHeader = {
    "family",         "mesh",          "solver",      "surface_nodes", "nodes",
    "set_up_seconds", "morph_seconds", "cpu_seconds", "memory_bytes",  "min_scaled_jacobian",
    "lapack",         "note"};

/// A solver of the comparison.
struct Solver {
  std::string name;
  SolverKind kind;
  bool is_netlib;            ///< with the reference LAPACK and BLAS
  std::size_t most_centres;  ///< run for: with more it takes too long
  double matrices = 0;       ///< dense ones that it holds at once
  double tolerance = RbfOptions().tolerance;
};

const std::vector<Solver> kSolvers = {
    {"netlib LU", SolverKind::Lu, true, 22000, 2},
    {"netlib LDL^T", SolverKind::Ldlt, true, 22000, 2},
    {"OpenBLAS LU", SolverKind::Lu, false, 60000, 2},
    {"OpenBLAS LDL^T", SolverKind::Ldlt, false, 60000, 2},
    {"OpenBLAS Cholesky", SolverKind::Cholesky, false, 60000, 1},
    {"IQR", SolverKind::Iqr, false, 50000, 0, 1e-2},
    {"fast", SolverKind::Fast, false, 100000000},
};

const Solver& find_solver(const std::string& name) {
  const auto found = std::ranges::find(kSolvers, name, &Solver::name);
  if (found == kSolvers.end()) throw InvalidInputError("there is no solver " + name);
  return *found;
}

// File name of the library whose dgetrf runs.
std::string lapack_library() {
  Dl_info info{};
  if (dladdr(dlsym(RTLD_DEFAULT, "dgetrf_"), &info) == 0) return "";
  return std::filesystem::path(info.dli_fname).filename().string();
}

// Starts this program for one solver; -1: it can't be started. The reference libraries are loaded
// before OpenBLAS, so that their symbols are taken.
pid_t start_child(const std::string& program, const EvaluateOptions& options,
                  const Subject& subject, const Solver& solver) {
  std::vector<std::string> words = {program,
                                    "run-solver",
                                    options.models.string(),
                                    "-o",
                                    options.output.string(),
                                    "--family",
                                    subject.family,
                                    "--mesh",
                                    subject.mesh,
                                    "--solver",
                                    solver.name};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  std::string preload = "LD_PRELOAD=" CADMORPH_NETLIB_LAPACK ":" CADMORPH_NETLIB_BLAS;
  std::vector<char*> environment;
  for (char** entry = environ; *entry; ++entry) environment.push_back(*entry);
  if (solver.is_netlib) environment.push_back(preload.data());
  environment.push_back(nullptr);
  pid_t child = -1;
  const bool is_started = posix_spawn(&child, "/proc/self/exe", nullptr, nullptr, arguments.data(),
                                      environment.data()) == 0;
  return is_started ? child : -1;
}

// Whether a child ended well, once it has.
bool ended_well(pid_t child) {
  int status = 0;
  return child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) &&
         WEXITSTATUS(status) == 0;
}

Row row_without_figures(const Subject& subject, const Series& series, const Solver& solver,
                        const std::string& note) {
  Row row = {subject.family, subject.mesh, solver.name, std::to_string(series.surface_nodes.size()),
             std::to_string(series.mesh.node_count())};
  row.resize(kSolverHeader.size());
  row.back() = note;
  return row;
}

double needed_memory(const Solver& solver, const Series& series) {
  const auto m = static_cast<double>(series.surface_nodes.size());
  return solver.matrices * 8 * m * m;
}

// Why a solver is not run; empty: it is.
std::string why_not(const Solver& solver, const Series& series) {
  constexpr double kGiB = 1 << 30;
  const double needed = needed_memory(solver, series);
  if (needed > physical_memory())
    return format("does not fit: needs %.0f GiB of %.0f", needed / kGiB, physical_memory() / kGiB);
  if (series.surface_nodes.size() > solver.most_centres) return "not run: takes too long";
  if (solver.is_netlib && !std::filesystem::exists(CADMORPH_NETLIB_LAPACK))
    return "not run: the reference LAPACK is not installed";
  return "";
}

// A line of this process's status, bytes. What getrusage tells begins with the parent's.
double memory_line(const std::string& name) {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;)
    if (double kib = 0; word == name && file >> kib) return 1024 * kib;
  return 0;
}

// Memory that this process holds now; what it held at most before is forgotten.
double memory_from_here() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";
  return memory_line("VmRSS:");
}

Row measured_row(const Subject& subject, const Series& series, const Solver& solver,
                 const std::string& library) {
  const double memory_before = memory_from_here();
  const Stopwatch whole;
  const VolumeMorph morph(series.mesh, series.surface_nodes,
                          {.rbf = {.solver = solver.kind,
                                   .tolerance = solver.tolerance,
                                   .memory_limit = physical_memory()}});
  const double set_up_seconds = whole.seconds();
  const Points positions = morph.morph(series.path(Route())[kSteps - 1]);
  const double seconds = whole.seconds() - set_up_seconds, cpu = whole.cpu();
  const double memory = memory_line("VmHWM:") - memory_before;
  return {subject.family,
          subject.mesh,
          solver.name,
          std::to_string(series.surface_nodes.size()),
          std::to_string(series.mesh.node_count()),
          format("%.4g", set_up_seconds),
          format("%.4g", seconds),
          format("%.4g", cpu),
          format("%.4g", memory),
          format("%.6g", measure(series, positions).min),
          library,
          ""};
}

}  // namespace

void compare_solvers(const EvaluateOptions& options, const std::string& program) {
  ResultsFile file(options.output, kSolverHeader);
  for (const Subject& subject : chosen_subjects(options)) {
    const Series series = make_series(subject, {Route()}, kSteps);
    std::vector<std::pair<const Solver*, pid_t>> running;
    const auto finish = [&] {
      for (const auto& [solver, child] : running)
        if (!ended_well(child))
          file.append({row_without_figures(subject, series, *solver, "failed")});
      running.clear();
    };
    // netlib's take one thread each: two of them run side by side, the others alone.
    for (const Solver& solver : kSolvers) {
      if (file.has({subject.family, subject.mesh, solver.name})) continue;
      if (const std::string note = why_not(solver, series); !note.empty()) {
        file.append({row_without_figures(subject, series, solver, note)});
        continue;
      }
      const bool is_beside = solver.is_netlib && running.size() == 1 &&
                             2 * needed_memory(solver, series) < physical_memory();
      if (!is_beside) finish();
      options.tell(subject.family + " " + subject.mesh + ": " + solver.name);
      running.emplace_back(&solver, start_child(program, options, subject, solver));
      if (!solver.is_netlib) finish();
    }
    finish();
  }
}

void run_solver(const EvaluateOptions& options, const std::string& name) {
  const Solver& solver = find_solver(name);
  const std::string library = lapack_library();
  if (solver.is_netlib && library.find("openblas") != std::string::npos)
    throw SolverError("the reference LAPACK was not loaded");
  const Subject subject = chosen_subjects(options).front();
  const Series series = make_series(subject, {Route()}, kSteps);
  ResultsFile file(options.output, kSolverHeader);
  try {
    file.append({measured_row(subject, series, solver, library)});
  } catch (const SolverError& error) {
    file.append({row_without_figures(subject, series, solver, field(error.what()))});
  }
}

}  // namespace cadmorph::bench
