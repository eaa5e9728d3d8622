#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/formats/byte_scanner.h"
#include "core/formats/text_scanner.h"

namespace cadmorph {

/// The numbers of a format whose files are text or binary, or text between binary sections.
class NumberInput {
 public:
  /// `bytes` must outlive it. `comment` as of TextScanner.
  NumberInput(std::string_view bytes, const std::filesystem::path& path, char comment = 0)
      : text_(bytes, path, comment), bytes_(bytes, path) {}

  TextScanner& text() { return text_; }
  ByteScanner& bytes() { return bytes_; }
  bool is_binary() const { return is_binary_; }
  void set_binary() { is_binary_ = true; }

  /// Where the next number stands.
  std::size_t place() {
    if (is_binary_) return bytes_.place();
    text_.skip_space();
    return text_.place();
  }

  /// Where it is, without a look at the text: white space may stand before the next number.
  std::size_t position() const { return is_binary_ ? bytes_.place() : text_.place(); }

  /// An integer, of `size` 4 or 8 bytes in binary. Throw IoError where there is none.
  Index integer(std::string_view what, int size) {
    return is_binary_ ? bytes_.integer(what, size) : text_.integer(what);
  }
  /// One of [first, end).
  Index index(std::string_view what, int size, Index first, Index end) {
    return is_binary_ ? bytes_.index(what, size, first, end) : text_.index(what, first, end);
  }
  /// A number of items that follow and take at least so many bytes each in binary and in text.
  Index count(std::string_view what, int size, std::size_t least_binary, std::size_t least_text) {
    return is_binary_ ? bytes_.count(what, size, least_binary) : text_.count(what, least_text);
  }

  /// Throw IoError that names the line or byte.
  [[noreturn]] void fail_at(std::size_t place, const std::string& why) const {
    is_binary_ ? bytes_.fail_at(place, why) : text_.fail_at(place, why);
  }
  /// The same of the number behind a place.
  [[noreturn]] void fail_behind(std::size_t place, const std::string& why) {
    is_binary_ ? bytes_.fail_at(place, why) : text_.fail_behind(place, why);
  }
  [[noreturn]] void fail(const std::string& why) { fail_at(place(), why); }

 private:
  TextScanner text_;
  ByteScanner bytes_;
  bool is_binary_ = false;
};

}  // namespace cadmorph
