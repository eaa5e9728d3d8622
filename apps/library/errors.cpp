#include <new>

#include "apps/library/impl.h"
#include "apps/pipeline/exit_code.h"
#include "core/remedies.h"

namespace cadmorph::v1 {
namespace {

// Remedies by the names that MorphOptions has; set as the library is loaded.
const bool kHasWords = [] {
  set_remedy_words({{Remedy::MeshUnit, "mesh_unit_mm"},
                    {Remedy::AssociationTolerance, "association_tolerance"},
                    {Remedy::Snap, "the option snap"},
                    {Remedy::Unmatched, "the option unmatched"},
                    {Remedy::KeepUnmatched, "unmatched auto or fix"},
                    {Remedy::SlideUnmatched, "slide or unmatched slide"},
                    {Remedy::ExpectUnmatched, "unmatched fix or slide, or slide, hold or follow"},
                    {Remedy::Method, "another method"},
                    {Remedy::RbfMethod, "method rbf"},
                    {Remedy::ListPairs, "'cadmorph match'"},
                    {Remedy::FaceMap, "face_map"},
                    {Remedy::Via, "Mesh::at"},
                    {Remedy::Improve, "improve_below"},
                    {Remedy::MoreSteps, "steps=4"},
                    {Remedy::KeepLayers, "keep_layers"},
                    {Remedy::InvertedInput, "accept_inverted_input"},
                    {Remedy::AutomaticUntangling, "untangle auto"},
                    {Remedy::AutomaticSteps, "steps 0"},
                    {Remedy::AllFigures, "the report"}});
  return true;
}();

// Passes on the error being handled if it is one of Type, as just that.
template <class Type>
void pass_on(const std::exception& error) {
  if (dynamic_cast<const Type*>(&error)) throw Type(error.what());
}

}  // namespace

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
