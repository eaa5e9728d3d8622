#include "core/length_units.h"

#include <cmath>
#include <cstdio>

namespace cadmorph {

std::string unit_name(double mm) {
  constexpr double kSame = 1e-9;  // far above rounding
  for (const LengthUnit& unit : kLengthUnits)
    if (std::abs(mm - unit.mm) < kSame * unit.mm) return unit.name;
  char text[32];
  std::snprintf(text, sizeof text, "%.6g mm", mm);
  return text;
}

}  // namespace cadmorph
