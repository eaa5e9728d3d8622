#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/types.h"

namespace cadmorph {

/// Where a number stands in a text.
struct TextToken {
  std::uint64_t place : 48 = 0;  ///< of its first character
  std::uint64_t length : 16 = 0;
};

/// Reads words and numbers out of a text; an error names file and line. Where numbers follow
/// numbers all threads read ahead, some MB at a time.
class TextScanner {
 public:
  /// `text` must outlive it. `comment`, if not 0, begins a comment that runs to the line's end.
  /// Words and numbers end at white space and at each of `separators`.
  TextScanner(std::string_view text, std::filesystem::path path, char comment = 0,
              std::string_view separators = {});

  std::size_t place() const { return at_; }
  void go_to(std::size_t place) {
    if (place < ahead_from_ || place > ahead_end_) numbers_read_ = 0;
    at_ = place;
  }
  /// Goes on behind something that is no number; what was read ahead stays of use.
  void pass(std::size_t place) { at_ = place; }
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
  /// A word that was read ahead.
  struct Ahead {
    enum class Kind : std::uint8_t { Integer, Real, Other };  ///< Other: not told yet
    TextToken token;
    union {
      std::int64_t integer = 0;
      double real;
    };
    Kind kind = Kind::Other;
  };

  template <class Number>
  TextToken parse(std::string_view what, Number& value, const auto&... base);
  const Ahead* next_ahead();
  void take_ahead(const Ahead& word);
  void read_ahead();
  void read_words(std::size_t begin, std::size_t end, std::vector<Ahead>& words) const;
  std::size_t block_end(std::size_t place) const;

  bool ends_word(char c) const { return ends_word_[static_cast<unsigned char>(c)]; }

  std::string_view text_;
  std::filesystem::path path_;
  char comment_;
  std::array<bool, 256> ends_word_{};
  std::size_t at_ = 0;

  std::vector<std::vector<Ahead>> ahead_;         ///< in the order of the text
  std::size_t ahead_block_ = 0, ahead_word_ = 0;  ///< the next of them
  std::size_t ahead_from_ = 0, ahead_end_ = 0;    ///< no word begins between here and the next
  Index numbers_read_ = 0;                        ///< one after the other
};

}  // namespace cadmorph
