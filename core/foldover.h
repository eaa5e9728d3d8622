#pragma once

namespace cadmorph {

/// What maps without folds are found by (Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov:
/// Foldover-free maps in 50 lines of code, ACM TOG 2021): with D the determinant of the map's
/// Jacobian, its distortion over chi(D, eps) is minimised for ever smaller eps.

/// chi(D, eps) = (D + sqrt(eps^2 + D^2)) / 2 (eq. 3): positive, near D for D > 0. With its first
/// and second derivative by D.
struct Regularised {
  Regularised(double d, double epsilon);

  double chi, rate, bend;
};

/// eps once all determinants are positive: chi is D to rounding then, from D = 0.01 on.
inline constexpr double kLeastEpsilon = 1e-10;

/// The next eps, which lowers the energy at the smallest determinant as the last minimisation
/// lowered the whole (sect. 4).
double next_epsilon(double epsilon, double least, double energy_before, double energy);

/// Weight of the change of volume beside the change of shape, as in the paper's program.
inline constexpr double kVolumeWeight = 1.0 / 128;

}  // namespace cadmorph
