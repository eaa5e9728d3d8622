#pragma once

namespace cadmorph {

/// Samples of the scaled Jacobian that are evaluated side by side.
constexpr int kSampleLanes = 8;
using SampleLane = double[kSampleLanes];

/// What does not change while nodes move. J0: edges or tangents of the sample in the mesh of
/// reference.
struct alignas(64) SampleReference {
  /// Of J0^-1 J0^-T: 00, 10, 20, 11, 21, 22; zero: none to keep. Times a, the ratio counts a^3
  /// times.
  SampleLane metric[6];
  SampleLane inverse_determinant;  ///< 1 / det(J0); zero: none to keep
  SampleLane unit;  ///< signed: a determinant of a positive sample times this is positive, and one
                    ///< for unit edges in the ideal cell
  SampleLane weight;  ///< by which what comes out is multiplied
};

struct alignas(64) SampleEnergy {
  SampleLane energy;       ///< infinite where a sample is not positive
  SampleLane by_edges[9];  ///< its derivative by the edges, over 2^(squarings + 1)
};

/// The powers of ShapeEnergy.
struct SamplePowers {
  int squarings;  ///< p = 2^(squarings + 1), at least 1
  int kept;       ///< that of the shape of reference: 2^kept
};

/// The summands of ShapeEnergy. `edges`: x, y, z of the first edge, then of the others;
/// `are_tetrahedra`: which span one, each of whose corners counts. The same to the last bit on
/// every processor.
void evaluate_samples(const SampleLane edges[9], const SampleReference& reference,
                      bool are_tetrahedra, SamplePowers powers, SampleEnergy& result);

}  // namespace cadmorph
