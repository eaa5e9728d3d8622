#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/parallel.h"
#include "core/types.h"

namespace cadmorph {

/// Where a number stands in a text.
struct TextToken {
  std::uint64_t place : 48 = 0;  ///< of its first character
  std::uint64_t length : 16 = 0;
};

/// Reads words and numbers out of a text, behind its byte-order mark; an error names file and line.
/// Where numbers follow numbers the other threads read ahead, a MB at a time: from then on it must
/// stay where it is.
class TextScanner {
 public:
  /// `text` must outlive it. `comment`, if not 0, begins a comment that runs to the line's end.
  /// Words and numbers end at white space and at each of `separators`.
  TextScanner(std::string_view text, std::filesystem::path path, char comment = 0,
              std::string_view separators = {});

  std::size_t place() const { return at_; }
  void go_to(std::size_t place) {
    if (place < part_.begin || place > part_.end) numbers_read_ = 0;
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
  Index integer(std::string_view what) {
    const Ahead* const ahead = next_ahead();
    if (!ahead || ahead->is_real) return parse_integer(what);
    take(*ahead);
    return ahead->integer;
  }
  Index hexadecimal(std::string_view what);
  double number(std::string_view what) {
    double value = 0;
    number(what, value);
    return value;
  }
  /// The same, and where it stands.
  TextToken number(std::string_view what, double& value) {
    const Ahead* const ahead = next_ahead();
    if (!ahead) return parse_number(what, value);
    take(*ahead);
    value = ahead->is_real ? ahead->real : double(ahead->integer);
    return {.place = ahead->place, .length = ahead->length};
  }

  /// A number of items that follow and take at least `least_bytes` each: throws IoError when it is
  /// negative, or more than the rest of the text can hold.
  Index count(std::string_view what, std::size_t least_bytes = 2);
  /// An integer of [first, end); throws IoError.
  Index index(std::string_view what, Index first, Index end) {
    const std::size_t before = at_;
    const Index value = integer(what);
    if (value < first || value >= end) fail_range(before, what, value, first, end);
    return value;
  }

  /// 1-based number of the line that holds a place.
  Index line_number(std::size_t place) const;

  /// Throws IoError: "can't read the mesh PATH: line N: WHY".
  [[noreturn]] void fail(const std::string& why) const { fail_at(at_, why); }
  [[noreturn]] void fail_at(std::size_t place, const std::string& why) const;
  /// The same of the word behind a place; white space may stand between.
  [[noreturn]] void fail_behind(std::size_t place, const std::string& why);
  /// "line N: expected WHAT, found ..." at the present place.
  [[noreturn]] void fail_expected(std::string_view what) const;

 private:
  /// A number that was read ahead.
  struct Ahead {
    std::uint64_t place : 48 = 0;
    std::uint64_t length : 14 = 0;
    std::uint64_t is_real : 1 = 0;
    std::uint64_t is_next : 1 = 0;  ///< nothing but white space since the one before
    union {
      std::int64_t integer = 0;
      double real;
    };
  };

  /// Some of the text, and its numbers.
  struct AheadPart {
    std::size_t begin = 0, end = 0;
    std::vector<std::vector<Ahead>> blocks;  ///< in the order of the text
  };

  template <class Number>
  TextToken parse(std::string_view what, Number& value, const auto&... base);
  [[noreturn]] void fail_range(std::size_t before, std::string_view what, Index value, Index first,
                               Index end);
  TextToken parse_number(std::string_view what, double& value);
  Index parse_integer(std::string_view what);

  /// The number that is next, if it was read ahead.
  const Ahead* next_ahead() {
    const bool is_here =
        ahead_ != ahead_last_ &&
        (ahead_->place == at_ || (ahead_->is_next && ahead_[-1].place + ahead_[-1].length == at_));
    return is_here ? ahead_ : find_ahead();
  }
  const Ahead* find_ahead();
  void take(const Ahead& number) {
    at_ = number.place + number.length;
    ++ahead_;
  }
  bool read_ahead();
  void start_reading(std::size_t begin, AheadPart& part);
  void read_numbers(std::size_t begin, std::size_t end, std::vector<Ahead>& numbers) const;
  std::size_t block_end(std::size_t place) const;

  static bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
  bool ends_word(char c) const { return ends_word_[static_cast<unsigned char>(c)]; }

  std::string_view text_;
  std::filesystem::path path_;
  char comment_;
  std::array<bool, 256> ends_word_{};
  std::size_t at_ = 0;

  const Ahead *ahead_ = nullptr, *ahead_last_ = nullptr;  ///< the next of a block, and its end
  std::size_t ahead_block_ = 0;                           ///< the one after that block
  AheadPart part_, next_part_;  ///< the one that is taken, and the one that is being read
  Index numbers_read_ = 0;      ///< one after the other
  std::unique_ptr<BackgroundLoop> reading_;
};

}  // namespace cadmorph
