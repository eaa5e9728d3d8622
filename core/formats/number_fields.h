#pragma once

#include <string>
#include <string_view>

#include "core/types.h"

namespace cadmorph {

/// Numbers in the fields of card decks, as Fortran programs read them.

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

inline std::string_view trimmed(std::string_view field) {
  while (!field.empty() && is_blank(field.front())) field.remove_prefix(1);
  while (!field.empty() && is_blank(field.back())) field.remove_suffix(1);
  return field;
}

/// Decks know no case.
std::string upper(std::string_view text);

/// The characters of a line from `first` on, `count` at most; empty behind its end.
std::string_view columns(std::string_view line, std::size_t first, std::size_t count);

/// The highest number of a node or an element that is taken: sums of such do not overflow.
inline constexpr Index kHighestNumber = Index{1} << 40;

/// Reads "1.5", ".5", "1.d+3", "1.5-3" (for 1.5e-3), with blanks around; a blank field is 0. False
/// when it is no finite number.
bool read_real(std::string_view field, double& value);

/// Reads an integer with blanks around; false when it is none.
bool read_integer(std::string_view field, Index& value);

/// What a field of a deck can hold.
struct RealField {
  std::size_t width = 20;    ///< characters
  bool needs_point = false;  ///< "1" would be an integer, or read with a point put into it
  bool has_letter = true;    ///< "1.5e-3"; without: "1.5-3"
};

/// Appends the value in the fewest digits that read back as it is or, where the field is too
/// narrow, in as many as fit.
void write_real(double value, const RealField& field, std::string& text);

/// The fields of a line between commas; between blanks where it has no comma.
class FreeFields {
 public:
  explicit FreeFields(std::string_view line)
      : line_(line), is_comma_(line.find(',') != std::string_view::npos) {}

  /// The next field, its blanks included; false at the end of the line.
  bool next(std::string_view& field);

 private:
  std::string_view line_;
  bool is_comma_;
  std::size_t at_ = 0;
};

}  // namespace cadmorph
