#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "api.h"
#include "cad_model.h"
#include "derivative.h"
#include "mesh.h"
#include "options.h"
#include "progress.h"
#include "report.h"
#include "types.h"

namespace cadmorph::CADMORPH_V1 {

/// A mesh morphed onto a variant. Copies share the data, also of the Morpher that made it.
class MorphResult {
 public:
  const Points& positions() const;  ///< N x 3, in the mesh's unit
  const Report& report() const;
  const Mesh& mesh() const;     ///< the one morphed, as it was
  std::string summary() const;  ///< the report as the program prints it
  std::string json() const;     ///< the report as the program's --json writes it

  /// Writes the mesh with the new positions, as Mesh::write; a refused one, its bad cells marked in
  /// the cell array cadmorph_bad, to STEM.failed.EXT beside. `has_diagnostics` adds the
  /// arrays of the program's --diagnostics. Throws as Mesh::write does.
  WrittenMesh write(const std::filesystem::path& path, bool has_diagnostics = false) const;

  struct Impl;
  explicit MorphResult(std::shared_ptr<const Impl> impl);
  const Impl& impl() const { return *impl_; }

 private:
  std::shared_ptr<const Impl> impl_;
};

struct MorphCall {
  Progress progress = {};
  /// Returns a result with inverted elements, or poorer ones than asked for, instead of throwing.
  bool keep_refused = false;
};

/// The base side of a morph: all that depends on the base CAD, its mesh and the options alone, for
/// any number of variants.
class Morpher {
 public:
  /// Finds the CAD entity of each surface node, measures the mesh and sets up the volume morph.
  /// Throws AssociationError where the mesh does not lie on the base; InvalidInputError for an
  /// option that makes no sense, or a mesh without a surface; SolverError where a system is too
  /// large.
  Morpher(const CadModel& base, const Mesh& mesh, const MorphOptions& options = {},
          const Progress& progress = {});

  /// Morphs onto a variant: to the last bit what the program writes. Throws TopologyError where the
  /// models do not correspond, QualityError for a result that is refused (see MorphCall),
  /// SolverError, CancelledError; InvalidInputError while another call on this object is at work,
  /// for it serves one thread at a time.
  MorphResult morph(const CadModel& variant, const MorphCall& call = {}) const;

  /// Positions of all nodes (N x 3) for those of the surface nodes (m x 3, rows as surface_nodes):
  /// the volume morph alone, in one step, nothing repaired. Throws InvalidInputError on a wrong
  /// size or a number that is not finite, SolverError.
  Points warp(const Points& surface_positions) const {
    Points result(mesh().node_count(), 3);
    warp_to(surface_positions, result.data());
    return result;
  }

  /// Positions of the surface nodes (m x 3) with those on planes that slide where the others take
  /// them. Throws InvalidInputError on a wrong size.
  Points slide(const Points& surface_positions) const {
    Points result(surface_positions.rows(), 3);
    slide_to(surface_positions, result.data());
    return result;
  }

  /// The derivative of `warp` at these positions, or at the base; if asked for that of `warp` after
  /// `slide`. Costs a morph and a factorisation
  /// of the centres' system. Throws as `warp` does, and InvalidInputError for methods other than
  /// RBF and the solver Iqr.
  Derivative derivative(const Points& surface_positions, const DerivativeCall& call = {}) const;
  Derivative derivative(const DerivativeCall& call = {}) const;

  /// How the nodes move with a CAD parameter, by central differences of the surface morphs onto the
  /// models with the parameter larger and smaller by a step; inside by the derivative of `warp` at
  /// the present surface, at the base in that direction. Throws TopologyError; InvalidInputError
  /// for a step that is not positive or moves the surface by less than the CAD's tolerance, or a
  /// second one that is not half of it; as `derivative` does.
  Velocity velocity(const ParameterPair& pair, const VelocityCall& call = {}) const;

  /// dJ/dp of any number of parameters from dJ/dX (N x 3, per the mesh's unit): one adjoint of the
  /// volume, and for each parameter the velocity of the surface alone. Throws as `velocity` does,
  /// and CancelledError.
  std::vector<ParameterGradient> gradient(const RowMatrix& sensitivity,
                                          const std::vector<Parameter>& parameters,
                                          const GradientCall& call = {}) const;

  /// The same, a pair of files read while the one before it is at work. Throws IoError and
  /// CadError, too.
  std::vector<ParameterGradient> gradient_of_files(const RowMatrix& sensitivity,
                                                   const std::vector<ParameterFiles>& parameters,
                                                   const GradientCall& call = {}) const;

  /// Makes the volume morph one linear map from now on, for this object and its copies: its kernels
  /// and, in a far field, its anchors are chosen for the motions of the surface onto these models,
  /// and no more for each variant. `morph` (with Quality::Fast), `warp`, `derivative`, `velocity`
  /// and `gradient` then agree to rounding, and the mesh is a smooth function of the parameters. As
  /// models take one a step away from the base for each parameter; those equal to the base count
  /// for nothing. A motion unlike all of these may move nodes far from the surface farther than
  /// without. A second call takes the place of the first. Costs some morphs a model and a
  /// factorisation of the centres' system. Throws InvalidInputError where no model is given or
  /// none moves the surface, and as `derivative` does; TopologyError; InvalidInputError while
  /// another call is at work. The morph is then as it was.
  void linearise(const std::vector<CadModel>& models);

  const CadModel& base() const;
  const Mesh& mesh() const;
  const Report& report() const;  ///< of the base: what `after` and the like would say is empty

  /// Ids of the nodes whose positions the CAD prescribes, ascending.
  const std::vector<Index>& surface_nodes() const;

  struct Impl;

 private:
  void warp_to(const Points& surface_positions, double* result) const;
  void slide_to(const Points& surface_positions, double* result) const;

  std::shared_ptr<Impl> impl_;
};

}  // namespace cadmorph::CADMORPH_V1
