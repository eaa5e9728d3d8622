#include "core/formats/number_fields.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

namespace cadmorph {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
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

/// "1.5e-05" in the field's own spelling.
std::string spelled(std::string_view text, const RealField& field) {
  const std::size_t e = text.find('e');
  std::string mantissa(text.substr(0, e));
  const bool has_point = mantissa.find('.') != std::string::npos;
  if (!has_point && (field.needs_point || !field.has_letter)) mantissa += '.';
  if (e == std::string_view::npos) return mantissa;
  std::string_view digits = text.substr(e + 1);
  const bool is_negative = digits.starts_with('-');
  if (is_sign(digits.front())) digits.remove_prefix(1);
  while (digits.size() > 1 && digits.starts_with('0')) digits.remove_prefix(1);
  const std::string_view sign = is_negative ? "-" : field.has_letter ? "" : "+";
  return mantissa + (field.has_letter ? "e" : "") + std::string(sign) + std::string(digits);
}

/// Without the zero before the point.
std::string without_zero(std::string text) {
  const std::size_t zero = text.find("0.");
  if (text.size() > 2 && (zero == 0 || (zero == 1 && text[0] == '-'))) text.erase(zero, 1);
  return text;
}

/// The most digits after the point that fit, fixed or with an exponent; empty when none do.
std::string fitted(double value, std::chars_format format, const RealField& field) {
  std::array<char, 400> buffer;
  for (int digits = int(field.width); digits >= 0;) {
    const auto [end, error] =
        std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, format, digits);
    std::string text = error == std::errc() ? spelled({buffer.data(), end}, field) : std::string();
    if (text.size() > field.width) text = without_zero(std::move(text));
    if (!text.empty() && text.size() <= field.width) return text;
    // Each digit less is a character less.
    const int surplus = std::max(1, int(text.size()) - int(field.width));
    digits = digits > 0 ? std::max(0, digits - surplus) : -1;
  }
  return {};
}

}  // namespace

std::string_view trimmed(std::string_view field) {
  while (!field.empty() && is_blank(field.front())) field.remove_prefix(1);
  while (!field.empty() && is_blank(field.back())) field.remove_suffix(1);
  return field;
}

bool read_real(std::string_view field, double& value) {
  const std::string_view text = trimmed(field);
  value = 0;
  if (text.empty()) return true;
  constexpr std::size_t kLongest = 64;
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
  std::string_view text = trimmed(field);
  if (text.starts_with('+')) text.remove_prefix(1);
  const char* const end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && last == end;
}

void write_real(double value, const RealField& field, std::string& text) {
  std::array<char, 32> buffer;
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  std::string shortest = spelled({buffer.data(), end}, field);
  if (shortest.size() > field.width) shortest = without_zero(std::move(shortest));
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
