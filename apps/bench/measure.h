#pragma once

#include "apps/bench/families.h"
#include "core/stopwatch.h"

namespace cadmorph::bench {

/// How the elements of a morphed mesh are.
struct Figures {
  double min = 0;         ///< scaled Jacobian
  double mean_worst = 0;  ///< mean scaled Jacobian of the worst 5 % of the elements
  double mean = 0;        ///< of all
  Index inverted = 0;     ///< elements with a corner Jacobian that is not positive
  Index invalid = 0;      ///< elements that fail the exact test
};

Figures measure(const Series& series, const Points& positions);

/// Mean of the smallest 5 % of the values, those that are not a number left out.
double mean_of_worst(std::vector<double> values);

/// Seconds that this process has had of all processors, which a busy machine does not stretch.
double cpu_seconds();

/// Bytes of memory that this machine has.
double physical_memory();

/// Processor time, too.
class Stopwatch : public cadmorph::Stopwatch {
 public:
  double cpu() const { return cpu_seconds() - cpu_start_; }

 private:
  double cpu_start_ = cpu_seconds();
};

}  // namespace cadmorph::bench
