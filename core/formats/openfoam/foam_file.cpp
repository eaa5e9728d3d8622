#include "core/formats/openfoam/foam_file.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr Index kNoLimit = std::numeric_limits<std::int64_t>::max();

constexpr std::string_view kPunctuation = "(){}[];\"/";  // and the slash of comments

bool is_punctuation(char c) { return c != '/' && kPunctuation.find(c) != std::string_view::npos; }

}  // namespace

FoamFile::FoamFile(const fs::path& path, SourceBytes file)
    : path_(path),
      contents_(std::move(file.bytes)),
      bytes_(contents_),
      source_(std::move(file.source)),
      scanner_(bytes_, path, 0, kPunctuation) {
  read_header();
}

void FoamFile::read_header() {
  if (!skip_space() || word("the header 'FoamFile'") != "FoamFile")
    fail("it does not begin with the header 'FoamFile { ... }' of OpenFOAM's files");
  expect('{', "'FoamFile'");
  while (!take('}')) {
    const std::string key = word("an entry of the header, or '}'");
    if (key == "format") {
      const std::string format = word("the format");
      if (format != "ascii" && format != "binary")
        fail("the format is '" + format + "', neither ascii nor binary");
      is_binary_ = format == "binary";
    } else if (key == "class") {
      class_ = word("the class");
    } else if (key == "arch") {
      read_architecture(word("the architecture"));
    }
    skip_value();
  }
  if (class_ == "decomposedBlockData")
    fail(
        "it is in OpenFOAM's collated form, which is not supported; write the case with "
        "'-fileHandler uncollated' first");
}

/// For example "LSB;label=32;scalar=64".
void FoamFile::read_architecture(const std::string& text) {
  is_big_endian_ = text.starts_with("MSB");
  const auto bytes = [&](const std::string& key, std::size_t usual) {
    const std::size_t at = text.find(key);
    if (at == std::string::npos) return usual;
    const std::string bits = text.substr(at + key.size(), 2);
    if (bits != "32" && bits != "64")
      fail("the architecture '" + text + "' has numbers of neither 32 nor 64 bits");
    return bits == "32" ? std::size_t{4} : std::size_t{8};
  };
  label_bytes_ = bytes("label=", 4);
  scalar_bytes_ = bytes("scalar=", 8);
}

bool FoamFile::skip_comments() {
  while (at_ < bytes_.size() && bytes_[at_] == '/') {
    skip_comment();
    skip_blanks();
  }
  return at_ < bytes_.size();
}

void FoamFile::skip_comment() {
  const std::string_view text = bytes_;
  const char kind = at_ + 1 < text.size() ? text[at_ + 1] : ' ';
  if (kind != '/' && kind != '*') fail("a '/' that begins no comment");
  const std::size_t end = text.find(kind == '/' ? "\n" : "*/", at_ + 2);
  if (end == std::string_view::npos && kind == '*') fail("the comment '/*' has no end");
  at_ = std::min(text.size(), end == std::string_view::npos ? end : end + (kind == '/' ? 1 : 2));
}

void FoamFile::expect(char punctuation, std::string_view after_what) {
  if (!take(punctuation))
    fail_expected("'" + std::string(1, punctuation) + "' after " + std::string(after_what));
}

std::string FoamFile::word(std::string_view what) {
  if (!skip_space()) fail_expected(what);
  const std::size_t begin = at_;
  if (bytes_[at_] == '"') {
    const std::size_t end = bytes_.find('"', begin + 1);
    if (end == std::string::npos) fail("the text in quotation marks has no end");
    at_ = end + 1;
    return std::string(bytes_.substr(begin + 1, end - begin - 1));
  }
  // Names of patches may have brackets: "List<word>", "patch(1)".
  int depth = 0;
  for (; at_ < bytes_.size() && !is_space(bytes_[at_]); ++at_) {
    const char c = bytes_[at_];
    if (c == '(' && at_ > begin) ++depth;
    if (c == ')' && depth > 0)
      --depth;
    else if (is_punctuation(c) && depth == 0)
      break;
  }
  if (depth > 0) at_ = bytes_.find('(', begin);  // of a list that follows
  if (at_ == begin) fail_expected(what);
  if (bytes_[begin] == '#')
    fail("'" + std::string(bytes_.substr(begin, at_ - begin)) +
         "' is not followed here; write the file out in full");
  return std::string(bytes_.substr(begin, at_ - begin));
}

bool FoamFile::is_at_number() const {
  return at_ < bytes_.size() && bytes_[at_] >= '0' && bytes_[at_] <= '9';
}

TextScanner& FoamFile::scanner() {
  skip_space();
  if (is_binary_)
    scanner_.go_to(at_);
  else
    scanner_.pass(at_);
  return scanner_;
}

TextToken FoamFile::coordinate(double& value) {
  const TextToken token = scanner().number("a coordinate", value);
  at_ = scanner_.place();
  return token;
}

void FoamFile::fail_range(Index value, std::size_t place, std::string_view what, Index first,
                          Index end) const {
  const std::string range =
      end == kNoLimit ? "less than " + std::to_string(first)
                      : "not in [" + std::to_string(first) + ", " + std::to_string(end - 1) + "]";
  fail_at(place, std::string(what) + " " + std::to_string(value) + " is " + range);
}

Index FoamFile::label(std::string_view what, Index first, Index end) {
  const Index value = scanner().integer(what);
  const std::size_t place = std::exchange(at_, scanner_.place());
  if (value < first || value >= end) fail_range(value, place, what, first, end);
  return value;
}

Index FoamFile::list_count(std::string_view name, std::size_t least_bytes) {
  skip_space();
  if (!is_at_number()) return -1;
  const std::size_t place = at_;
  const Index count = label(name, 0, kNoLimit);
  const std::size_t rest = bytes_.size() - at_;
  if (std::size_t(count) > rest / least_bytes)
    fail_at(place, std::string(name) + " is " + std::to_string(count) + ", but only " +
                       std::to_string(rest) +
                       " bytes follow: the file is cut off or the number wrong");
  return count;
}

std::size_t FoamFile::binary_items(std::string_view what, Index count, std::size_t size) {
  expect('(', what);
  const std::size_t begin = at_;
  const std::size_t end = begin + std::size_t(count) * size;
  if (std::size_t(count) > bytes_.size() / size || end >= bytes_.size() || bytes_[end] != ')')
    fail_at_byte(begin, "expected " + std::to_string(count) + " " + std::string(what) + " of " +
                            std::to_string(size) +
                            " bytes each and then ')': the file is cut off, or of another "
                            "architecture than its header says");
  at_ = end + 1;
  return begin;
}

Index FoamFile::load_label(std::size_t place) const {
  const auto load = [&](auto bits) {
    std::memcpy(&bits, bytes_.data() + place, sizeof bits);
    if ((std::endian::native == std::endian::big) != is_big_endian_) {
      auto* const bytes = reinterpret_cast<char*>(&bits);
      std::reverse(bytes, bytes + sizeof bits);
    }
    return Index(bits);
  };
  return label_bytes_ == 4 ? load(std::int32_t{}) : load(std::int64_t{});
}

std::vector<Index> FoamFile::labels(std::string_view what, Index most, Index first, Index end) {
  if (skip_space() && bytes_[at_] == 'L') word(what);  // List<label>
  skip_space();
  const std::size_t place = at_;
  const std::string name = "the number of " + std::string(what);
  Index count = -1;
  if (is_at_number()) count = label(name, 0, kNoLimit);
  if (count > most)
    fail_at(place, name + " is " + std::to_string(count) + ", more than " + std::to_string(most));
  std::vector<Index> values;
  if (count > 0 && take('{')) {
    values.assign(std::size_t(count), label(what, first, end));
    expect('}', what);
  } else if (count > 0 && is_binary_) {
    const std::size_t begin = binary_items(what, count, label_bytes_);
    values.resize(std::size_t(count));
    for (Index i = 0; i < count; ++i) {
      const std::size_t item = begin + std::size_t(i) * label_bytes_;
      values[i] = load_label(item);
      if (values[i] < first || values[i] >= end) {
        const std::string range = std::to_string(first) + ", " + std::to_string(end - 1);
        fail_at_byte(item, std::string(what) + ": " + std::to_string(values[i]) + " is not in [" +
                               range + "]");
      }
    }
  } else if (count != 0 || !is_binary_) {
    expect('(', count < 0 ? "nothing else" : name);
    values.reserve(std::size_t(std::clamp<Index>(count, 0, std::ssize(bytes_) / 2)));
    while (!take(')')) {
      if (std::ssize(values) == (count < 0 ? most : count)) fail_expected("')' after " + name);
      values.push_back(label(what, first, end));
    }
    if (count >= 0 && std::ssize(values) != count)
      fail("there are " + std::to_string(values.size()) + " " + std::string(what) + ", not " +
           std::to_string(count));
  }
  return values;
}

Points FoamFile::text_points(Index count, TextPlaces& places) {
  Points points(count, 3);
  places.tokens.reserve(3 * std::size_t(count));
  for (Index i = 0; i < count; ++i) {
    expect('(', "the points before");
    for (int c = 0; c < 3; ++c) places.tokens.push_back(coordinate(points(i, c)));
    expect(')', "three coordinates");
  }
  return points;
}

Points FoamFile::points(CoordinatePlaces& places) {
  const Index count = list_count("the number of points", is_binary_ ? 3 * scalar_bytes_ : 7);
  if (count < 0) fail_expected("the number of points");
  if (!is_binary_) {
    expect('(', "the number of points");
    Points result = text_points(count, places.emplace<TextPlaces>());
    expect(')', std::to_string(count) + " points");
    return result;
  }
  BinaryPlaces& binary = places.emplace<BinaryPlaces>();
  if (count == 0) return {};
  const std::size_t begin = binary_items("points", count, 3 * scalar_bytes_);
  for (int c = 0; c < 3; ++c)
    binary.runs.push_back(
        {.place = begin + std::size_t(c) * scalar_bytes_,
         .stride = 3 * scalar_bytes_,
         .count = count,
         .component = c,
         .type = scalar_bytes_ == 4 ? BinaryRun::Type::Float32 : BinaryRun::Type::Float64,
         .is_big_endian = is_big_endian_});
  Points result(count, 3);
  read_runs(bytes_, binary, path_, result);
  return result;
}

FaceList FoamFile::faces(Index nodes) {
  if (class_ == "faceCompactList") return compact_faces(nodes);
  FaceList faces;
  const Index count = list_count("the number of faces", 5);
  if (count < 0) fail_expected("the number of faces");
  constexpr Index kUsual = 4;  // nodes of a face, by which memory is reserved; not a limit
  faces.offsets.reserve(std::size_t(count) + 1);
  faces.nodes.reserve(std::size_t(kUsual * count));
  expect('(', "the number of faces");
  for (Index f = 0; f < count; ++f) {
    if (is_binary_) {
      faces.add_face(labels("nodes of a face", nodes, 0, nodes));
    } else {
      const Index size = list_count("the number of nodes of a face", 2);
      expect('(', "the number of nodes of a face");
      for (Index i = 0; i < size; ++i) faces.nodes.push_back(label("node", 0, nodes));
      if (!take(')')) fail_expected("')' after " + std::to_string(size) + " nodes of a face");
      faces.offsets.push_back(std::ssize(faces.nodes));
    }
    if (faces.face(f).size() < 3) fail("face " + std::to_string(f) + " has fewer than 3 nodes");
  }
  expect(')', std::to_string(count) + " faces");
  return faces;
}

FaceList FoamFile::compact_faces(Index nodes) {
  FaceList faces;
  const Index most = std::ssize(bytes_);  // a label takes a byte at least
  faces.offsets = labels("places of faces", most, 0, most + 1);
  faces.nodes = labels("nodes of faces", most, 0, nodes);
  if (faces.offsets.empty() || faces.offsets.front() != 0 ||
      faces.offsets.back() != std::ssize(faces.nodes))
    fail("the places of the faces do not go from 0 to the number of their nodes, " +
         std::to_string(faces.nodes.size()));
  for (Index f = 0; f < faces.count(); ++f)
    if (faces.offsets[f + 1] < faces.offsets[f] + 3)
      fail("face " + std::to_string(f) + " has fewer than 3 nodes");
  return faces;
}

/// A list in a dictionary; items that are no numbers stand as text in a binary file, too.
void FoamFile::skip_binary_list(const std::string& type) {
  const std::size_t size = type == "List<label>"                             ? label_bytes_
                           : type == "List<bool>"                            ? 1
                           : type == "List<scalar>"                          ? scalar_bytes_
                           : type == "List<vector>" || type == "List<point>" ? 3 * scalar_bytes_
                                                                             : 0;
  if (size == 0) return;
  const Index count = list_count("items", 1);
  if (count <= 0 || !skip_space() || bytes_[at_] == '{') return;
  binary_items("items", count, size);
}

void FoamFile::skip_value() {
  const bool is_dictionary = skip_space() && bytes_[at_] == '{';
  for (Index depth = 0;;) {
    if (!skip_space()) fail_expected("';'");
    const char c = bytes_[at_];
    if (c == '(' || c == '{' || c == '[') {
      ++depth;
      ++at_;
    } else if (c == ')' || c == '}' || c == ']') {
      if (--depth < 0) fail_expected("';'");
      ++at_;
      if (depth == 0 && is_dictionary) return;
    } else if (c == ';') {
      ++at_;
      if (depth == 0) return;
    } else if (is_at_number()) {
      while (at_ < bytes_.size() && !is_space(bytes_[at_]) &&
             kPunctuation.find(bytes_[at_]) == std::string_view::npos)
        ++at_;
    } else {
      const std::string value = word("a value");
      if (is_binary_ && value.starts_with("List<")) skip_binary_list(value);
    }
  }
}

void FoamFile::fail_at(std::size_t place, const std::string& why) const {
  const auto end = bytes_.begin() + std::ptrdiff_t(std::min(place, bytes_.size()));
  const auto line = 1 + std::count(bytes_.begin(), end, '\n');
  fail_reading(path_, "line " + std::to_string(line) + ": " + why);
}

void FoamFile::fail_at_byte(std::size_t place, const std::string& why) const {
  fail_reading(path_, "byte " + std::to_string(place) + ": " + why);
}

void FoamFile::fail_expected(std::string_view what) const {
  constexpr std::size_t kShown = 40;  // characters: a number or word whole, half of a line
  std::size_t end = at_;
  while (end < bytes_.size() && !is_space(bytes_[end]) && end - at_ < kShown) ++end;
  std::string found(bytes_.substr(at_, end - at_));
  std::ranges::replace_if(
      found, [](unsigned char c) { return c < 32 || c > 126; }, '?');
  fail("expected " + std::string(what) + ", found " +
       (found.empty() ? "the end of the file" : "'" + found + "'"));
}

}  // namespace cadmorph
