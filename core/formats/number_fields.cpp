#include "core/formats/number_fields.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace cadmorph {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_sign(char c) { return c == '+' || c == '-'; }

bool parse(std::string_view text, double& value) {
  const char* const end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && last == end && std::isfinite(value);
}

/// "1.D+3" and "1.5-3" with the e that from_chars wants; empty when it can be no number.
std::string with_letter(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const bool is_exponent = c == 'd' || c == 'D' || c == 'e' || c == 'E';
    const bool follows_mantissa = i > 0 && (is_digit(text[i - 1]) || text[i - 1] == '.');
    if (is_exponent) {
      result += 'e';
    } else if (is_sign(c)) {
      if (follows_mantissa) result += 'e';
      if (c == '-') result += '-';
    } else {
      result += c;
    }
  }
  return result;
}

/// The characters of a number.
class Spelling {
 public:
  /// As to_chars writes it, then in the field's own spelling.
  template <class... Format>
  Spelling(const RealField& field, double value, Format... format) {
    const auto [end, error] = std::to_chars(text_.data(), text_.data() + kMost, value, format...);
    if (error != std::errc()) return;
    size_ = std::size_t(end - text_.data());
    respell(field);
    if (size_ > field.width) leave_out_zero();
  }

  std::size_t size() const { return size_; }  ///< 0: too many to tell
  operator std::string_view() const { return {text_.data(), size_}; }

 private:
  static constexpr std::size_t kMost = 400;  // a double has up to 309 digits before its point

  /// "1e-05" with a point, and with no more of the exponent than it takes.
  void respell(const RealField& field) {
    std::size_t e = std::string_view(*this).find('e');
    const bool has_exponent = e != std::string_view::npos;
    const bool has_point = std::string_view(*this).substr(0, e).find('.') != std::string_view::npos;
    if (!has_exponent) e = size_;
    if (!has_point && (field.needs_point || !field.has_letter)) {
      std::memmove(text_.data() + e + 1, text_.data() + e, size_ - e);
      text_[e++] = '.';
      ++size_;
    }
    if (!has_exponent) return;
    std::size_t digits = e + 1;
    const bool is_negative = text_[digits] == '-';
    if (is_sign(text_[digits])) ++digits;
    while (digits + 1 < size_ && text_[digits] == '0') ++digits;
    if (field.has_letter) text_[e++] = 'e';
    if (is_negative)
      text_[e++] = '-';
    else if (!field.has_letter)
      text_[e++] = '+';
    std::memmove(text_.data() + e, text_.data() + digits, size_ - digits);
    size_ -= digits - e;
  }

  /// The one before the point.
  void leave_out_zero() {
    const std::size_t zero = text_[0] == '-' ? 1 : 0;
    if (size_ <= 2 || text_[zero] != '0' || text_[zero + 1] != '.') return;
    --size_;
    std::memmove(text_.data() + zero, text_.data() + zero + 1, size_ - zero);
  }

  std::array<char, kMost + 4> text_;
  std::size_t size_ = 0;
};

/// The most digits after the point that may fit.
int most_digits(double value, std::chars_format format, const RealField& field) {
  const double size = std::abs(value);
  int others = std::signbit(value) ? 2 : 1;  // the sign and the point
  if (format == std::chars_format::scientific) others += 3;
  for (double power = 1; format == std::chars_format::fixed && size >= power && power < 1e22;
       power *= 10)
    ++others;
  return std::max(0, int(field.width) - others);
}

/// The most digits after the point that fit, fixed or with an exponent; empty when none do.
std::string fitted(double value, std::chars_format format, const RealField& field) {
  for (int digits = most_digits(value, format, field); digits >= 0;) {
    const Spelling text(field, value, format, digits);
    if (text.size() > 0 && text.size() <= field.width) return std::string(std::string_view(text));
    // Each digit less is a character less.
    const int surplus = std::max(1, int(text.size()) - int(field.width));
    digits = digits > 0 ? std::max(0, digits - surplus) : -1;
  }
  return {};
}

/// A field of eight columns, the usual one, at once: digits with blanks around. False for any
/// other, and where bytes stand in another order.
bool read_eight_columns(std::string_view field, Index& value) {
  if (field.size() != 8 || std::endian::native != std::endian::little) return false;
  constexpr std::uint64_t kEach = 0x0101010101010101, kHigh = 0x80 * kEach;  // of each byte 1 bit
  std::uint64_t bytes = 0;  // the first column is the lowest
  std::memcpy(&bytes, field.data(), 8);
  const std::uint64_t other = bytes ^ ' ' * kEach;  // 0 where there is a blank
  if (other == 0) return false;
  const int before = std::countr_zero(other) / 8 * 8, behind = std::countl_zero(other) / 8 * 8;
  // Digits in the last columns, zeros before them.
  std::uint64_t digits = (bytes >> before << before << behind) ^ ('0' * kEach << (before + behind));
  if ((digits + (0x80 - 10) * kEach) & kHigh || digits & kHigh) return false;
  digits = digits * 10 + (digits >> 8);  // pairs of digits in every other byte
  constexpr std::uint64_t kPairs = 0x000000ff000000ff;
  value = Index(((digits & kPairs) * (100 + (std::uint64_t{1000000} << 32)) +
                 (digits >> 16 & kPairs) * (1 + (std::uint64_t{10000} << 32))) >>
                32);
  return true;
}

}  // namespace

bool read_real(std::string_view field, double& value) {
  const std::string_view text = trimmed(field);
  value = 0;
  if (text.empty()) return true;
  constexpr std::size_t kLongest = 64;  // a number has 25; text without an end is not copied
  return parse(text, value) || (text.size() <= kLongest && parse(with_letter(text), value));
}

std::string upper(std::string_view text) {
  std::string result(text);
  std::ranges::transform(result, result.begin(),
                         [](unsigned char c) { return char(std::toupper(c)); });
  return result;
}

std::string_view columns(std::string_view line, std::size_t first, std::size_t count) {
  return first < line.size() ? line.substr(first, count) : std::string_view();
}

bool read_integer(std::string_view field, Index& value) {
  if (read_eight_columns(field, value)) return true;
  const char* at = field.data();
  const char* const field_end = at + field.size();
  while (at < field_end && is_blank(*at)) ++at;
  // Most have few digits, and no sign: these can't overflow.
  constexpr std::ptrdiff_t kFew = 18;
  const char* const first = at;
  Index number = 0;
  while (at < field_end && is_digit(*at) && at - first < kFew) number = 10 * number + (*at++ - '0');
  const bool has_digits = at > first;
  while (at < field_end && is_blank(*at)) ++at;
  if (at == field_end) {
    value = number;
    return has_digits;
  }
  std::string_view text = trimmed(field);
  if (text.starts_with('+')) text.remove_prefix(1);
  const char* const end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && last == end;
}

void write_real(double value, const RealField& field, std::string& text) {
  const Spelling shortest(field, value);
  if (shortest.size() <= field.width) {
    text += shortest;
    return;
  }
  const std::string fixed = fitted(value, std::chars_format::fixed, field);
  // An exponent takes more characters than the zeros that it saves.
  if (std::abs(value) >= 0.01 && !fixed.empty()) {
    text += fixed;
    return;
  }
  const std::string scientific = fitted(value, std::chars_format::scientific, field);
  const auto error_of = [&](const std::string& candidate) {
    double found = 0;
    return !candidate.empty() && read_real(candidate, found) ? std::abs(found - value) : HUGE_VAL;
  };
  text += error_of(fixed) <= error_of(scientific) ? fixed : scientific;
}

bool FreeFields::next(std::string_view& field) {
  if (at_ > line_.size()) return false;
  if (!is_comma_) {
    while (at_ < line_.size() && is_blank(line_[at_])) ++at_;
    if (at_ >= line_.size()) return false;
  }
  std::size_t end = at_;
  if (is_comma_)
    end = std::min(line_.find(',', at_), line_.size());
  else
    while (end < line_.size() && !is_blank(line_[end])) ++end;
  field = line_.substr(at_, end - at_);
  at_ = end + 1;
  return true;
}

}  // namespace cadmorph
