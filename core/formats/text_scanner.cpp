#include "core/formats/text_scanner.h"

#include <algorithm>
#include <charconv>

#include "core/formats/mesh_format.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_space(char c) { return is_blank(c) || c == '\n' || c == '\r' || c == '\f' || c == '\v'; }

constexpr std::size_t kLongestToken = 0xffff;

// What a thread reads ahead at once, and how many of these: they stay in the cache.
constexpr std::size_t kAheadBlock = 1 << 16;
constexpr Index kAheadBlocks = 16;
constexpr Index kNumbersBefore = 1000;  // after which many more are likely

/// Reads an integer of at most 18 digits; 0 characters when it is none, or "-0", a real number.
std::size_t read_short_integer(const char* begin, const char* end, std::int64_t& value) {
  constexpr std::ptrdiff_t kDigits = 18;  // no overflow
  const bool has_sign = *begin == '-' || *begin == '+';
  const char* const first = begin + (has_sign ? 1 : 0);
  const char* at = first;
  std::int64_t number = 0;
  for (; at < end && *at >= '0' && *at <= '9' && at - first < kDigits; ++at)
    number = 10 * number + (*at - '0');
  if (at == first || (*begin == '-' && number == 0)) return 0;
  value = *begin == '-' ? -number : number;
  return std::size_t(at - begin);
}

}  // namespace

TextScanner::TextScanner(std::string_view text, std::filesystem::path path, char comment,
                         std::string_view separators)
    : text_(text), path_(std::move(path)), comment_(comment) {
  for (const char c : std::string_view(" \t\n\r\f\v"))
    ends_word_[static_cast<unsigned char>(c)] = true;
  for (const char c : separators) ends_word_[static_cast<unsigned char>(c)] = true;
}

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

/// The next word, if it was read ahead; after many numbers reads ahead.
const TextScanner::Ahead* TextScanner::next_ahead() {
  if (numbers_read_ >= kNumbersBefore && at_ >= ahead_end_) read_ahead();
  for (; ahead_block_ < ahead_.size(); ++ahead_block_, ahead_word_ = 0) {
    const std::vector<Ahead>& words = ahead_[ahead_block_];
    for (; ahead_word_ < words.size(); ++ahead_word_) {
      const TextToken token = words[ahead_word_].token;
      if (at_ <= token.place) return at_ >= ahead_from_ ? &words[ahead_word_] : nullptr;
      ahead_from_ = token.place + token.length;
    }
  }
  return nullptr;
}

/// Where a block that reaches to `place` ends, outside of words and comments;
/// npos where that is far.
std::size_t TextScanner::block_end(std::size_t place) const {
  const std::string_view near = text_.substr(0, std::min(text_.size(), place + kAheadBlock));
  if (place >= near.size()) return near.size();
  const std::size_t end = comment_ ? near.find('\n', place) : near.find_first_of(" \t\n", place);
  if (end != std::string_view::npos) return end + 1;
  return near.size() == text_.size() ? text_.size() : std::string_view::npos;
}

void TextScanner::read_ahead() {
  ahead_.resize(std::size_t(kAheadBlocks));
  std::array<std::size_t, std::size_t(kAheadBlocks) + 1> starts{at_};
  for (std::size_t block = 1; block < starts.size(); ++block) {
    const std::size_t end = block_end(at_ + block * kAheadBlock);
    starts[block] = end != std::string_view::npos ? end : starts[block - 1];
  }
  parallel_for(kAheadBlocks, 1, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const auto block = std::size_t(i);
      ahead_[block].clear();
      read_words(starts[block], starts[block + 1], ahead_[block]);
    }
  });
  ahead_block_ = ahead_word_ = 0;
  ahead_from_ = at_;
  ahead_end_ = starts.back();
  if (ahead_end_ == at_) numbers_read_ = 0;
}

void TextScanner::read_words(std::size_t begin, std::size_t end, std::vector<Ahead>& words) const {
  const char* const text = text_.data();
  const char* const text_end = text + text_.size();
  const auto ends = [&](const char* at) {
    return at == text_end || ends_word(*at) || *at == comment_;
  };
  for (std::size_t at = begin; at < end;) {
    if (is_space(text[at])) {
      ++at;
      continue;
    }
    if (comment_ && text[at] == comment_) {
      at = std::min(text_.find('\n', at), end);
      continue;
    }
    Ahead word;
    std::int64_t integer = 0;
    double real = 0;
    std::size_t length = read_short_integer(text + at, text_end, integer);
    if (length > 0 && ends(text + at + length)) {
      word.integer = integer;
      word.kind = Ahead::Kind::Integer;
    } else {
      const char* const first = text + at + (text[at] == '+' ? 1 : 0);
      const auto [last, error] = std::from_chars(first, text_end, real);
      length = std::size_t(last - (text + at));
      if (error == std::errc() && ends(last) && length <= kLongestToken) {
        word.real = real;
        word.kind = Ahead::Kind::Real;
      } else {
        const bool is_separator = ends_word(text[at]);
        for (length = 1; !is_separator && at + length < end && !ends(text + at + length);) ++length;
      }
    }
    word.token = {.place = at, .length = std::min(length, kLongestToken)};
    words.push_back(word);
    at += length;
  }
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
  ++numbers_read_;
  return token;
}

/// Goes behind the word that is next of those read ahead.
void TextScanner::take_ahead(const Ahead& word) {
  at_ = ahead_from_ = word.token.place + word.token.length;
  ++ahead_word_;
}

Index TextScanner::integer(std::string_view what) {
  if (const Ahead* ahead = next_ahead(); ahead && ahead->kind == Ahead::Kind::Integer) {
    take_ahead(*ahead);
    return ahead->integer;
  }
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
  number(what, value);
  return value;
}

TextToken TextScanner::number(std::string_view what, double& value) {
  if (const Ahead* ahead = next_ahead(); ahead && ahead->kind != Ahead::Kind::Other) {
    take_ahead(*ahead);
    value = ahead->kind == Ahead::Kind::Real ? ahead->real : double(ahead->integer);
    return ahead->token;
  }
  return parse(what, value);
}

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
