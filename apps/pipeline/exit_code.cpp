#include "apps/pipeline/exit_code.h"

#include "apps/pipeline/output_file.h"

namespace cadmorph {
namespace {

template <class Type>
bool is(const std::exception& error) {
  return dynamic_cast<const Type*>(&error) != nullptr;
}

}  // namespace

ExitCode exit_code_of(const std::exception& error) {
  if (is<UsageError>(error)) return ExitCode::Usage;
  if (is<OutputError>(error) || is<SolverError>(error)) return ExitCode::Resources;
  if (is<InvalidInputError>(error) || is<IoError>(error) || is<CadError>(error))
    return ExitCode::Input;
  if (is<TopologyError>(error)) return ExitCode::Topology;
  if (is<AssociationError>(error)) return ExitCode::Association;
  if (is<QualityError>(error)) return ExitCode::Quality;
  return ExitCode::Resources;
}

}  // namespace cadmorph
