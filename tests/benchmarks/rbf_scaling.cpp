// Prints tables of the RBF solvers' speed and accuracy; see rbf_scaling --help.

#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "core/blas.h"
#include "core/boundary.h"
#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/mesh_file.h"
#include "core/parallel.h"
#include "core/rbf/kernel_sum.h"
#include "core/rbf/rbf_system.h"
#include "rbf_sets.h"

using namespace cadmorph;
using test::RbfSet;

namespace {

const Kernel kTriharmonic = Kernel::triharmonic_3d();

using MakeSet = RbfSet (*)(Index surface_nodes, Index volume_nodes);

struct NamedSet {
  std::string name;
  MakeSet make;
};

const std::vector<NamedSet> kSets = {
    {"hole", test::turning_hole}, {"sphere", test::sphere_in_box}, {"wing", test::graded_wing}};

struct Arguments {
  Index max_nodes = 100000;
  std::vector<std::string> tables, sets;
  std::vector<std::pair<std::string, std::string>> morphs;

  bool has_set(const std::string& name) const {
    return sets.empty() || std::count(sets.begin(), sets.end(), name) > 0;
  }
};

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double cpu_seconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

// Of this process since reset_peak, by Linux.
double peak_gib() {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line))
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1048576;
  return 0;
}

void reset_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

// Wall and processor seconds since construction.
class Clock {
 public:
  double wall() const { return wall_seconds() - wall_; }
  double cpu() const { return cpu_seconds() - cpu_; }

 private:
  double wall_ = wall_seconds(), cpu_ = cpu_seconds();
};

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  std::string line;
  while (std::getline(file, line))
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

RbfOptions with(SolverKind solver) {
  RbfOptions options;
  options.solver = solver;
  return options;
}

// Differences at volume points over the local edge: the spacing of the nearest surface node, or the
// distance to it where that is larger. Ascending.
std::vector<double> in_local_edges(const RbfSet& set, const RowMatrix& a, const RowMatrix& b) {
  const KdTree tree(set.surface);
  std::vector<double> result;
  for (Index i = 0; i < set.volume.rows(); ++i) {
    const Neighbour nearest = tree.nearest(set.volume.row(i).data(), 1).front();
    const double spacing =
        tree.nearest(set.surface.row(nearest.index).data(), 2)[1].squared_distance;
    result.push_back((a.row(i) - b.row(i)).norm() /
                     std::sqrt(std::max(spacing, nearest.squared_distance)));
  }
  std::sort(result.begin(), result.end());
  return result;
}

void print_rate(const Arguments&) {
  constexpr Index kPoints = 8000;
  std::printf("\nkernel sums, thousand million pairs a second on one core\n");
  std::printf("%-10s %-12s %8s %8s %8s\n", "kernel", "set", "M = 1", "3", "12");
  set_thread_count(1);
  const std::pair<const char*, Kernel> kernels[] = {{"r^3", kTriharmonic},
                                                    {"r^2 log r", Kernel::biharmonic_2d()}};
  for (const auto& [kernel_name, kernel] : kernels)
    for (const InstructionSet set :
         {InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512}) {
      if (set > simd::best()) continue;
      std::printf("%-10s %-12s", kernel_name, name(set));
      for (const Index columns : {1, 3, 12}) {
        const Eigen::MatrixXd x = Eigen::MatrixXd::Random(kPoints, kernel.dimension);
        const Eigen::MatrixXd w = Eigen::MatrixXd::Random(kPoints, columns);
        const KernelSum sum(kernel, 0, set);
        double best = 1e300;
        for (int repeat = 0; repeat < 3; ++repeat) {
          const Clock clock;
          sum(x, x, w);
          best = std::min(best, clock.cpu());
        }
        std::printf(" %8.2f", 1e-9 * kPoints * kPoints / best);
      }
      std::printf("\n");
    }
  set_thread_count(0);
}

struct Timed {
  double wall = 0;
  double cpu = 0;
  RbfReport report;
  RowMatrix values;
};

Timed solve(const RbfSet& set, SolverKind solver) {
  const Clock clock;
  RbfOptions options = with(solver);
  options.memory_limit = 1.6e10;
  const RbfField field = RbfSystem(set.surface, kTriharmonic, options).solve(set.displacement);
  return {clock.wall(), clock.cpu(), field.report(), field.evaluate(set.volume)};
}

void print_dense_row(const RbfSet& set, bool has_all) {
  std::printf("%-14s %7ld", set.name.c_str(), static_cast<long>(set.surface.rows()));
  // Steep grading may be beyond a dense solver: then the next one is the reference.
  Timed exact;
  double best = 1e300;
  for (const SolverKind solver : {SolverKind::Cholesky, SolverKind::Lu, SolverKind::Ldlt}) {
    if (exact.wall > 0 && !has_all) {
      std::printf(" %15s", "");
      continue;
    }
    try {
      Timed timed = solve(set, solver);
      best = std::min(best, timed.wall);
      std::printf(" %6.2f (%6.2f)", timed.wall, timed.cpu);
      if (exact.wall == 0) exact = std::move(timed);
    } catch (const SolverError&) {
      std::printf(" %15s", "refused");
    }
  }
  const Timed fast = solve(set, SolverKind::Fast);
  std::printf(" %6.2f (%6.2f) %6d", fast.wall, fast.cpu, fast.report.iterations);
  if (exact.wall > 0) {
    const auto difference = in_local_edges(set, exact.values, fast.values);
    std::printf(" %6.1f %9.1e %9.1e", best / fast.wall, difference.back(),
                difference[difference.size() * 99 / 100]);
  }
  std::printf("\n");
  std::fflush(stdout);
}

void print_dense(const Arguments& arguments) {
  std::printf("\ndense and fast solvers, set-up and solution in seconds (processor seconds)\n");
  std::printf("%-14s %7s %15s %15s %15s %15s %6s %6s %9s %9s\n", "set", "m", "Cholesky", "LU",
              "LDL^T", "fast", "iter.", "ratio", "max diff", "99 %");
  for (const Index nodes : {2000, 5000, 10000, 20000})
    for (const NamedSet& set : kSets)
      if (nodes <= arguments.max_nodes && arguments.has_set(set.name))
        print_dense_row(set.make(nodes, 20000), set.name == "hole" && nodes <= 10000);
}

void print_crossover(const Arguments&) {
  std::printf("\nwhere the fast solver overtakes Cholesky, seconds\n%7s %9s %9s\n", "m", "Cholesky",
              "fast");
  for (const Index nodes : {500, 1000, 1500, 2000, 3000, 4000, 6000}) {
    const RbfSet set = test::turning_hole(nodes, 0);
    double best[2] = {1e300, 1e300};
    for (int repeat = 0; repeat < 3; ++repeat) {
      best[0] = std::min(best[0], solve(set, SolverKind::Cholesky).wall);
      best[1] = std::min(best[1], solve(set, SolverKind::Fast).wall);
    }
    std::printf("%7ld %9.3f %9.3f\n", static_cast<long>(set.surface.rows()), best[0], best[1]);
  }
}

void print_scaling_row(const RbfSet& set, SolverKind solver) {
  reset_peak();
  const Clock start;
  const RbfSystem system(set.surface, kTriharmonic, with(solver));
  const Clock setup_end;
  const double setup[2] = {start.wall(), start.cpu()};
  const RbfField field = system.solve(set.displacement);
  const double solved[2] = {setup_end.wall(), setup_end.cpu()};
  const Clock evaluation;
  field.evaluate(set.volume);
  std::printf(
      "%-14s %-8s %8ld %9ld %6.2f (%6.2f) %6.2f (%6.2f) %6.2f (%6.2f) %6.2f (%6.2f) %6d %9.1e "
      "%6.2f\n",
      set.name.c_str(), solver == SolverKind::Fast ? "full" : "adaptive",
      static_cast<long>(set.surface.rows()), static_cast<long>(set.volume.rows()), setup[0],
      setup[1], solved[0], solved[1], evaluation.wall(), evaluation.cpu(), start.wall(),
      start.cpu(), field.report().iterations, field.report().max_residual, peak_gib());
  std::fflush(stdout);
}

void print_scaling_rows(const RbfSet& set) {
  for (const SolverKind solver : {SolverKind::Adaptive, SolverKind::Fast})
    print_scaling_row(set, solver);
}

// The boundary nodes of a mesh and where a morph has moved them; its other nodes.
RbfSet real_morph(const std::string& base, const std::string& morphed) {
  const MeshFile before = MeshFile(base), after = MeshFile(morphed);
  const Points &from = before.mesh().points, &to = after.mesh().points;
  if (from.rows() != to.rows())
    throw InvalidInputError(base + " and " + morphed + " have different numbers of nodes");
  const std::vector<Index> surface = extract_boundary(before.mesh()).nodes;
  std::vector<char> is_surface(from.rows(), 0);
  RbfSet set{std::filesystem::path(base).parent_path().filename().string(),
             RowMatrix(surface.size(), 3), RowMatrix(surface.size(), 3),
             RowMatrix(from.rows() - static_cast<Index>(surface.size()), 3)};
  for (std::size_t i = 0; i < surface.size(); ++i) {
    is_surface[surface[i]] = 1;
    set.surface.row(i) = from.row(surface[i]);
    set.displacement.row(i) = to.row(surface[i]) - from.row(surface[i]);
  }
  Index row = 0;
  for (Index n = 0; n < from.rows(); ++n)
    if (!is_surface[n]) set.volume.row(row++) = from.row(n);
  return set;
}

void print_scaling(const Arguments& arguments) {
  std::printf(
      "\nadaptive centres and the full interpolation by the fast solver, ten volume points a "
      "surface node; seconds (processor seconds); centres or iterations\n");
  std::printf("%-14s %-8s %8s %9s %15s %15s %15s %15s %6s %9s %6s\n", "set", "map", "m", "n",
              "set-up", "solve", "evaluate", "total", "iter.", "residual", "GiB");
  for (const Index nodes : {5000, 20000, 50000, 100000, 200000, 1000000})
    for (const NamedSet& set : kSets) {
      const bool is_asked = !arguments.sets.empty() || nodes <= 100000 || set.name == "hole";
      if (nodes <= arguments.max_nodes && arguments.has_set(set.name) && is_asked)
        print_scaling_rows(set.make(nodes, 10 * nodes));
    }
  for (const auto& [base, morphed] : arguments.morphs)
    print_scaling_rows(real_morph(base, morphed));
}

std::vector<RbfField> fields_of(std::vector<RbfSolution> solutions) {
  std::vector<RbfField> fields;
  for (RbfSolution& solution : solutions) {
    if (solution.error) std::rethrow_exception(solution.error);
    fields.push_back(std::move(solution.field));
  }
  return fields;
}

void print_variants(const Arguments& arguments) {
  const Index nodes = std::min<Index>(arguments.max_nodes, 100000);
  const RbfSet set = test::turning_hole(nodes, 10 * nodes);
  std::vector<RowMatrix> block;
  for (int v = 0; v < 4; ++v) block.push_back(set.displacement.array() * (0.25 + 0.25 * v));
  const Clock first;
  const RbfSystem system(set.surface, kTriharmonic, with(SolverKind::Fast));
  const RbfTargets targets(system, set.volume);
  targets.evaluate({system.solve(set.displacement)});
  const double first_wall = first.wall(), first_cpu = first.cpu();
  const Clock further;
  const RbfField field = system.solve(set.displacement);
  const double solve_cpu = further.cpu();
  targets.evaluate({field});
  const double further_wall = further.wall(), further_cpu = further.cpu();
  const Clock four;
  targets.evaluate(fields_of(system.solve_each(block)));
  const double four_wall = four.wall() / 4, four_cpu = four.cpu() / 4;
  std::printf(
      "\nvariants on one base mesh, m = %ld, n = %ld: seconds (processor seconds) a variant\n",
      static_cast<long>(set.surface.rows()), static_cast<long>(10 * nodes));
  std::printf("first %.2f (%.2f); further %.2f (%.2f, solve %.2f), of the first %.2f (%.2f); ",
              first_wall, first_cpu, further_wall, further_cpu, solve_cpu,
              further_wall / first_wall, further_cpu / first_cpu);
  std::printf("in a block of four %.2f (%.2f), of the first %.2f (%.2f)\n", four_wall, four_cpu,
              four_wall / first_wall, four_cpu / first_cpu);
}

void print_thin(const Arguments& arguments) {
  const Index nodes = std::min<Index>(arguments.max_nodes, 16000);
  std::printf("\nthin sheets, m about %ld: iterations by gap over node spacing\n",
              static_cast<long>(nodes));
  std::printf("%-18s %10s %10s %10s %10s\n", "set", "0.2", "0.05", "0.02", "0.005");
  for (const test::SheetShape shape : {test::SheetShape::Plate, test::SheetShape::Tube})
    for (const bool is_matched : {true, false}) {
      std::string row;
      for (const double gap : {0.2, 0.05, 0.02, 0.005}) {
        const RbfSet set = test::thin_sheets(shape, nodes, gap, is_matched);
        if (row.empty()) std::printf("%-18s", set.name.c_str());
        const RbfReport report = RbfSystem(set.surface, kTriharmonic, with(SolverKind::Fast))
                                     .solve(set.displacement)
                                     .report();
        row = report.solver == SolverKind::Fast ? std::to_string(report.iterations) : "dense";
        std::printf(" %10s", row.c_str());
        std::fflush(stdout);
      }
      std::printf("\n");
    }
}

using Table = void (*)(const Arguments&);
const std::vector<std::pair<std::string, Table>> kTables = {
    {"rate", print_rate},       {"dense", print_dense},       {"crossover", print_crossover},
    {"scaling", print_scaling}, {"variants", print_variants}, {"thin", print_thin}};

}  // namespace

int main(int argc, char** argv) {
  use_fitting_blas_kernel();
  Arguments arguments;
  CLI::App app("Prints tables of the RBF solvers' speed and accuracy.", "rbf_scaling");
  std::vector<std::string> names, set_names;
  for (const auto& table : kTables) names.push_back(table.first);
  for (const NamedSet& set : kSets) set_names.push_back(set.name);
  app.add_option("TABLE", arguments.tables, "tables to print; all by default")
      ->check(CLI::IsMember(names));
  app.add_option("--nodes", arguments.max_nodes, "most surface nodes")->capture_default_str();
  app.add_option("--set", arguments.sets, "sets of nodes; all by default")
      ->check(CLI::IsMember(set_names));
  app.add_option("--morph", arguments.morphs,
                 "also the scaling of a real morph: two meshes with the same cells");
  InstructionSet most = simd::best();
  app.add_option("--instructions", most, "most that the inner loops may use")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, InstructionSet>{{"avx512", InstructionSet::Avx512},
                                                {"avx2", InstructionSet::Avx2},
                                                {"baseline", InstructionSet::Baseline}}));
  CLI11_PARSE(app, argc, argv);
  simd::limit_to(most);
  const std::string kernel = blas_kernel();
  std::printf("%s, %d threads, %s, BLAS kernel %s\n", processor().c_str(), thread_count(),
              name(simd::best()), kernel.empty() ? "unknown" : kernel.c_str());
  try {
    for (const auto& [table, print] : kTables)
      if (arguments.tables.empty() ||
          std::count(arguments.tables.begin(), arguments.tables.end(), table))
        print(arguments);
  } catch (const Error& error) {
    std::fprintf(stderr, "rbf_scaling: %s\n", error.what());
    return 6;
  }
}
