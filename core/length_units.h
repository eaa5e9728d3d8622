#pragma once

#include <array>
#include <string>

namespace cadmorph {

/// A unit of length that meshes come in.
struct LengthUnit {
  double mm;  ///< millimetres that it is long
  const char* name;
};

/// Those that a mesh's unit is looked for among, the most common first.
inline constexpr std::array<LengthUnit, 5> kLengthUnits{
    {{1, "mm"}, {1000, "m"}, {10, "cm"}, {25.4, "inch"}, {304.8, "foot"}}};

/// Its name among these, else "0.5 mm".
std::string unit_name(double mm);

}  // namespace cadmorph
