#include "apps/summary/whole_progress.h"

#include <catch2/catch.hpp>

namespace cadmorph {

TEST_CASE("The progress of the whole never falls and ends at 1", "[apps][progress]") {
  WholeProgress whole(2);
  double last = 0;
  const auto take = [&](const char* phase, double fraction) {
    const double now = whole(phase, fraction);
    CAPTURE(phase, fraction, last);
    CHECK(now >= last);
    CHECK(now <= 1);
    last = now;
  };
  take("reading", 0.5);
  for (int morph = 0; morph < 2; ++morph) {
    for (const char* phase : {"boundary", "association", "associating", "volume set-up"})
      take(phase, 0);
    for (const char* phase : {"preparing the solver", "volume morph", "solving", "untangling"}) {
      take(phase, 0);
      take(phase, 0.9);
    }
    take("volume morph", 0);  // once more, in steps
    take("a phase of another day", 0.3);
    CHECK(last < 0.5 * (morph + 1));
  }
  take("writing", 1);
  CHECK(last == Approx(1));
}

TEST_CASE("The progress of the whole goes on within a phase", "[apps][progress]") {
  WholeProgress whole;
  const double start = whole("solving", 0), middle = whole("solving", 0.5);
  CHECK(middle > start);
  CHECK(whole("untangling", 0) > middle);
}

}  // namespace cadmorph
