#pragma once

#include "core/types.h"

namespace cadmorph {

/// The radial functions of Sieger et al. 2013, Table 1, and those of compact support that its sect.
/// 8 looks ahead to (Wendland 2005, ch. 9: phi_{3,1} and phi_{3,2}; positive definite up to R^3).
enum class KernelKind {
  Gaussian,
  Multiquadric,
  InverseMultiquadric,
  Polyharmonic,
  WendlandC2,  ///< (1 - t)^4 (4 t + 1) for t = shape * r < 1, else 0
  WendlandC4,  ///< (1 - t)^6 (35 t^2 + 18 t + 3) / 3
};

/// A radial basis function phi(r), r >= 0 in the unit of the centres.
struct Kernel {
  KernelKind kind = KernelKind::Polyharmonic;
  int order = 3;  ///< polyharmonic: order k of the operator Delta^k (2 bi-, 3 tri-, 4 quadharmonic)
  int dimension = 3;  ///< polyharmonic: d of R^d; r^(2k-d), times log r for even d
  /// Epsilon of the Gaussian and the multiquadrics, 1 / support of Wendland's; 1 / length.
  double shape = 1;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(kind, order, dimension, shape);
  }

  double operator()(double r) const;

  bool has_shape() const { return kind != KernelKind::Polyharmonic; }

  /// Order of conditional positive definiteness: the interpolant needs polynomials of degree
  /// cpd_order() - 1 at least; 0 for positive definite kernels (Wendland 2005, ch. 8).
  int cpd_order() const;

  /// Sign s such that s * phi is conditionally positive definite (r^3: +1, r: -1, r^2 log r: +1).
  int cpd_sign() const;

  static Kernel biharmonic_2d() { return {KernelKind::Polyharmonic, 2, 2}; }    ///< r^2 log r
  static Kernel biharmonic_3d() { return {KernelKind::Polyharmonic, 2, 3}; }    ///< r
  static Kernel triharmonic_3d() { return {KernelKind::Polyharmonic, 3, 3}; }   ///< r^3
  static Kernel quadharmonic_3d() { return {KernelKind::Polyharmonic, 4, 3}; }  ///< r^5
};

}  // namespace cadmorph
