#pragma once

#include <Eigen/Core>

#include "core/types.h"

namespace cadmorph {

/// A matrix that is not yet set, in pages of 2 MiB where the system grants them on request
/// (madvise): dense factorisations then wait less for addresses and page faults, a Cholesky factor
/// of 4,600 rows by a third.
Eigen::MatrixXd large_matrix(Index rows, Index columns);

}  // namespace cadmorph
