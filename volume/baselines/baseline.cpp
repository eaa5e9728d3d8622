#include "volume/baselines/baseline.h"

#include "core/errors.h"
#include "volume/baselines/femwarp.h"
#include "volume/baselines/lbwarp.h"
#include "volume/baselines/simplex_linear.h"

namespace cadmorph {

std::string to_string(MorphMethod method) {
  switch (method) {
    case MorphMethod::Rbf:
      return "RBF";
    case MorphMethod::Femwarp:
      return "FEMWARP";
    case MorphMethod::Lbwarp:
      return "LBWARP";
    case MorphMethod::SimplexLinear:
      return "simplex-linear";
  }
  return {};
}

std::unique_ptr<Baseline> make_baseline(MorphMethod method, const Mesh& mesh,
                                        const std::vector<Index>& surface_nodes) {
  switch (method) {
    case MorphMethod::Femwarp:
      return make_femwarp(mesh, surface_nodes);
    case MorphMethod::Lbwarp:
      return make_lbwarp(mesh, surface_nodes);
    case MorphMethod::SimplexLinear:
      return make_simplex_linear(mesh, surface_nodes);
    case MorphMethod::Rbf:
      break;
  }
  throw InvalidInputError("the RBF warp is no baseline: use VolumeMorph");
}

}  // namespace cadmorph
