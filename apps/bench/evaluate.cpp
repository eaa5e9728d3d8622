#include "apps/bench/evaluate.h"

#include <memory>
#include <optional>

#include "apps/bench/measure.h"
#include "apps/bench/results_file.h"
#include "apps/text_table.h"
#include "core/errors.h"
#include "volume/baselines/simplex_linear.h"
#include "volume/stepping.h"
#include "volume/untangle.h"

namespace cadmorph::bench {
namespace {

using Row = std::vector<std::string>;

const Row kHeader = {"family",
                     "mesh",
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
                     "set_up_seconds",
                     "seconds",
                     "note"};

VolumeMorphOptions options_of(Contender contender) {
  switch (contender) {
    case Contender::Femwarp:
      return {.method = MorphMethod::Femwarp};
    case Contender::Lbwarp:
      return {.method = MorphMethod::Lbwarp};
    case Contender::SimplexLinear:
      return {.method = MorphMethod::SimplexLinear};
    case Contender::RbfIqr:
    case Contender::RbfS:
    case Contender::Default:
      break;
  }
  return {};
}

/// One method on one mesh of a family, through all steps.
class Run {
 public:
  Run(const Series& series, Contender contender, Mode mode)
      : series_(series), contender_(contender), mode_(mode), mesh_(series.mesh) {}

  std::vector<Row> rows() {
    for (int step = 1; step <= kSteps && note_.empty(); ++step) {
      try {
        take(step);
      } catch (const Error& error) {
        note_ = field(error.what());
        add_row(step, {});
      }
    }
    for (Row& row : rows_) row[kFirstInvertedColumn] = std::to_string(first_inverted_);
    return rows_;
  }

 private:
  static constexpr std::size_t kFirstInvertedColumn = 14;

  void take(int step) {
    set_up_seconds_ = 0;
    if (!morph_ || mode_ == Mode::Relative) {
      const Stopwatch watch;
      morph_.emplace(mesh_, series_.surface_nodes, options_of(contender_));
      set_up_seconds_ = watch.seconds();
    }
    const Stopwatch watch;
    Points positions = move(series_.surface(mode_)[step - 1]);
    seconds_ = watch.seconds();
    const Figures figures = measure(series_, positions);
    if (figures.inverted > 0 && first_inverted_ == 0) first_inverted_ = step;
    add_row(step, figures);
    if (mode_ == Mode::Relative) mesh_.points = std::move(positions);
  }

  // The default method: steps where elements invert, then untangling.
  Points move(const Points& surface) const {
    if (contender_ != Contender::Default) return morph_->morph(surface);
    SteppingResult result = morph_in_steps(mesh_, *morph_, surface, series_.orientation);
    if (result.report.validity.invalid == 0) return std::move(result.positions);
    std::vector<char> is_fixed(mesh_.node_count(), 0);
    for (const Index node : series_.surface_nodes) is_fixed[node] = 1;
    return untangle(mesh_, result.positions, is_fixed, series_.orientation).positions;
  }

  void add_row(int step, const std::optional<Figures>& figures) {
    const auto number = [&](double Figures::*value) {
      return figures ? format("%.6g", (*figures).*value) : "";
    };
    const auto count = [&](Index Figures::*value) {
      return figures ? std::to_string((*figures).*value) : "";
    };
    rows_.push_back(
        {series_.subject.family, series_.subject.mesh, to_string(mode_), to_string(contender_),
         std::to_string(step), format("%g", 100.0 * step / kSteps),
         std::to_string(mesh_.node_count()), std::to_string(series_.surface_nodes.size()),
         std::to_string(mesh_.cell_count()), number(&Figures::min), number(&Figures::mean_worst),
         number(&Figures::mean), count(&Figures::inverted), count(&Figures::invalid), "",
         format("%.4g", set_up_seconds_), format("%.4g", seconds_), note_});
  }

  const Series& series_;
  Contender contender_;
  Mode mode_;
  Mesh mesh_;  // that the next step starts from
  std::optional<VolumeMorph> morph_;
  double set_up_seconds_ = 0, seconds_ = 0;
  int first_inverted_ = 0;
  std::string note_;  // why the series ended
  std::vector<Row> rows_;
};

bool is_chosen(const std::set<std::string>& names, const std::string& name) {
  return names.empty() || names.contains(name);
}

struct Task {
  Contender contender;
  Mode mode;
};

std::vector<Task> open_tasks(const Subject& subject, const EvaluateOptions& options,
                             const ResultsFile& file) {
  std::vector<Task> tasks;
  for (const Mode mode : {Mode::Absolute, Mode::Relative})
    for (const Contender contender : all_contenders())
      if (is_chosen(options.methods, to_string(contender)) &&
          !file.has({subject.family, subject.mesh, to_string(mode), to_string(contender)}))
        tasks.push_back({contender, mode});
  return tasks;
}

}  // namespace

std::string to_string(Contender contender) {
  switch (contender) {
    case Contender::RbfS:
      return "RBF-S";
    case Contender::RbfIqr:
      return "RBF-IQR";
    case Contender::Default:
      return "default";
    case Contender::Femwarp:
      return "FEMWARP";
    case Contender::Lbwarp:
      return "LBWARP";
    case Contender::SimplexLinear:
      return "simplex-linear";
  }
  return {};
}

std::string to_string(Mode mode) { return mode == Mode::Absolute ? "absolute" : "relative"; }

std::vector<Contender> all_contenders() {
  std::vector<Contender> result = {Contender::RbfS, Contender::Default, Contender::Femwarp,
                                   Contender::Lbwarp};
  if (has_simplex_linear()) result.push_back(Contender::SimplexLinear);
  return result;
}

void evaluate(const EvaluateOptions& options) {
  const auto tell = [&](const std::string& text) {
    if (options.tell) options.tell(text);
  };
  ResultsFile file(options.output, kHeader);
  for (const Subject& subject : find_subjects(options.models)) {
    if (!is_chosen(options.families, subject.family) || !is_chosen(options.meshes, subject.mesh))
      continue;
    const std::vector<Task> tasks = open_tasks(subject, options, file);
    if (tasks.empty()) continue;
    const std::string name = subject.family + " " + subject.mesh;
    tell(name + ": surface at all steps");
    const Series series = make_series(subject);
    for (const Task& task : tasks) {
      const Stopwatch watch;
      file.append(Run(series, task.contender, task.mode).rows());
      tell(name + " " + to_string(task.mode) + " " + to_string(task.contender) +
           format(": %.1f s", watch.seconds()));
    }
  }
}

}  // namespace cadmorph::bench
