#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/types.h"

namespace cadmorph {

/// Domains with corners at 0 and 1; a prism is a triangle times a line.
enum class ReferenceShape { Cube, Prism, Simplex };

/// Polynomial degrees by direction; a prism has its triangle's in [0], a simplex its own in [0].
using Degrees = std::array<int, 3>;

struct AffineMap {
  Eigen::Matrix3d linear;
  Eigen::Vector3d origin;
};

/// Returns x^n by repeated multiplication, n >= 0.
double integer_power(double x, int n);

/// Returns the uniform points that determine a polynomial, in the order of the Bernstein
/// polynomials.
std::vector<Eigen::Vector3d> bernstein_grid(ReferenceShape shape, const Degrees& n);

/// Returns the values of the Bernstein polynomials, points x polynomials.
Eigen::MatrixXd bernstein_matrix(ReferenceShape shape, const Degrees& n,
                                 const std::vector<Eigen::Vector3d>& points);

/// Returns the Bernstein coefficients of p on a cube from those of (1 - t)^c p, which has degrees
/// n; t is the last coordinate. A column each.
Eigen::MatrixXd divide_collapse(const Eigen::MatrixXd& product, const Degrees& n, int c);

/// Returns the maps of the domain to its parts when all its edges are halved.
std::vector<AffineMap> parts_of(ReferenceShape shape);

std::vector<Eigen::Vector3d> corners_of(ReferenceShape shape);

}  // namespace cadmorph
