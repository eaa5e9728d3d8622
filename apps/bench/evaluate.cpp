#include "apps/bench/evaluate.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "apps/bench/measure.h"
#include "apps/bench/rbf_warps.h"
#include "apps/bench/results_file.h"
#include "apps/pipeline/morph_job.h"
#include "apps/summary/text_table.h"
#include "core/errors.h"
#include "volume/baselines/simplex_linear.h"
#include "volume/wall_rows.h"

namespace cadmorph::bench {
namespace {

using Row = std::vector<std::string>;

const Row kEvaluationHeader = {"family",
                               "mesh",
                               "surface",
                               "mode",
                               "method",
                               "step",
                               "change_percent",
                               "nodes",
                               "surface_nodes",
                               "cells",
                               "min_scaled_jacobian",
                               "mean_worst_5_percent",
                               "mean_scaled_jacobian",
                               "inverted",
                               "invalid",
                               "first_inverted_step",
                               "worst_row_deviation",
                               "largest_row_deviation",
                               "set_up_seconds",
                               "seconds",
                               "cpu_seconds",
                               "note"};

// Error of RBF-IQR at the surface nodes, root mean square, in local edge lengths:
// shapes of cells change by as little.
constexpr double kIqrTolerance = 1e-2;

VolumeMorphOptions options_of(Contender contender) {
  switch (contender) {
    case Contender::Femwarp:
      return {.method = MorphMethod::Femwarp};
    case Contender::Lbwarp:
      return {.method = MorphMethod::Lbwarp};
    case Contender::SimplexLinear:
      return {.method = MorphMethod::SimplexLinear};
    case Contender::RbfIqr:
      return {.rbf = {.solver = SolverKind::Iqr,
                      .tolerance = kIqrTolerance,
                      .memory_limit = physical_memory()}};
    case Contender::Biharmonic:
      return {.kernel = Kernel::biharmonic_3d()};
    case Contender::Quadharmonic:
      return {.kernel = Kernel::quadharmonic_3d()};
    case Contender::Rbf:
    case Contender::Plain:
    case Contender::Default:
      break;
  }
  return {};
}

/// What is compared: the methods of the paper on the surface given to all, then all on RBF-S's.
struct Task {
  Route route;
  Contender contender;
};

/// One method on one mesh of a family, through all steps.
class Run {
 public:
  Run(const Series& series, RbfWarps& warps, const Task& task, const EvaluateOptions& options)
      : series_(series),
        warps_(warps),
        task_(task),
        options_(options),
        mesh_(series.mesh),
        wall_rows_(
            find_wall_rows(series.mesh, find_cell_neighbours(series.mesh), series.mesh.points)) {}

  std::vector<Row> rows() {
    const int stride = is_relative() ? 1 : options_.stride;
    for (int step = stride; step <= options_.last && note_.empty(); step += stride) {
      try {
        take(step);
      } catch (const Error& error) {
        note_ = field(error.what());
        add_row(step, {}, {});
      }
    }
    for (Row& row : rows_) row[kFirstInvertedColumn] = std::to_string(first_inverted_);
    return rows_;
  }

 private:
  static constexpr std::size_t kFirstInvertedColumn = 15;

  bool is_relative() const { return task_.route.mode == Mode::Relative; }

  void take(int step) {
    if (is_relative() && task_.contender == Contender::Default) {
      take_default_on_the_way(step);
      return;
    }
    Warped moved = move(step);
    add_measured_row(step, moved);
    if (is_relative()) mesh_.points = std::move(moved.positions);
  }

  // In a series the last mesh alone is raised: of each step asked for, that of a series up to it.
  void take_default_on_the_way(int step) {
    Points plain = move_by_pipeline(step, QualityMode::Fast).positions;
    if (step % options_.stride == 0)
      add_measured_row(step, move_by_pipeline(step, QualityMode::Best));
    mesh_.points = std::move(plain);
  }

  void add_measured_row(int step, const Warped& moved) {
    const Figures figures = measure(series_, moved.positions);
    if (figures.inverted > 0 && first_inverted_ == 0) first_inverted_ = step;
    add_row(step, figures, moved);
  }

  Warped move(int step) {
    switch (task_.contender) {
      case Contender::Rbf:
        return warps_.at(task_.route, step);
      case Contender::Plain:
        return move_by_pipeline(step, QualityMode::Fast);
      case Contender::Default:
        return move_by_pipeline(step, QualityMode::Best);
      default:
        return move_by_method(step);
    }
  }

  Warped move_by_method(int step) {
    Warped result;
    const Stopwatch whole;
    if (!morph_ || is_relative()) {
      morph_.emplace(mesh_, series_.surface_nodes, options_of(task_.contender));
      result.set_up_seconds = whole.seconds();
    }
    const Stopwatch watch;
    result.positions = morph_->morph(series_.path(task_.route)[step - 1]);
    result.seconds = watch.seconds();
    result.cpu_seconds = whole.cpu();
    return result;
  }

  Warped move_by_pipeline(int step, QualityMode quality) {
    const Stopwatch again;
    PipelineOptions options;
    options.quality = quality;
    const MorphJob job(series_.cads[is_relative() ? step - 1 : 0], series_.mesh_file, options,
                       is_relative() ? mesh_.points : Points());
    Warped result{.set_up_seconds = again.seconds()};
    result.positions = job.morph(*series_.cads[step]).positions;
    result.seconds = again.seconds() - result.set_up_seconds;
    result.cpu_seconds = again.cpu();
    return result;
  }

  void add_row(int step, const std::optional<Figures>& figures, const Warped& moved) {
    std::vector<double> kept;  // of each row, so that the smallest are the worst
    for (const NodeRow& row : wall_rows_)
      if (figures) kept.push_back(-deviation(row, series_.mesh.points, moved.positions));
    const auto deviation_of = [&](double value) {
      return kept.empty() ? "" : format("%.4g", std::abs(value));
    };
    const auto number = [&](double Figures::*value) {
      return figures ? format("%.6g", (*figures).*value) : "";
    };
    const auto count = [&](Index Figures::*value) {
      return figures ? std::to_string((*figures).*value) : "";
    };
    rows_.push_back({series_.subject.family,
                     series_.subject.mesh,
                     to_string(task_.route.surface),
                     to_string(task_.route.mode),
                     to_string(task_.contender, task_.route.surface),
                     std::to_string(step),
                     format("%g", 100.0 * step / kSteps),
                     std::to_string(mesh_.node_count()),
                     std::to_string(series_.surface_nodes.size()),
                     std::to_string(mesh_.cell_count()),
                     number(&Figures::min),
                     number(&Figures::mean_worst),
                     number(&Figures::mean),
                     count(&Figures::inverted),
                     count(&Figures::invalid),
                     "",
                     deviation_of(mean_of_worst(kept)),
                     deviation_of(kept.empty() ? 0 : std::ranges::min(kept)),
                     format("%.4g", moved.set_up_seconds),
                     format("%.4g", moved.seconds),
                     format("%.4g", moved.cpu_seconds),
                     note_});
  }

  const Series& series_;
  RbfWarps& warps_;
  Task task_;
  const EvaluateOptions& options_;
  Mesh mesh_;  // that the next step starts from
  std::vector<NodeRow> wall_rows_;
  std::optional<VolumeMorph> morph_;
  int first_inverted_ = 0;
  std::string note_;  // why the series ended
  std::vector<Row> rows_;
};

bool is_chosen(const std::set<std::string>& names, const std::string& name) {
  return names.empty() || names.contains(name);
}

std::vector<Contender> contenders(Surface surface) {
  std::vector<Contender> result = {Contender::Rbf};
  if (surface == Surface::RbfS)
    result.insert(result.end(), {Contender::RbfIqr, Contender::Plain, Contender::Default,
                                 Contender::Biharmonic, Contender::Quadharmonic});
  result.insert(result.end(), {Contender::Femwarp, Contender::Lbwarp});
  if (has_simplex_linear()) result.push_back(Contender::SimplexLinear);
  return result;
}

std::vector<Task> open_tasks(const Subject& subject, const EvaluateOptions& options,
                             const ResultsFile& file) {
  std::vector<Task> tasks;
  for (const Surface surface : {Surface::RbfS, Surface::Harmonic})
    for (const Mode mode : {Mode::Absolute, Mode::Relative})
      for (const Contender contender : contenders(surface)) {
        const std::string method = to_string(contender, surface);
        if (is_chosen(options.methods, method) && is_chosen(options.modes, to_string(mode)) &&
            is_chosen(options.surfaces, to_string(surface)) &&
            !file.has({subject.family, subject.mesh, to_string(surface), to_string(mode), method}))
          tasks.push_back({{surface, mode}, contender});
      }
  return tasks;
}

std::set<Route> routes_of(const std::vector<Task>& tasks) {
  std::set<Route> routes;
  for (const Task& task : tasks) routes.insert(task.route);
  return routes;
}

}  // namespace

std::string to_string(Contender contender, Surface surface) {
  switch (contender) {
    case Contender::Rbf:
      return surface == Surface::RbfS ? "RBF-S" : "RBF";
    case Contender::RbfIqr:
      return "RBF-IQR";
    case Contender::Biharmonic:
      return "biharmonic";
    case Contender::Quadharmonic:
      return "quadharmonic";
    case Contender::Plain:
      return "plain";
    case Contender::Default:
      return "default";
    case Contender::Femwarp:
      return to_string(MorphMethod::Femwarp);
    case Contender::Lbwarp:
      return to_string(MorphMethod::Lbwarp);
    case Contender::SimplexLinear:
      return to_string(MorphMethod::SimplexLinear);
  }
  return {};
}

std::string to_string(Surface surface) { return surface == Surface::RbfS ? "RBF-S" : "harmonic"; }

std::string to_string(Mode mode) { return mode == Mode::Absolute ? "absolute" : "relative"; }

std::vector<Subject> chosen_subjects(const EvaluateOptions& options) {
  std::vector<Subject> result = find_subjects(options.models);
  std::erase_if(result, [&](const Subject& subject) {
    return !is_chosen(options.families, subject.family) || !is_chosen(options.meshes, subject.mesh);
  });
  if (result.empty())
    throw IoError(options.models.string() + " holds none of the families and meshes asked for");
  return result;
}

void evaluate(const EvaluateOptions& options) {
  ResultsFile file(options.output, kEvaluationHeader);
  for (const Subject& subject : chosen_subjects(options)) {
    const std::vector<Task> tasks = open_tasks(subject, options, file);
    if (tasks.empty()) continue;
    const std::string name = subject.family + " " + subject.mesh;
    options.tell(name + ": surface at all steps");
    const Series series = make_series(subject, routes_of(tasks), options.stride, options.last);
    RbfWarps warps(series);
    for (const Task& task : tasks) {
      const Stopwatch watch;
      file.append(Run(series, warps, task, options).rows());
      options.tell(name + ": " + to_string(task.contender, task.route.surface) + ", " +
                   to_string(task.route.mode) + ", surface " + to_string(task.route.surface) +
                   format(": %.1f s", watch.seconds()));
    }
  }
}

}  // namespace cadmorph::bench
