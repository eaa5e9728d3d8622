#pragma once

#include <exception>
#include <map>
#include <optional>
#include <vector>

#include "apps/bench/families.h"
#include "volume/volume_morph.h"

namespace cadmorph::bench {

/// What a method makes of a step.
struct Warped {
  Points positions = {};  ///< of all nodes
  double set_up_seconds = 0, seconds = 0;
  double cpu_seconds = 0;  ///< of both
};

/// The RBF warp with all surface nodes as centres along the paths of a series: each route is made
/// once, when it is first asked for. Absolute steps are solved several at once
/// (VolumeMorph::morph_each): their seconds are shares of the whole.
class RbfWarps {
 public:
  explicit RbfWarps(const Series& series) : series_(series) {}

  /// The mesh at a step of a route. Throws what the solver threw there, or on a relative route at
  /// any step before.
  const Warped& at(const Route& route, int step);

 private:
  struct Outcome {
    Warped warped;
    std::exception_ptr error;
  };
  std::vector<Outcome> warp_absolutely(const Path& path) const;
  std::vector<Outcome> warp_relatively(const Path& path) const;

  const Series& series_;
  std::map<Route, std::vector<Outcome>> outcomes_;
};

}  // namespace cadmorph::bench
