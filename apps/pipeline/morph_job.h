#pragma once

#include <exception>
#include <memory>
#include <optional>
#include <vector>

#include "apps/pipeline/base_side.h"

namespace cadmorph {

class MorphDerivative;

/// A morphed mesh.
struct MorphResult {
  /// What it started from: the job's base side, or that of the base CAD with its cut faces merged.
  std::shared_ptr<const BaseSide> base;
  std::optional<CadModel> variant;  ///< the model matched: the one given, or its faces merged
  Points positions;                 ///< N x 3, in the mesh's unit
  QualityReport quality;
  ValidityReport validity;
  TopologyMatch match;
  SurfaceMorphResult surface;  ///< before any node slid
  Points surface_positions;    ///< those prescribed, in the order of VolumeMorph::surface_nodes
  PipelineReport report;
};

/// One of several morphs: its result, or why there is none.
struct MorphAttempt {
  MorphResult result;
  std::exception_ptr error;
};

/// Morphs one mesh of one CAD model onto any number of variants.
class MorphJob {
 public:
  /// Sets up the base side; parameters and errors as BaseSide has them.
  MorphJob(std::shared_ptr<const CadModel> base, std::shared_ptr<const MeshFile> mesh,
           PipelineOptions options = {}, Points start = {});
  ~MorphJob();
  MorphJob(MorphJob&&) noexcept;

  /// Morphs the mesh onto `variant`. Faces that one exporter cut and the other did not are merged
  /// (see match_models), with a warning, unless a face map is given. Inverted or poor elements are
  /// told in the report's outcome and diagnosis, not thrown. Throws TopologyError when the models
  /// do not correspond, SolverError when a system can't be solved.
  MorphResult morph(const CadModel& variant) const;

  /// Morphs onto several variants at once, which share what their volume morphs have in common (see
  /// VolumeMorph::morph_each). Each result is to the last bit the one of `morph`, but for its
  /// times, which are shares of the whole; an error of one leaves the others alone.
  std::vector<MorphAttempt> morph_each(const std::vector<CadModel>& variants) const;

  /// Morphs the surface alone: of the result only the match, the surface and its positions, and in
  /// the report what tells of them. Throws as morph does.
  MorphResult morph_surface(const CadModel& variant) const;

  /// Positions of the surface nodes (m x 3, rows as VolumeMorph::surface_nodes) with those on
  /// planes that slide where the others take them. Throws InvalidInputError on a wrong size.
  Points slide(const Points& surface_positions) const;

  /// The derivative of the volume morph at these positions, with `is_sliding` through the planes
  /// that slide. Throws what VolumeMorph::derivative throws.
  MorphDerivative derivative(const Points& surface_positions, bool is_sliding = false) const;

  /// From now on the volume morph is one linear map, chosen for the motions of the surface onto
  /// these models (VolumeMorph::linearised): all above goes by it. Models that are the base's count
  /// for nothing. Throws InvalidInputError where none is given or moves a node, and what
  /// morph_surface and VolumeMorph::linearised throw; the volume morph is then as it was.
  void linearise(const std::vector<CadModel>& models);

  const BaseSide& base() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
