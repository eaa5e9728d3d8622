#pragma once

#include <string_view>

namespace cadmorph {

/// Turns the phases of a trip (see Progress), some within others and some more than once, into the
/// fraction of the whole that is done, which never falls.
class WholeProgress {
 public:
  /// `morphs`: one, and one more for each CAD model on the way.
  explicit WholeProgress(int morphs = 1) : morphs_(morphs) {}

  /// Takes a phase at a fraction in [0, 1]; returns the fraction of the whole, in [0, 1].
  double operator()(std::string_view phase, double fraction);

 private:
  int morphs_, begun_ = 0;
  double done_ = 0;
};

}  // namespace cadmorph
