#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/types.h"

namespace cadmorph {

/// Where a number stands in a text.
struct TextToken {
  std::uint64_t place : 48 = 0;  ///< of its first character
  std::uint64_t length : 16 = 0;
};

/// Reads words and numbers out of a text at some 500 MB/s; an error names file and line.
class TextScanner {
 public:
  /// `text` must outlive it. `comment`, if not 0, begins a comment that runs to the line's end.
  /// Words and numbers end at white space and at each of `separators`.
  TextScanner(std::string_view text, std::filesystem::path path, char comment = 0,
              std::string_view separators = {})
      : text_(text), path_(std::move(path)), comment_(comment), separators_(separators) {}

  std::size_t place() const { return at_; }
  void go_to(std::size_t place) { at_ = place; }
  std::string_view text() const { return text_; }

  /// Skips white space, line ends and comments; false at the end of the text.
  bool skip_space();
  /// Skips blanks and tabs; false at the end of the line (or before a comment).
  bool skip_blanks();

  /// Skips white space, and the character if it follows.
  bool take(char character);
  /// The same; throws IoError when it does not follow.
  void expect(char character, std::string_view after_what);

  /// The rest of the line, without its end ("\n" or "\r\n"), where the next line begins after.
  std::string_view line();
  void skip_line();

  /// The next characters up to white space. Throws IoError at the end of the text.
  std::string_view word(std::string_view what);
  /// The next word as a number. Throw IoError when it is none: "line 7: expected WHAT, found 'x'".
  Index integer(std::string_view what);
  Index hexadecimal(std::string_view what);
  double number(std::string_view what);
  /// The same, and where it stands.
  TextToken number(std::string_view what, double& value);

  /// A number of items that follow and take at least `least_bytes` each: throws IoError when it is
  /// negative, or more than the rest of the text can hold.
  Index count(std::string_view what, std::size_t least_bytes = 2);
  /// An integer of [first, end); throws IoError.
  Index index(std::string_view what, Index first, Index end);

  /// 1-based number of the line that holds a place.
  Index line_number(std::size_t place) const;

  /// Throws IoError: "can't read the mesh PATH: line N: WHY".
  [[noreturn]] void fail(const std::string& why) const { fail_at(at_, why); }
  [[noreturn]] void fail_at(std::size_t place, const std::string& why) const;
  /// "line N: expected WHAT, found ..." at the present place.
  [[noreturn]] void fail_expected(std::string_view what) const;

 private:
  template <class Number>
  TextToken parse(std::string_view what, Number& value, const auto&... base);
  bool ends_word(char c) const;

  std::string_view text_;
  std::filesystem::path path_;
  char comment_;
  std::string_view separators_;
  std::size_t at_ = 0;
};

}  // namespace cadmorph
