#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <string>
#include <string_view>

namespace cadmorph::test {

/// The bytes of a binary file, number by number.
class BinaryText {
 public:
  explicit BinaryText(bool is_big_endian) : is_big_endian_(is_big_endian) {}

  BinaryText& text(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  BinaryText& int32(std::initializer_list<std::int32_t> values) { return put(values); }
  BinaryText& int64(std::initializer_list<std::int64_t> values) { return put(values); }
  BinaryText& float32(std::initializer_list<float> values) { return put(values); }
  BinaryText& float64(std::initializer_list<double> values) { return put(values); }
  const std::string& bytes() const { return bytes_; }

 private:
  template <class Number>
  BinaryText& put(std::initializer_list<Number> values) {
    for (const Number value : values) {
      char bytes[sizeof value];
      std::memcpy(bytes, &value, sizeof value);
      if ((std::endian::native == std::endian::big) != is_big_endian_)
        std::reverse(bytes, bytes + sizeof value);
      bytes_.append(bytes, sizeof value);
    }
    return *this;
  }

  bool is_big_endian_;
  std::string bytes_;
};

}  // namespace cadmorph::test
