#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include "apps/library/include/cadmorph/cadmorph.h"
#include "apps/pipeline/morph_files.h"
#include "core/cell_topology.h"

namespace cadmorph::v1 {

struct CadModel::Impl {
  std::shared_ptr<const cadmorph::CadModel> model;
};

struct Mesh::Impl {
  std::shared_ptr<const MeshFile> file;
  std::optional<cadmorph::Mesh> moved;  ///< where it is at other positions than the file's

  const cadmorph::Mesh& mesh() const { return moved ? *moved : file->mesh(); }

  /// Where it has cells that VTK does not know: with others in their place.
  std::optional<cadmorph::Mesh> of_vtk = as_vtk_has_it(mesh());
  const cadmorph::Mesh& vtk_cells() const { return of_vtk ? *of_vtk : mesh(); }
};

/// Passes progress on to the callback of the call at work.
class Teller {
 public:
  void operator()(std::string_view phase, double fraction) const;

  const Progress* progress = nullptr;
};

struct Morpher::Impl {
  Impl(const CadModel& base, const Mesh& mesh, PipelineOptions options, const Progress& progress);

  CadModel base;
  Mesh mesh;
  Teller teller;
  std::optional<MorphJob> job;
  std::vector<Index> surface_nodes;
  Report report;
  std::mutex at_work;
};

struct MorphResult::Impl {
  std::shared_ptr<const Morpher::Impl> morpher;
  cadmorph::MorphResult result;
  Report report;
};

/// The options of the inner parts. Throws InvalidInputError for those that make no sense.
PipelineOptions inner_options(const MorphOptions& options);

Report report_of(const PipelineReport& report);

/// Ends long work from within a progress callback; no Error, which would end an attempt alone.
struct CancelSignal {};

/// Calls `work`; what it throws leaves the library as one of the errors in errors.h.
template <class Work>
decltype(auto) at_door(const Work& work);

[[noreturn]] void rethrow_at_door();

template <class Work>
decltype(auto) at_door(const Work& work) {
  try {
    return work();
  } catch (...) {
    rethrow_at_door();
  }
}

}  // namespace cadmorph::v1
