#pragma once

#include "core/types.h"

namespace cadmorph {

/// The radial functions of Sieger et al. 2013, Table 1.
enum class KernelKind { Gaussian, Multiquadric, InverseMultiquadric, Polyharmonic };

/// A radial basis function phi(r), r >= 0 in the unit of the centres.
struct Kernel {
  KernelKind kind = KernelKind::Polyharmonic;
  int order = 3;      ///< polyharmonic: order k of the operator Delta^k (2 bi-, 3 tri-, 4 quadharmonic)
  int dimension = 3;  ///< polyharmonic: d of R^d; r^(2k-d), times log r for even d
  double shape = 1;   ///< epsilon of the Gaussian and the multiquadrics, 1 / length

  double operator()(double r) const;

  /// Order of conditional positive definiteness: the interpolant needs polynomials of degree
  /// cpd_order() - 1 at least; 0 for positive definite kernels (Wendland 2005, ch. 8).
  int cpd_order() const;

  /// Sign s such that s * phi is conditionally positive definite (r^3: +1, r: -1, r^2 log r: +1).
  int cpd_sign() const;

  static Kernel biharmonic_2d() { return {KernelKind::Polyharmonic, 2, 2}; }   ///< r^2 log r
  static Kernel biharmonic_3d() { return {KernelKind::Polyharmonic, 2, 3}; }   ///< r
  static Kernel triharmonic_3d() { return {KernelKind::Polyharmonic, 3, 3}; }  ///< r^3
  static Kernel quadharmonic_3d() { return {KernelKind::Polyharmonic, 4, 3}; } ///< r^5
};

}  // namespace cadmorph
