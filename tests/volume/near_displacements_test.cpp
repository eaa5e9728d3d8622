#include "volume/near_displacements.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace cadmorph {

TEST_CASE("Displacements are carried on to what is near, and no farther", "[volume]") {
  // Two sheets of 20 x 20 points, 1 apart, at z = 0 and 30; the lower one's move by a wave.
  constexpr int kSide = 20;
  constexpr double kUpper = 30, kReach = 6;
  const Index n = kSide * kSide;
  Points at(2 * n, 3);
  RowMatrix ways = RowMatrix::Zero(2 * n, 3);
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const Index row = i * kSide + j;
      at.row(row) << i, j, 0;
      at.row(n + row) << i, j, kUpper;
      ways.row(row) << 0, 0, 0.2 * std::sin(0.5 * i) * std::cos(0.4 * j);
    }
  const RowMatrix there = near_displacements(at, ways, kReach, at);
  CHECK((there - ways).rowwise().norm().maxCoeff() <= 1e-3);  // of the points' distance, 1
  Points beyond = at.topRows(n);
  beyond.col(2).setConstant(1.01 * kReach);
  CHECK(near_displacements(at, ways, kReach, beyond).cwiseAbs().maxCoeff() == 0);
  // Between, they fade: from one height to the next by no more than a tenth of the largest.
  RowMatrix below = there.topRows(n);
  for (double z = 0.25; z < kReach; z += 0.25) {
    Points higher = at.topRows(n);
    higher.col(2).setConstant(z);
    const RowMatrix now = near_displacements(at, ways, kReach, higher);
    CHECK((now - below).cwiseAbs().maxCoeff() < 0.1 * 0.2);
    below = now;
  }
}

TEST_CASE("Points given twice count once", "[volume]") {
  Points at(3, 3);
  at << 0, 0, 0, 0, 0, 0, 1, 0, 0;
  RowMatrix ways = RowMatrix::Zero(3, 3);
  ways.topRows(2).col(1).setConstant(0.1);
  const RowMatrix there = near_displacements(at, ways, 2, at);
  CHECK((there - ways).cwiseAbs().maxCoeff() <= 1e-3);
}

}  // namespace cadmorph
