#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/coordinate_places.h"
#include "core/formats/face_cells.h"
#include "core/formats/text_scanner.h"

namespace cadmorph {

/// A file of OpenFOAM, text or binary: its header, and what follows read item by item. An error
/// names the file and the line, or the byte of binary data.
class FoamFile {
 public:
  /// Reads the file and its header. Throws IoError.
  explicit FoamFile(const std::filesystem::path& path) : FoamFile(path, read_source(path)) {}

  bool is_binary() const { return is_binary_; }
  const std::string& class_name() const { return class_; }
  const SourceFile& source() const { return source_; }

  /// Skips white space and comments, and `punctuation` if it follows.
  bool take(char punctuation) {
    if (!skip_space() || bytes_[at_] != punctuation) return false;
    ++at_;
    return true;
  }
  void expect(char punctuation, std::string_view after_what);
  /// A word, or what stands in quotation marks.
  std::string word(std::string_view what);
  /// A number of [first, end).
  Index label(std::string_view what, Index first, Index end);

  /// A list of at most `most` labels of [first, end).
  std::vector<Index> labels(std::string_view what, Index most, Index first, Index end);
  /// A list of points, and where their coordinates stand.
  Points points(CoordinatePlaces& places);
  /// A list of faces whose nodes are in [0, nodes), in the form that the header's class tells.
  FaceList faces(Index nodes);

  /// Skips the rest of an entry of a dictionary.
  void skip_value();

  [[noreturn]] void fail(const std::string& why) const { fail_at(at_, why); }

 private:
  FoamFile(const std::filesystem::path& path, SourceBytes file);
  void read_header();
  void read_architecture(const std::string& text);
  static bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
  void skip_blanks() {
    while (at_ < bytes_.size() && is_space(bytes_[at_])) ++at_;
  }
  /// White space and comments; false at the end of the file.
  bool skip_space() {
    skip_blanks();
    return at_ < bytes_.size() && (bytes_[at_] != '/' || skip_comments());
  }
  bool skip_comments();
  void skip_comment();
  bool is_at_number() const;
  /// At a number: of a text all threads read ahead.
  TextScanner& scanner();
  TextToken coordinate(double& value);
  [[noreturn]] void fail_range(Index value, std::size_t place, std::string_view what, Index first,
                               Index end) const;
  /// The number `name` before a list of items, each of at least `least_bytes`; -1: it is not there.
  Index list_count(std::string_view name, std::size_t least_bytes);
  /// Begins a list of binary items: the place of the first. The one after the last is next.
  std::size_t binary_items(std::string_view what, Index count, std::size_t size);
  void skip_binary_list(const std::string& type);
  Index load_label(std::size_t place) const;
  Points text_points(Index count, TextPlaces& places);
  FaceList compact_faces(Index nodes);

  [[noreturn]] void fail_at(std::size_t place, const std::string& why) const;
  [[noreturn]] void fail_at_byte(std::size_t place, const std::string& why) const;
  [[noreturn]] void fail_expected(std::string_view what) const;

  std::filesystem::path path_;
  FileBytes contents_;
  std::string_view bytes_;  ///< of contents_
  SourceFile source_;
  TextScanner scanner_;  ///< of the numbers of a text
  std::size_t at_ = 0;
  std::string class_;
  bool is_binary_ = false;
  bool is_big_endian_ = false;
  std::size_t label_bytes_ = 4, scalar_bytes_ = 8;
};

}  // namespace cadmorph
