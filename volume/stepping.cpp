#include "volume/stepping.h"

#include <algorithm>
#include <optional>

#include "core/errors.h"
#include "core/stopwatch.h"
#include "volume/held_cells.h"

namespace cadmorph {
namespace {

void check_options(const SteppingOptions& options) {
  if (options.steps < 0 || options.min_steps < 1 || options.max_steps < options.min_steps)
    throw InvalidInputError("the number of steps must be at least 1");
}

SurfacePath linear_path(const Mesh& mesh, const std::vector<Index>& nodes, const Points& target) {
  Points start(nodes.size(), 3);
  for (std::size_t i = 0; i < nodes.size(); ++i) start.row(i) = mesh.points.row(nodes[i]);
  return [start = std::move(start), &target](double s) -> Points {
    return start + s * (target - start);
  };
}

class Stepper {
 public:
  Stepper(const Mesh& mesh, const VolumeMorph& first, const SurfaceMotion& motion,
          VolumeMorphResult* one_step = nullptr)
      : mesh_(mesh),
        first_(first),
        target_(motion.target),
        path_(motion.path ? motion.path : linear_path(mesh, first.surface_nodes(), motion.target)),
        one_step_(one_step) {}

  Points run(int steps, RbfReport& rbf) {
    if (steps == 1 && one_step_) return take_one_step(rbf);
    Points positions = first_.morph(at(1, steps), &rbf);
    if (steps == 1) return positions;
    Mesh moved = mesh_;
    for (int step = 2; step <= steps; ++step) {
      moved.points = std::move(positions);
      const Stopwatch watch;
      const VolumeMorph morph(moved, first_.surface_nodes(), first_.options());
      seconds_set_up_ += watch.seconds();
      positions = morph.morph(at(step, steps), &rbf);
    }
    return positions;
  }

  std::vector<std::vector<RbfField>> fields(int steps) const {
    std::vector<std::vector<RbfField>> result{first_.fields(at(1, steps))};
    Mesh moved = mesh_;
    if (steps > 1) moved.points = first_.morph(at(1, steps));
    for (int step = 2; step <= steps; ++step) {
      const VolumeMorph morph(moved, first_.surface_nodes(), first_.options());
      result.push_back(morph.fields(at(step, steps)));
      if (step < steps) moved.points = morph.morph(at(step, steps));
    }
    return result;
  }

  double seconds_set_up() const { return seconds_set_up_; }

 private:
  Points take_one_step(RbfReport& rbf) {
    if (one_step_->error) std::rethrow_exception(one_step_->error);
    rbf = one_step_->report;
    return std::move(one_step_->positions);
  }

  Points at(int step, int steps) const {
    return step == steps ? target_ : path_(static_cast<double>(step) / steps);
  }

  const Mesh& mesh_;
  const VolumeMorph& first_;
  const Points& target_;
  SurfacePath path_;
  VolumeMorphResult* one_step_;
  double seconds_set_up_ = 0;
};

std::vector<char> marks(Index count, const std::vector<Index>& nodes) {
  std::vector<char> is_marked(count, 0);
  for (const Index node : nodes) is_marked[node] = 1;
  return is_marked;
}

// Counts the cells that no number of steps helps.
class HeldCounter {
 public:
  HeldCounter(const Mesh& mesh, const std::vector<Index>& surface_nodes,
              const Orientation& orientation)
      : mesh_(mesh),
        orientation_(orientation),
        is_fixed_(marks(mesh.node_count(), surface_nodes)) {}

  Index count(const Points& positions, const std::vector<Index>& invalid) {
    if (invalid.empty()) return 0;
    if (!in_base_) in_base_ = check_validity(mesh_, mesh_.points, orientation_).invalid_cells;
    return std::ranges::count_if(invalid, [&](Index c) {
      return std::ranges::binary_search(*in_base_, c) ||
             is_held(mesh_, positions, is_fixed_, orientation_, c);
    });
  }

 private:
  const Mesh& mesh_;
  const Orientation& orientation_;
  std::vector<char> is_fixed_;
  std::optional<std::vector<Index>> in_base_;
};

// Whether the attempts end here: what is left is little, or one more step gained little.
bool is_last(const SteppingOptions& options, const std::vector<SteppingAttempt>& attempts) {
  const auto mendable = [](const SteppingAttempt& a) { return a.inverted - a.held; };
  const Index now = mendable(attempts.back());
  if (now <= options.few) return true;
  if (attempts.size() == 1 || options.least_gain_share >= 1) return false;
  Index least = mendable(attempts.front());
  for (std::size_t i = 1; i + 1 < attempts.size(); ++i)
    least = std::min(least, mendable(attempts[i]));
  return static_cast<double>(now) > options.least_gain_share * static_cast<double>(least);
}

}  // namespace

SteppingResult morph_in_steps(const Mesh& mesh, const VolumeMorph& first,
                              const SurfaceMotion& motion, const Orientation& orientation,
                              const SteppingOptions& options, VolumeMorphResult* one_step) {
  check_options(options);
  Stepper stepper(mesh, first, motion, one_step);
  const int fewest = options.steps > 0 ? options.steps : options.min_steps;
  const int most = options.steps > 0 ? options.steps : options.max_steps;
  HeldCounter held(mesh, first.surface_nodes(), orientation);
  SteppingResult best;
  SteppingReport& report = best.report;
  for (int steps = fewest; steps <= most; ++steps) {
    RbfReport rbf;
    Points positions;
    try {
      positions = stepper.run(steps, rbf);
    } catch (const Error&) {  // nodes that meet on the way: what was found before counts
      if (steps == fewest) throw;
      break;
    }
    ValidityReport validity = check_validity(mesh, positions, orientation);
    const Index inverted = validity.invalid;
    report.attempts.push_back({steps, inverted, held.count(positions, validity.invalid_cells)});
    if (report.attempts.size() == 1 || inverted < report.validity.invalid) {
      best.positions = std::move(positions);
      report.steps = steps;
      report.validity = std::move(validity);
      report.rbf = std::move(rbf);
    }
    if (is_last(options, report.attempts)) break;
  }
  report.seconds_set_up = stepper.seconds_set_up();
  return best;
}

std::vector<std::vector<RbfField>> fields_of_steps(const Mesh& mesh, const VolumeMorph& first,
                                                   const SurfaceMotion& motion, int steps) {
  check_options({.steps = steps});
  return Stepper(mesh, first, motion).fields(std::max(steps, 1));
}

}  // namespace cadmorph
