#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/mesh_format.h"
#include "core/formats/source_file.h"
#include "core/formats/text_scanner.h"
#include "core/parallel.h"

namespace cadmorph {

/// How a deck writes the coordinates of a node in its record: the line, or the lines, of the node.
class NodeStyle {
 public:
  virtual ~NodeStyle() = default;

  /// Reads the coordinates; what is blank or missing is 0. Returns the text that is no number,
  /// empty where all is well.
  virtual std::string_view read(std::string_view record, Eigen::RowVector3d& point) const = 0;

  /// Appends the record with the coordinates of `is_changed` replaced. One that the record does
  /// not have is put in where it is larger than `least`.
  virtual void write(std::string_view record, const Eigen::RowVector3d& point,
                     const std::array<bool, 3>& is_changed, double least,
                     std::string& text) const = 0;
};

/// The coordinate system of a deck's nodes: rectangular, or cylindrical with angles in degrees.
struct NodeFrame {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< one a column
  Eigen::RowVector3d origin = Eigen::RowVector3d::Zero();
  bool is_cylindrical = false;

  bool is_basic() const { return !is_cylindrical && axes.isIdentity(0) && origin.isZero(0); }
  /// From the file's coordinates to those of the mesh.
  Eigen::RowVector3d to_mesh(const Eigen::RowVector3d& point) const;
  /// And back; angles as near as possible to that of `old_point`, the file's own.
  Eigen::RowVector3d to_file(const Eigen::RowVector3d& point,
                             const Eigen::RowVector3d& old_point) const;
};

/// The records of nodes that stand together.
struct NodeRecords {
  std::size_t file = 0;  ///< of DeckFiles
  std::shared_ptr<const NodeStyle> style;
  std::vector<NodeFrame> frames = {};  ///< from the file's outwards; empty: the mesh's own
  bool is_shared = false;              ///< other records are at the same places
  std::string owner = {};              ///< of shared ones: "instance A"
  std::vector<TextToken> places = {};
  std::vector<Index> nodes = {};  ///< one a place
};

/// A file of a deck: the main one first, then those that it includes.
struct DeckFile {
  SourceFile source;
  std::filesystem::path name;  ///< from the main file's folder; empty for that file
  std::vector<std::filesystem::path> others = {};  ///< where it was looked for before, in vain
};

/// Where something stands in a deck.
struct DeckPlace {
  std::uint64_t file : 16 = 0;
  std::uint64_t place : 48 = 0;

  bool operator==(const DeckPlace&) const = default;
};

/// The files of a deck while they are read. Names of included files start from the folder of the
/// main one.
class DeckSources {
 public:
  /// Reads the main file. Throws as read_source.
  explicit DeckSources(const std::filesystem::path& path);

  /// Reads an included file, named at `from`; one included before has the number it had.
  /// Backslashes are those of a name, or else of a path as Windows writes it. Throws IoError when
  /// it is missing, or includes itself.
  std::size_t include(const std::string& name, DeckPlace from);
  /// Included files that are not beside the main one are looked for in this folder, too.
  void add_folder(const std::filesystem::path& folder) { folders_.push_back(folder); }
  /// To be called where the reading of an included file ends.
  void leave() { open_.pop_back(); }

  std::string_view text(std::size_t file) const {
    const std::lock_guard lock(*mutex_);
    return texts_[file];
  }
  bool has_repeats() const { return has_repeats_; }
  /// Names of the included files that do not lie below the main one's folder: copies of the deck do
  /// not take them along.
  std::vector<std::string> left_behind() const;

  /// Throws IoError: "can't read the mesh FILE: line N: WHY".
  [[noreturn]] void fail(DeckPlace place, const std::string& why) const;
  /// The same: "expected WHAT, found '...'", with the first characters of what was found.
  [[noreturn]] void fail_expected(DeckPlace place, std::string_view what,
                                  std::string_view found) const;

  std::vector<DeckFile> take_files() && { return std::move(files_); }

 private:
  DeckFile find(const std::string& name, DeckPlace from) const;

  /// Blocks of one file are read while another is included.
  std::unique_ptr<std::mutex> mutex_ = std::make_unique<std::mutex>();
  std::vector<DeckFile> files_;
  std::vector<FileBytes> texts_;
  std::vector<std::size_t> open_ = {0};
  std::vector<std::filesystem::path> folders_ = {{}};  ///< of included files
  bool has_repeats_ = false;
};

/// The line of a text that begins at `at`, without its end, and the first one without a byte-order
/// mark; moves `at` to the next line.
std::string_view take_line(std::string_view text, std::size_t& at);

/// Bytes that a thread reads at a time: a millisecond or so.
inline constexpr std::size_t kTextBlock = 1 << 18;

/// Reads the lines of [begin, end) of a text block by block: `read` on any thread, `take` in the
/// order of the text, until it returns false. A Block has `begin` and `end`, its place in the text;
/// none begins at a line that `goes_on`, told by its place, says belongs to the one before.
template <class Block>
void read_blocks(std::string_view text, std::size_t begin, std::size_t end,
                 const std::function<bool(std::size_t place)>& goes_on,
                 const std::function<void(Block&)>& read, const std::function<bool(Block&)>& take) {
  std::vector<Block> blocks(std::size_t(2 * thread_count() + 2));
  std::atomic<bool> has_ended = false;
  const auto cut = [&](Index slot) {
    if (begin >= end || has_ended) return false;
    Block& block = blocks[std::size_t(slot)];
    block.begin = begin;
    std::size_t place = std::min(begin + kTextBlock, end);
    do {
      place = std::min(text.find('\n', place), end - 1) + 1;
    } while (place < end && goes_on(place));
    block.end = begin = place;
    return true;
  };
  parallel_pipeline(
      std::ssize(blocks), cut, [&](Index slot) { read(blocks[std::size_t(slot)]); },
      [&](Index slot) {
        if (!has_ended) has_ended = !take(blocks[std::size_t(slot)]);
      });
}

/// How many blocks like this one the text has behind it.
template <class Block>
double blocks_behind(std::string_view text, const Block& block) {
  return block.end > block.begin ? double(text.size() - block.end) / double(block.end - block.begin)
                                 : 0;
}

/// A copier for decks whose nodes stand in records of text. Included files are copied beside the
/// main one, by the names that the deck gives them; an output that would overwrite an included file
/// that holds nodes is refused.
std::unique_ptr<const MeshCopier> make_deck_copier(std::vector<DeckFile> files,
                                                   std::vector<NodeRecords> records);

}  // namespace cadmorph
