#include "apps/bench/rbf_warps.h"

#include <algorithm>
#include <utility>

#include "apps/bench/measure.h"
#include "core/errors.h"

namespace cadmorph::bench {
namespace {

// Steps whose warps share the evaluations of the kernel, which then are a quarter each; memory
// grows with them.
constexpr std::size_t kBlock = 4;

// With all surface nodes as centres, as the paper has it.
VolumeMorphOptions full_interpolation() { return {.rbf = {.solver = SolverKind::Fast}}; }

}  // namespace

const Warped& RbfWarps::at(const Route& route, int step) {
  auto found = outcomes_.find(route);
  if (found == outcomes_.end()) {
    const Path& path = series_.path(route);
    found = outcomes_
                .emplace(route, route.mode == Mode::Absolute ? warp_absolutely(path)
                                                             : warp_relatively(path))
                .first;
  }
  const Outcome& outcome = found->second[step - 1];
  if (outcome.error) std::rethrow_exception(outcome.error);
  return outcome.warped;
}

std::vector<RbfWarps::Outcome> RbfWarps::warp_absolutely(const Path& path) const {
  std::vector<Outcome> outcomes(path.size());
  std::vector<std::size_t> steps;
  for (std::size_t step = 0; step < path.size(); ++step)
    if (path[step].rows() > 0) steps.push_back(step);
  const Stopwatch set_up;
  const VolumeMorph morph(series_.mesh, series_.surface_nodes, full_interpolation());
  outcomes[steps.front()].warped = {.set_up_seconds = set_up.seconds(),
                                    .cpu_seconds = set_up.cpu()};
  for (std::size_t begin = 0; begin < steps.size(); begin += kBlock) {
    const std::size_t count = std::min(kBlock, steps.size() - begin);
    std::vector<Points> targets;
    for (std::size_t i = 0; i < count; ++i) targets.push_back(path[steps[begin + i]]);
    const Stopwatch watch;
    std::vector<VolumeMorphResult> results = morph.morph_each(targets);
    const double seconds = watch.seconds() / static_cast<double>(count);
    const double cpu = watch.cpu() / static_cast<double>(count);
    for (std::size_t i = 0; i < count; ++i) {
      Outcome& outcome = outcomes[steps[begin + i]];
      outcome.error = results[i].error;
      outcome.warped.positions = std::move(results[i].positions);
      outcome.warped.seconds = seconds;
      outcome.warped.cpu_seconds += cpu;
    }
  }
  return outcomes;
}

std::vector<RbfWarps::Outcome> RbfWarps::warp_relatively(const Path& path) const {
  std::vector<Outcome> outcomes(path.size());
  Mesh mesh = series_.mesh;
  for (std::size_t step = 0; step < path.size(); ++step) {
    Warped& warped = outcomes[step].warped;
    try {
      const Stopwatch watch;
      const VolumeMorph morph(mesh, series_.surface_nodes, full_interpolation());
      warped.set_up_seconds = watch.seconds();
      warped.positions = morph.morph(path[step]);
      warped.seconds = watch.seconds() - warped.set_up_seconds;
      warped.cpu_seconds = watch.cpu();
    } catch (const Error&) {
      for (std::size_t later = step; later < path.size(); ++later)
        outcomes[later].error = std::current_exception();
      break;
    }
    mesh.points = warped.positions;
  }
  return outcomes;
}

}  // namespace cadmorph::bench
