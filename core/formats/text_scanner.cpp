#include "core/formats/text_scanner.h"

#include <algorithm>
#include <charconv>

#include "core/byte_order_mark.h"
#include "core/formats/mesh_format.h"

namespace cadmorph {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }

// The most that TextToken's and Ahead's lengths hold; numbers have some twenty characters.
constexpr std::size_t kLongestToken = 0xffff, kLongestAhead = 0x3fff;

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
    : text_(text), path_(std::move(path)), comment_(comment), at_(byte_order_mark_size(text)) {
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

/// After many numbers reads ahead.
const TextScanner::Ahead* TextScanner::find_ahead() {
  if (at_ >= part_.end && (numbers_read_ < kNumbersBefore || !read_ahead())) return nullptr;
  while (true) {
    while (ahead_ != ahead_last_ && ahead_->place < at_) ++ahead_;
    if (ahead_ != ahead_last_) break;
    if (ahead_block_ == part_.blocks.size()) return nullptr;
    const std::vector<Ahead>& block = part_.blocks[ahead_block_++];
    ahead_ = block.data();
    ahead_last_ = ahead_ + block.size();
  }
  const std::string_view between = text_.substr(at_, ahead_->place - at_);
  return std::ranges::all_of(between, is_space) ? ahead_ : nullptr;
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

/// Goes on to the part of the text that was read ahead, and has the one after it read. False where
/// none begins here.
bool TextScanner::read_ahead() {
  if (!reading_) reading_ = std::make_unique<BackgroundLoop>();
  reading_->wait();
  if (at_ < next_part_.begin || at_ >= next_part_.end) {
    start_reading(at_, next_part_);
    reading_->wait();
  }
  std::swap(part_, next_part_);
  ahead_ = ahead_last_ = nullptr;
  ahead_block_ = 0;
  start_reading(part_.end, next_part_);
  if (at_ >= part_.end) numbers_read_ = 0;
  return at_ < part_.end;
}

void TextScanner::start_reading(std::size_t begin, AheadPart& part) {
  std::vector<std::size_t> ends;
  part.begin = part.end = begin;
  for (Index block = 1; block <= kAheadBlocks; ++block) {
    const std::size_t end = block_end(begin + std::size_t(block) * kAheadBlock);
    if (end != std::string_view::npos && end > part.end) ends.push_back(part.end = end);
  }
  part.blocks.resize(ends.size());
  reading_->start(std::ssize(ends), [this, &part, ends](Index i) {
    const auto block = std::size_t(i);
    part.blocks[block].clear();
    read_numbers(block == 0 ? part.begin : ends[block - 1], ends[block], part.blocks[block]);
  });
}

void TextScanner::read_numbers(std::size_t begin, std::size_t end,
                               std::vector<Ahead>& numbers) const {
  const char* const text = text_.data();
  const char* const text_end = text + text_.size();
  const auto ends = [&](const char* at) {
    return at == text_end || ends_word(*at) || *at == comment_;
  };
  bool is_next = false;
  for (std::size_t at = begin; at < end;) {
    if (ends_word(text[at])) {
      is_next = is_next && is_space(text[at]);
      ++at;
      continue;
    }
    if (comment_ && text[at] == comment_) {
      at = std::min(text_.find('\n', at), end);
      is_next = false;
      continue;
    }
    Ahead number;
    number.place = at;
    number.is_next = is_next;
    std::int64_t integer = 0;
    double real = 0;
    std::size_t length = read_short_integer(text + at, text_end, integer);
    bool is_number = length > 0 && ends(text + at + length);
    if (is_number) {
      number.integer = integer;
    } else {
      const char* const first = text + at + (text[at] == '+' ? 1 : 0);
      const auto [last, error] = std::from_chars(first, text_end, real);
      length = std::size_t(last - (text + at));
      is_number = error == std::errc() && ends(last) && length <= kLongestAhead;
      number.is_real = 1;
      number.real = real;
    }
    if (is_number) {
      number.length = length;
      numbers.push_back(number);
      is_next = true;
    } else {
      is_next = false;
      for (length = 1; at + length < end && !ends(text + at + length);) ++length;
    }
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

TextToken TextScanner::parse_number(std::string_view what, double& value) {
  return parse(what, value);
}

Index TextScanner::parse_integer(std::string_view what) {
  Index value = 0;
  parse(what, value);
  return value;
}

Index TextScanner::hexadecimal(std::string_view what) {
  Index value = 0;
  parse(what, value, 16);
  return value;
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

void TextScanner::fail_range(std::size_t before, std::string_view what, Index value, Index first,
                             Index end) {
  fail_behind(before, std::string(what) + " " + std::to_string(value) + " is not in [" +
                          std::to_string(first) + ", " + std::to_string(end - 1) + "]");
}

Index TextScanner::line_number(std::size_t place) const {
  const auto end = text_.begin() + std::ptrdiff_t(std::min(place, text_.size()));
  return 1 + std::count(text_.begin(), end, '\n');
}

void TextScanner::fail_at(std::size_t place, const std::string& why) const {
  fail_reading(path_, "line " + std::to_string(line_number(place)) + ": " + why);
}

void TextScanner::fail_behind(std::size_t place, const std::string& why) {
  at_ = place;
  skip_space();
  fail(why);
}

void TextScanner::fail_expected(std::string_view what) const {
  constexpr std::size_t kShown = 40;  // characters: a number or word whole, half of a line
  std::size_t end = at_;
  while (end < text_.size() && !is_space(text_[end]) && end - at_ < kShown) ++end;
  std::string found(text_.substr(at_, end - at_));
  std::ranges::replace_if(
      found, [](unsigned char c) { return c < 32 || c > 126; }, '?');
  fail("expected " + std::string(what) + ", found " +
       (found.empty() ? "the end of the file" : "'" + found + "'"));
}

}  // namespace cadmorph
