#include "core/formats/text_scanner.h"

#include <algorithm>
#include <charconv>

#include "core/formats/mesh_format.h"

namespace cadmorph {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_space(char c) { return is_blank(c) || c == '\n' || c == '\r' || c == '\f' || c == '\v'; }

constexpr std::size_t kLongestToken = 0xffff;

}  // namespace

bool TextScanner::skip_space() {
  while (at_ < text_.size()) {
    if (is_space(text_[at_]))
      ++at_;
    else if (comment_ && text_[at_] == comment_)
      skip_line();
    else
      return true;
  }
  return false;
}

bool TextScanner::skip_blanks() {
  while (at_ < text_.size() && is_blank(text_[at_])) ++at_;
  return at_ < text_.size() && text_[at_] != '\n' && text_[at_] != '\r' &&
         !(comment_ && text_[at_] == comment_);
}

bool TextScanner::take(char character) {
  if (!skip_space() || text_[at_] != character) return false;
  ++at_;
  return true;
}

void TextScanner::expect(char character, std::string_view after_what) {
  if (!take(character))
    fail_expected("'" + std::string(1, character) + "' after " + std::string(after_what));
}

bool TextScanner::ends_word(char c) const {
  return is_space(c) || separators_.find(c) != std::string_view::npos;
}

std::string_view TextScanner::line() {
  const std::size_t begin = at_;
  skip_line();
  std::string_view line = text_.substr(begin, at_ - begin);
  while (line.ends_with('\n') || line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

void TextScanner::skip_line() {
  const std::size_t end = text_.find('\n', at_);
  at_ = end == std::string_view::npos ? text_.size() : end + 1;
}

std::string_view TextScanner::word(std::string_view what) {
  if (!skip_space()) fail_expected(what);
  const std::size_t begin = at_;
  while (at_ < text_.size() && !ends_word(text_[at_])) ++at_;
  return text_.substr(begin, at_ - begin);
}

template <class Number>
TextToken TextScanner::parse(std::string_view what, Number& value, const auto&... base) {
  if (!skip_space()) fail_expected(what);
  const char* const begin = text_.data() + at_;
  const char* const end = text_.data() + text_.size();
  // from_chars knows no plus sign.
  const char* const first = *begin == '+' ? begin + 1 : begin;
  const auto [last, error] = std::from_chars(first, end, value, base...);
  if (error != std::errc() || (last != end && !ends_word(*last) && *last != comment_) ||
      std::size_t(last - begin) > kLongestToken)
    fail_expected(what);
  const TextToken token{.place = at_, .length = std::uint64_t(last - begin)};
  at_ += std::size_t(last - begin);
  return token;
}

Index TextScanner::integer(std::string_view what) {
  Index value = 0;
  parse(what, value);
  return value;
}

Index TextScanner::hexadecimal(std::string_view what) {
  Index value = 0;
  parse(what, value, 16);
  return value;
}

double TextScanner::number(std::string_view what) {
  double value = 0;
  parse(what, value);
  return value;
}

TextToken TextScanner::number(std::string_view what, double& value) { return parse(what, value); }

Index TextScanner::count(std::string_view what, std::size_t least_bytes) {
  if (!skip_space()) fail_expected(what);
  const std::size_t place = at_;
  const Index count = integer(what);
  if (count < 0) fail_at(place, std::string(what) + " is negative: " + std::to_string(count));
  const std::size_t rest = text_.size() - at_;
  if (std::size_t(count) > (rest + least_bytes) / std::max<std::size_t>(least_bytes, 1))
    fail_at(place, std::string(what) + " is " + std::to_string(count) + ", but only " +
                       std::to_string(rest) +
                       " bytes follow: the file is cut off or the count wrong");
  return count;
}

Index TextScanner::index(std::string_view what, Index first, Index end) {
  if (!skip_space()) fail_expected(what);
  const std::size_t place = at_;
  const Index value = integer(what);
  if (value < first || value >= end)
    fail_at(place, std::string(what) + " " + std::to_string(value) + " is not in [" +
                       std::to_string(first) + ", " + std::to_string(end - 1) + "]");
  return value;
}

Index TextScanner::line_number(std::size_t place) const {
  const auto end = text_.begin() + std::ptrdiff_t(std::min(place, text_.size()));
  return 1 + std::count(text_.begin(), end, '\n');
}

void TextScanner::fail_at(std::size_t place, const std::string& why) const {
  fail_reading(path_, "line " + std::to_string(line_number(place)) + ": " + why);
}

void TextScanner::fail_expected(std::string_view what) const {
  constexpr std::size_t kShown = 40;
  std::size_t end = at_;
  while (end < text_.size() && !is_space(text_[end]) && end - at_ < kShown) ++end;
  std::string found(text_.substr(at_, end - at_));
  std::ranges::replace_if(
      found, [](unsigned char c) { return c < 32 || c > 126; }, '?');
  fail("expected " + std::string(what) + ", found " +
       (found.empty() ? "the end of the file" : "'" + found + "'"));
}

}  // namespace cadmorph
