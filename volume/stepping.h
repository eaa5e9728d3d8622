#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "core/validity.h"
#include "volume/volume_morph.h"

namespace cadmorph {

struct SteppingOptions {
  int steps = 0;      ///< number of steps; 0: one, then more while elements are inverted
  int min_steps = 1;  ///< smallest number of steps tried when `steps` is 0
  int max_steps = 8;  ///< largest one; n steps take n - 1 new systems, all up to 8 take 28
  /// Ends the attempts when one more step leaves more than this share of the inverted cells; 1:
  /// goes on up to `max_steps`, as the paper does.
  double least_gain_share = 0.75;
  /// Number of inverted cells that may remain: repairing so few costs less than further steps.
  Index few = 0;
};

/// Surface node positions (m x 3) at fraction s in (0, 1] of the parameter change.
using SurfacePath = std::function<Points(double s)>;

/// Where the surface nodes go.
struct SurfaceMotion {
  SurfaceMotion(const Points& to, SurfacePath way = {}) : target(to), path(std::move(way)) {}

  const Points& target;  ///< m x 3, in the order of VolumeMorph::surface_nodes
  SurfacePath path;      ///< on the way, its value at 1 is not used; empty: straight
};

/// What one attempt came to.
struct SteppingAttempt {
  int steps;
  Index inverted;  ///< cells that fail the exact validity test
  Index held;      ///< of these: held by their surface nodes (is_held), or inverted in the base
};

struct SteppingReport {
  int steps = 0;                          ///< of the positions returned
  ValidityReport validity;                ///< of the positions returned
  std::vector<SteppingAttempt> attempts;  ///< all, in the order tried
  RbfReport rbf;                          ///< of the last step of the positions returned
  double seconds_set_up = 0;              ///< rebuilding systems for further steps
};

struct SteppingResult {
  Points positions;  ///< N x 3
  SteppingReport report;
};

/// Moves all nodes to prescribed surface positions in as many uniform steps as it takes to have no
/// inverted element (Sieger et al. 2013, sect. 6): one step first, then n steps, n the iteration,
/// each step rebuilding the interpolation from the surface moved so far. When no number of steps
/// gives a valid mesh, the attempt with the fewest inverted elements is returned; the earliest of
/// equals. Cells that fail already at the base positions, and those that their surface nodes hold
/// inverted (is_held), don't cause further attempts. `first` is the warp of the base mesh, reused
/// for the first step. `one_step`, if given, is what `first` made of the target already
/// (VolumeMorph::morph_each); it is used up. Throws InvalidInputError on fewer than one step, and
/// what VolumeMorph throws; a SolverError of a later attempt ends the attempts.
SteppingResult morph_in_steps(const Mesh& mesh, const VolumeMorph& first,
                              const SurfaceMotion& motion, const Orientation& orientation,
                              const SteppingOptions& options = {},
                              VolumeMorphResult* one_step = nullptr);

/// The displacement fields of such a morph in exactly `steps` steps, of each step in turn (see
/// VolumeMorph::fields).
std::vector<std::vector<RbfField>> fields_of_steps(const Mesh& mesh, const VolumeMorph& first,
                                                   const SurfaceMotion& motion, int steps);

}  // namespace cadmorph
