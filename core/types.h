#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace cadmorph {

using Index = std::int64_t;

/// Points in space, one a row (N x 3), row-major as in mesh files.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Rows of any width (N x D), row-major.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace cadmorph
