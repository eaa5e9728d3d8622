#include <array>
#include <new>
#include <utility>

#include "apps/library/impl.h"
#include "apps/pipeline/exit_code.h"

namespace cadmorph::v1 {
namespace {

// What the program's options are called here; longer ones first.
constexpr std::array<std::pair<std::string_view, std::string_view>, 16> kWords{{
    {"--association-tolerance", "association_tolerance"},
    {"--unmatched auto or fix", "unmatched auto or fix"},
    {"--unmatched", "the option unmatched"},
    {"(--mesh-unit)", "(mesh_unit_mm)"},
    {"--mesh-unit", "mesh_unit_mm"},
    {"--method rbf", "method rbf"},
    {"another --method", "another method"},
    {"by --map", "by face_map"},
    {"(--via)", "(Mesh::at)"},
    {"--improve ", "improve_below "},
    {"--untangle auto", "untangle auto"},
    {"--steps auto", "steps 0"},
    {"--solver", "solver"},
    {"--memory", "memory_limit_bytes"},
    {"--tolerance", "solver_tolerance"},
    {"--hold", "hold"},
}};

// Passes on the error being handled if it is one of Type; its text may change.
template <class Type>
void pass_on(const std::exception& error) {
  if (dynamic_cast<const Type*>(&error)) throw Type(in_library_words(error.what()));
}

}  // namespace

std::string in_library_words(std::string text) {
  for (const auto& [program, library] : kWords)
    for (std::size_t at = 0; (at = text.find(program, at)) != std::string::npos;
         at += library.size())
      text.replace(at, program.size(), library);
  return text;
}

void rethrow_at_door() {
  try {
    throw;
  } catch (const CancelSignal&) {
    throw CancelledError("cancelled: the progress callback asked to stop");
  } catch (const std::bad_alloc&) {
    throw SolverError("out of memory; free some, or use a smaller mesh");
  } catch (const Error& error) {
    pass_on<InvalidInputError>(error);
    pass_on<IoError>(error);
    pass_on<CadError>(error);
    pass_on<TopologyError>(error);
    pass_on<AssociationError>(error);
    pass_on<SolverError>(error);
    pass_on<QualityError>(error);
    pass_on<OutputError>(error);
    throw;
  }
}

int exit_code(const std::exception& error) { return static_cast<int>(exit_code_of(error)); }

}  // namespace cadmorph::v1
