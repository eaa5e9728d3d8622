// Stands in for simplex_linear.cpp in builds without CGAL.

#include "core/errors.h"
#include "core/remedies.h"
#include "volume/baselines/simplex_linear.h"

namespace cadmorph {

std::unique_ptr<Baseline> make_simplex_linear(const Mesh&, const std::vector<Index>&) {
  throw SolverError(
      "the simplex-linear method needs CGAL, which this program was built without; install "
      "libcgal-dev and build with -DCADMORPH_WITH_CGAL=ON, or choose " +
      words_for(Remedy::Method));
}

bool has_simplex_linear() { return false; }

}  // namespace cadmorph
