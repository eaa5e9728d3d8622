// Compiled without contraction of products and sums (see CMakeLists.txt).

#include "volume/sample_energy.h"

#include <cstring>
#include <limits>

#include "core/rbf/register.h"
#include "core/rbf/simd.h"

namespace cadmorph {
namespace {

// Weight of the shape of reference: a cell in that shape has 0.1, beside 1 at least for its angles.
// With 0, 9 pairs keep 3 % less of the smallest scaled Jacobian on the mean, a bore 17 %; with 0.05
// or 0.2 they keep as much on the mean to 1 %, single ones from 6 % less to 17 % more.
constexpr double kKeep = 0.1;

template <class Vec>
struct Vec3 {
  Vec x, y, z;
};

template <class Vec>
CADMORPH_INLINE Vec dot(const Vec3<Vec>& a, const Vec3<Vec>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class Vec>
CADMORPH_INLINE Vec3<Vec> cross(const Vec3<Vec>& a, const Vec3<Vec>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class Vec>
CADMORPH_INLINE Vec3<Vec> difference(const Vec3<Vec>& a, const Vec3<Vec>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

template <class Vec>
CADMORPH_INLINE void add(const Vec& factor, const Vec3<Vec>& v, Vec3<Vec>& sum) {
  sum.x += factor * v.x;
  sum.y += factor * v.y;
  sum.z += factor * v.z;
}

// x^(2^squarings).
template <class Vec>
CADMORPH_INLINE Vec power(Vec x, int squarings) {
  for (int i = 0; i < squarings; ++i) x *= x;
  return x;
}

// A register's samples from the `first` on.
template <class Vec>
CADMORPH_INLINE Vec load_from(int first, const SampleLane& lanes) {
  Vec v;
  std::memcpy(&v, lanes + first, sizeof v);
  return v;
}

template <class Vec>
CADMORPH_INLINE void store_from(int first, const Vec& v, SampleLane& lanes) {
  std::memcpy(lanes + first, &v, sizeof v);
}

template <class Vec>
CADMORPH_INLINE void evaluate_from(int first, const SampleLane edges[9],
                                   const SampleReference& reference, bool are_tetrahedra,
                                   SamplePowers powers, SampleEnergy& result) {
  const Vec zero{};
  const int squarings = powers.squarings;
  const Vec3<Vec> a{load_from<Vec>(first, edges[0]), load_from<Vec>(first, edges[1]),
                    load_from<Vec>(first, edges[2])};
  const Vec3<Vec> b{load_from<Vec>(first, edges[3]), load_from<Vec>(first, edges[4]),
                    load_from<Vec>(first, edges[5])};
  const Vec3<Vec> c{load_from<Vec>(first, edges[6]), load_from<Vec>(first, edges[7]),
                    load_from<Vec>(first, edges[8])};
  const Vec3<Vec> det_by_a = cross(b, c), det_by_b = cross(c, a), det_by_c = cross(a, b);
  const Vec det = dot(a, det_by_a), unit = load_from<Vec>(first, reference.unit) * det;
  const Vec scale = 1 / (unit * unit);
  const Vec aa = dot(a, a), bb = dot(b, b), cc = dot(c, c);
  Vec energy;
  Vec3<Vec> by_a{zero, zero, zero}, by_b = by_a, by_c = by_a;
  if (are_tetrahedra) {
    const Vec3<Vec> d = difference(b, a), e = difference(c, b), f = difference(a, c);
    const Vec dd = dot(d, d), ee = dot(e, e), ff = dot(f, f);
    const Vec at_0 = power(aa * bb * cc * scale, squarings) * 0.25,
              at_a = power(aa * dd * ff * scale, squarings) * 0.25,
              at_b = power(bb * dd * ee * scale, squarings) * 0.25,
              at_c = power(cc * ee * ff * scale, squarings) * 0.25;
    energy = at_0 + at_a + at_b + at_c;
    const Vec of_d = (at_a + at_b) / dd, of_e = (at_b + at_c) / ee, of_f = (at_c + at_a) / ff;
    add((at_0 + at_a) / aa, a, by_a);
    add(-of_d, d, by_a);
    add(of_f, f, by_a);
    add((at_0 + at_b) / bb, b, by_b);
    add(of_d, d, by_b);
    add(-of_e, e, by_b);
    add((at_0 + at_c) / cc, c, by_c);
    add(of_e, e, by_c);
    add(-of_f, f, by_c);
  } else {
    energy = power(aa * bb * cc * scale, squarings);
    add(energy / aa, a, by_a);
    add(energy / bb, b, by_b);
    add(energy / cc, c, by_c);
  }
  // (|F|^2 / 3)^3 / det(F)^2 to a power n; its derivative is n (6 / |F|^2 F J0^-T - 2 / det).
  const double share = double(1 << powers.kept) / double(1 << squarings);
  const Vec m00 = load_from<Vec>(first, reference.metric[0]),
            m10 = load_from<Vec>(first, reference.metric[1]),
            m20 = load_from<Vec>(first, reference.metric[2]),
            m11 = load_from<Vec>(first, reference.metric[3]),
            m21 = load_from<Vec>(first, reference.metric[4]),
            m22 = load_from<Vec>(first, reference.metric[5]);
  Vec3<Vec> of_a{zero, zero, zero}, of_b = of_a, of_c = of_a;
  add(m00, a, of_a);
  add(m10, b, of_a);
  add(m20, c, of_a);
  add(m10, a, of_b);
  add(m11, b, of_b);
  add(m21, c, of_b);
  add(m20, a, of_c);
  add(m21, b, of_c);
  add(m22, c, of_c);
  const Vec norm = dot(of_a, a) + dot(of_b, b) + dot(of_c, c), third = norm / 3;
  const Vec inverse_det0 = load_from<Vec>(first, reference.inverse_determinant),
            ratio = det * inverse_det0;
  Vec kept = kKeep * power(third * third * third / (ratio * ratio), powers.kept);
  Vec by_norm = 3 * share * kept / norm;
  const auto has_shape = inverse_det0 != zero;
  kept = has_shape ? kept : zero;
  by_norm = has_shape ? by_norm : zero;
  add(by_norm, of_a, by_a);
  add(by_norm, of_b, by_b);
  add(by_norm, of_c, by_c);
  const Vec by_det = (-share * kept - energy) / det;
  add(by_det, det_by_a, by_a);
  add(by_det, det_by_b, by_b);
  add(by_det, det_by_c, by_c);

  const Vec weight = load_from<Vec>(first, reference.weight);
  const Vec infinite = zero + std::numeric_limits<double>::infinity();
  store_from<Vec>(first, unit > 0 ? weight * (energy + kept) : infinite, result.energy);
  const Vec slopes[9] = {by_a.x, by_a.y, by_a.z, by_b.x, by_b.y, by_b.z, by_c.x, by_c.y, by_c.z};
  for (int i = 0; i < 9; ++i) store_from<Vec>(first, weight * slopes[i], result.by_edges[i]);
}

template <int Bytes>
CADMORPH_INLINE void evaluate(const SampleLane edges[9], const SampleReference& reference,
                              bool are_tetrahedra, SamplePowers powers, SampleEnergy& result) {
  for (int first = 0; first < kSampleLanes; first += Register<Bytes>::kLanes)
    evaluate_from<typename Register<Bytes>::Vec>(first, edges, reference, are_tetrahedra, powers,
                                                 result);
}

void evaluate_plain(const SampleLane edges[9], const SampleReference& reference,
                    bool are_tetrahedra, SamplePowers powers, SampleEnergy& result) {
  evaluate<16>(edges, reference, are_tetrahedra, powers, result);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) void evaluate_avx2(const SampleLane edges[9],
                                                   const SampleReference& reference,
                                                   bool are_tetrahedra, SamplePowers powers,
                                                   SampleEnergy& result) {
  evaluate<32>(edges, reference, are_tetrahedra, powers, result);
}

__attribute__((target("avx512f"))) void evaluate_avx512(const SampleLane edges[9],
                                                        const SampleReference& reference,
                                                        bool are_tetrahedra, SamplePowers powers,
                                                        SampleEnergy& result) {
  evaluate<64>(edges, reference, are_tetrahedra, powers, result);
}
#endif

}  // namespace

void evaluate_samples(const SampleLane edges[9], const SampleReference& reference,
                      bool are_tetrahedra, SamplePowers powers, SampleEnergy& result) {
#if defined(__x86_64__)
  switch (simd::best()) {
    case simd::InstructionSet::Avx512:
      return evaluate_avx512(edges, reference, are_tetrahedra, powers, result);
    case simd::InstructionSet::Avx2:
      return evaluate_avx2(edges, reference, are_tetrahedra, powers, result);
    case simd::InstructionSet::Baseline:
      break;
  }
#endif
  evaluate_plain(edges, reference, are_tetrahedra, powers, result);
}

}  // namespace cadmorph
