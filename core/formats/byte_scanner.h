#pragma once

#include <array>
#include <bit>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/types.h"

namespace cadmorph {

/// Reads numbers out of a binary file; an error names file and byte.
class ByteScanner {
 public:
  /// `bytes` must outlive it.
  ByteScanner(std::string_view bytes, std::filesystem::path path)
      : bytes_(bytes), path_(std::move(path)) {}

  bool is_big_endian() const { return is_big_endian_; }
  void set_big_endian(bool is_big_endian) { is_big_endian_ = is_big_endian; }

  std::size_t place() const { return at_; }
  void go_to(std::size_t place) { at_ = place; }
  std::size_t rest() const { return bytes_.size() - at_; }

  /// The next number. Throw IoError at the end of the file: "byte 7: expected WHAT, found ...".
  std::int32_t int32(std::string_view what) { return load<std::int32_t>(what); }
  std::int64_t int64(std::string_view what) { return load<std::int64_t>(what); }
  double float64(std::string_view what) { return load<double>(what); }
  /// An integer of `size` 4 or 8 bytes.
  Index integer(std::string_view what, int size) { return size == 4 ? int32(what) : int64(what); }

  /// A number of items that follow and take at least `least_bytes` each: throws IoError when it is
  /// negative, or more than the rest of the file can hold.
  Index count(std::string_view what, int size, std::size_t least_bytes);
  /// An integer of [first, end); throws IoError.
  Index index(std::string_view what, int size, Index first, Index end);
  /// Throws IoError when the file ends before.
  void skip(std::string_view what, std::uint64_t size);

  /// Throws IoError: "can't read the mesh PATH: byte N: WHY".
  [[noreturn]] void fail(const std::string& why) const { fail_at(at_, why); }
  [[noreturn]] void fail_at(std::size_t place, const std::string& why) const;

 private:
  template <class Number>
  Number load(std::string_view what) {
    if (rest() < sizeof(Number)) fail_end(what);
    std::array<char, sizeof(Number)> bytes;
    std::memcpy(bytes.data(), bytes_.data() + at_, sizeof bytes);
    if ((std::endian::native == std::endian::big) != is_big_endian_) bytes = reversed(bytes);
    at_ += sizeof bytes;
    return std::bit_cast<Number>(bytes);
  }
  template <std::size_t N>
  static std::array<char, N> reversed(const std::array<char, N>& bytes) {
    std::array<char, N> result;
    for (std::size_t i = 0; i < N; ++i) result[i] = bytes[N - 1 - i];
    return result;
  }
  [[noreturn]] void fail_end(std::string_view what) const;

  std::string_view bytes_;
  std::filesystem::path path_;
  std::size_t at_ = 0;
  bool is_big_endian_ = false;
};

}  // namespace cadmorph
