#include "apps/commands/derivative_command.h"

#include <CLI/CLI.hpp>
#include <utility>

#include "apps/summary/progress_bar.h"
#include "core/parallel.h"

namespace cadmorph {

void finish_derivative_command(
    CLI::App& parser, Action& action, const std::shared_ptr<DerivativeCommand>& command,
    std::function<void()> check,
    std::function<DerivativeOutcome(const PipelineOptions& options)> work) {
  add_json_option(parser, command->json);
  parser.add_flag("--quiet", command->is_quiet, "print errors only");
  add_threads_option(parser, command->threads);
  add_derivative_options(parser, command->options);
  parser.callback([&action, command, check = std::move(check), work = std::move(work)] {
    action.json = command->json;
    check_linear(command->options);
    check();
    action.run = [command, work, options = resolve(command->options)]() mutable {
      set_thread_count(command->threads);
      ProgressBar bar(!command->is_quiet);
      options.progress = [&](std::string_view phase, double fraction) {
        bar.show(phase, fraction);
      };
      const DerivativeOutcome outcome = work(options);
      bar.erase();
      if (!command->is_quiet) warn(outcome.warnings);
      hand_over(command->json, command->is_quiet, outcome.summary, outcome.report);
      return ExitCode::Done;
    };
  });
}

}  // namespace cadmorph
