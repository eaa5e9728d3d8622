#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/commands/command.h"
#include "apps/commands/options.h"

namespace cadmorph {

/// What the commands of derivatives have in common.
struct DerivativeCommand {
  MorphOptions options;
  std::string json;
  bool is_quiet = false;
  int threads = 0;  ///< 0: all
};

/// What such a command came to.
struct DerivativeOutcome {
  std::vector<std::string> warnings;
  std::string summary, report;
};

/// Adds the common options to `parser`, and has `action` run `work`, with a progress bar, and print
/// what that came to; `check` is called before.
void finish_derivative_command(
    CLI::App& parser, Action& action, const std::shared_ptr<DerivativeCommand>& command,
    std::function<void()> check,
    std::function<DerivativeOutcome(const PipelineOptions& options)> work);

}  // namespace cadmorph
