#pragma once

#include "apps/bench/evaluate.h"

namespace cadmorph::bench {

/// Morphs every mesh to its full change with each kernel of Sieger et al. 2013, Table 1, and with
/// Wendland's functions, over their shape parameters, and appends a row each to the CSV file: the
/// condition number of the system (3) (1-norm, as LAPACK estimates it, of coordinates scaled to
/// unit size) and the elements' quality.
void evaluate_kernels(const EvaluateOptions& options);

}  // namespace cadmorph::bench
