#pragma once

#include <exception>
#include <vector>

#include "core/archive.h"
#include "core/mesh.h"
#include "core/rbf/anchors.h"
#include "core/rbf/rbf_system.h"
#include "volume/morph_method.h"
#include "volume/volume_derivative.h"

namespace cadmorph {

struct VolumeMorphOptions {
  MorphMethod method = MorphMethod::Rbf;
  Kernel kernel = Kernel::triharmonic_3d();  ///< of the RBF warp
  RbfOptions rbf = {};
};

/// One of several morphs: its positions, or why there are none.
struct VolumeMorphResult {
  Points positions;  ///< N x 3
  RbfReport report;
  std::exception_ptr error;
};

/// Moves all nodes of a mesh with prescribed surface positions by an RBF space warp (Sieger et al.
/// 2013, sect. 3), component by component (split_components), or by one of the methods that it is
/// compared with (volume/baselines). Holds the factorisations and what the evaluation needs, which
/// depend on the base mesh alone.
class VolumeMorph {
 public:
  /// `surface_nodes`: ids of the m nodes whose positions are prescribed. The local length of each
  /// is its shortest incident mesh edge. Where every node is prescribed (shell meshes) no system is
  /// set up. Throws InvalidInputError on an empty set, an id out of range or one named twice, and
  /// what RbfSystem or make_baseline throws. `free_surface`: see split_components.
  VolumeMorph(const Mesh& mesh, std::vector<Index> surface_nodes, VolumeMorphOptions options = {},
              const std::vector<Index>& free_surface = {});

  /// The one that was stored, for the same mesh and options; of a method other than RBF the surface
  /// nodes alone are stored. Moves nodes to the last bit as the stored one.
  VolumeMorph(const Mesh& mesh, VolumeMorphOptions options, InputArchive& archive);
  void store(OutputArchive& archive) const;

  /// Returns the positions of all nodes (N x 3); surface nodes exactly at `surface_positions` (m x
  /// 3). Throws InvalidInputError on a wrong size or a position that is not finite, and what
  /// RbfSystem::solve throws. `report`, if given, takes the figures of this solve; of a method
  /// other than RBF the number of surface nodes and the seconds alone.
  Points morph(const Points& surface_positions, RbfReport* report = nullptr) const;

  /// Morphs for several sets of surface positions at once, which share the evaluations of the
  /// kernel (RbfSystem::solve_each): with the fast solver four in a block take about half the time
  /// of four alone. Each result is to the last bit the one of `morph`, whatever the others are; an
  /// error of one, a wrong size among them, leaves the others alone. Memory: the result and about
  /// as much again for each set.
  std::vector<VolumeMorphResult> morph_each(const std::vector<Points>& surface_positions) const;

  /// The displacement fields that `morph` evaluates, one for each component that has surface nodes;
  /// of a mesh without a free node one, that of all its nodes.
  /// Throws as `morph` does, and InvalidInputError when the method is not RBF.
  std::vector<RbfField> fields(const Points& surface_positions) const;

  /// The morph at these positions as a linear map of the surface's displacements: kernels and
  /// anchors are held that `morph` chose. Cost: a morph and a factorisation of the kernels' system.
  /// Throws as `morph` does, InvalidInputError when the method is not RBF or the solver the
  /// incremental QR, and SolverError where the factor needs more memory than allowed.
  VolumeDerivative derivative(const Points& surface_positions) const;

  /// The morph as one linear map: kernels and anchors are chosen here, for the motions onto these
  /// surface positions (m x 3 each; where less than a tenth of what moves, for as much in their
  /// direction), and serve whatever is morphed to; its derivative is the same everywhere. A motion
  /// unlike all of these may run on farther than `morph` lets it. Affine motions are exact. Has no
  /// `fields` and can't be stored. Cost: a derivative, and for each of the positions some morphs.
  /// Throws InvalidInputError where none is given or moves a node, and as `derivative` does.
  VolumeMorph linearised(const std::vector<Points>& references) const;

  /// Which motions of the surface may need anchors, and so have a derivative of their own. Of no
  /// motion where the method or the solver asked for has none.
  class HoldCheck {
   public:
    /// Where a guess by few of the nodes does not tell, the motion's own field does, at the cost of
    /// a morph.
    bool may_be_held(const Points& surface_positions) const;

   private:
    friend class VolumeMorph;
    struct Part {
      std::vector<Index> surface;
      RowMatrix centres;
      RbfSystem system;
      RbfTargets targets;
      Index of_cells;  // of the targets, the first
      OvershootCheck check;

      bool may_be_held(const RowMatrix& values) const;
    };
    std::vector<Part> parts_;
  };
  HoldCheck hold_check() const;

  /// Number of these fields; 0 when the method is not RBF.
  Index field_count() const;

  const RbfReport& report() const;
  const std::vector<Index>& surface_nodes() const;
  const VolumeMorphOptions& options() const;

 private:
  struct Impl;
  struct Linear;
  std::shared_ptr<const Impl> impl_;
  std::shared_ptr<const Linear> linear_;  // where it is linearised
};

}  // namespace cadmorph
