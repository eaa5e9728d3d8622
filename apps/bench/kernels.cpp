#include "apps/bench/kernels.h"

#include "apps/bench/measure.h"
#include "apps/bench/results_file.h"
#include "apps/summary/text_table.h"
#include "core/errors.h"
#include "volume/volume_morph.h"

namespace cadmorph::bench {
namespace {

using Row = std::vector<std::string>;

const Row kKernelHeader = {"family",
                           "mesh",
                           "kernel",
                           "parameter",
                           "condition",
                           "min_scaled_jacobian",
                           "mean_worst_5_percent",
                           "inverted",
                           "invalid",
                           "seconds",
                           "note"};

// Dense systems above this many centres take more time and memory than the comparison is worth.
constexpr std::size_t kMostCentres = 8000;

/// A kernel, its parameter as the results state it, without a unit.
struct Candidate {
  std::string name;
  double parameter;  ///< epsilon times the mesh's diagonal, or support per diagonal; 0: none
  Kernel kernel;
};

double diagonal(const Mesh& mesh) {
  return (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
}

std::vector<Candidate> candidates(double diagonal) {
  std::vector<Candidate> result = {{"biharmonic r", 0, Kernel::biharmonic_3d()},
                                   {"triharmonic r^3", 0, Kernel::triharmonic_3d()},
                                   {"quadharmonic r^5", 0, Kernel::quadharmonic_3d()}};
  for (const auto& [name, kind] :
       {std::pair("Gaussian", KernelKind::Gaussian),
        std::pair("multiquadric", KernelKind::Multiquadric),
        std::pair("inverse multiquadric", KernelKind::InverseMultiquadric)})
    for (const double epsilon : {3.0, 10.0, 30.0, 100.0})
      result.push_back({name, epsilon, {.kind = kind, .shape = epsilon / diagonal}});
  for (const auto& [name, kind] : {std::pair("Wendland C2", KernelKind::WendlandC2),
                                   std::pair("Wendland C4", KernelKind::WendlandC4)})
    for (const double support : {0.1, 0.25, 0.5, 1.0, 2.0})
      result.push_back({name, support, {.kind = kind, .shape = 1 / (support * diagonal)}});
  return result;
}

Row row_of(const Series& series, const Candidate& candidate) {
  Row row = {series.subject.family, series.subject.mesh, candidate.name,
             format("%g", candidate.parameter)};
  const Stopwatch watch;
  try {
    const VolumeMorph morph(series.mesh, series.surface_nodes,
                            {.kernel = candidate.kernel, .rbf = {.solver = SolverKind::Ldlt}});
    const Points positions = morph.morph(series.path(Route())[kSteps - 1]);
    const Figures figures = measure(series, positions);
    row.insert(row.end(), {format("%.3g", 1 / morph.report().reciprocal_condition),
                           format("%.6g", figures.min), format("%.6g", figures.mean_worst),
                           std::to_string(figures.inverted), std::to_string(figures.invalid),
                           format("%.3g", watch.seconds()), ""});
  } catch (const SolverError& error) {
    row.insert(row.end(),
               {"", "", "", "", "", format("%.3g", watch.seconds()), field(error.what())});
  }
  return row;
}

}  // namespace

void evaluate_kernels(const EvaluateOptions& options) {
  ResultsFile file(options.output, kKernelHeader);
  for (const Subject& subject : chosen_subjects(options)) {
    const Series series = make_series(subject, {Route()}, kSteps);
    if (series.surface_nodes.size() > kMostCentres) continue;
    for (const Candidate& candidate : candidates(diagonal(series.mesh))) {
      const std::string parameter = format("%g", candidate.parameter);
      if (file.has({subject.family, subject.mesh, candidate.name, parameter})) continue;
      file.append({row_of(series, candidate)});
      options.tell(subject.family + " " + subject.mesh + ": " + candidate.name + " " + parameter);
    }
  }
}

}  // namespace cadmorph::bench
