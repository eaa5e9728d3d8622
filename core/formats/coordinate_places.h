#pragma once

#include <functional>
#include <memory>
#include <span>
#include <variant>
#include <vector>

#include "core/formats/mesh_format.h"
#include "core/formats/source_file.h"
#include "core/formats/text_scanner.h"

namespace cadmorph {

/// Writes a coordinate in the style of its file, in place of the characters `original`; appends to
/// `text`. What it appends, read again, is the value, or the nearest that the file's columns hold.
using NumberWriter = void (*)(double value, std::string_view original, std::string& text);

/// The fewest digits that read back as the same double ("0.1", "-3e-07").
void write_shortest(double value, std::string_view original, std::string& text);

/// Where the coordinates stand in a text.
struct TextPlaces {
  int components = 3;  ///< 2: x and y alone; all nodes lie, and stay, in a plane of z
  std::vector<TextToken>
      tokens;  ///< row after row, `components` each; of length 0: not in the file
  std::vector<Index> nodes = {};  ///< the node of each row; empty: row i is of node i
  NumberWriter write = write_shortest;
  /// Reads what `write` wrote, for formats with narrow columns; null: every double is kept.
  double (*read_back)(std::string_view text) = nullptr;
};

/// Numbers of one component at equal distances in a binary file.
struct BinaryRun {
  enum class Type { Float32, Float64 };
  std::uint64_t place = 0;  ///< byte of the first
  std::uint64_t stride = 0;
  Index count = 0;
  int component = 0;
  Type type = Type::Float64;
  bool is_big_endian = false;
  Index first_node = 0;
  std::vector<Index> nodes = {};  ///< of each number; empty: first_node and those that follow
  double scale = 1;               ///< the coordinate is the number times this
};

/// Where the coordinates stand in a binary file; a component that no run has stays.
struct BinaryPlaces {
  std::vector<BinaryRun> runs;
};

/// The runs of a file in the order of their places: a file may have very many.
class RunsByPlace {
 public:
  /// `places` must outlive it.
  explicit RunsByPlace(const BinaryPlaces& places);

  /// Those that may have bytes of [begin, end); the ones around `begin` when that is `end`. None of
  /// them is left out; others are among them only where the runs' reaches overlap. O(log runs).
  std::span<const BinaryRun* const> over(std::uint64_t begin, std::uint64_t end) const;

 private:
  std::vector<const BinaryRun*> runs_;
  std::vector<std::uint64_t> ends_;  ///< the farthest of those up to each
};

using CoordinatePlaces = std::variant<TextPlaces, BinaryPlaces>;

/// Reads the coordinates of `runs` out of a file's bytes into `points`, which has its rows. Throws
/// IoError (naming `path`) when they reach beyond the end.
void read_runs(std::string_view bytes, const BinaryPlaces& places,
               const std::filesystem::path& path, Points& points);

/// Replaces the coordinates that differ between `before` and `after`.
void replace_coordinates(std::span<char> bytes, const BinaryPlaces& places, const Points& before,
                         const Points& after);

/// Writes a copy of the file in which they are replaced; whatever no run has stays. Throws IoError,
/// leaving nothing behind.
void write_places(const SourceFile& source, const BinaryPlaces& places, const Points& before,
                  const Points& after, const std::filesystem::path& target);

/// Throws InvalidInputError when a component would change that no run has.
void check_components(const BinaryPlaces& places, const Points& before, const Points& after);

/// Writes a copy of the file in which only the coordinates that differ between `before` and `after`
/// are other characters or bytes. Throws IoError, leaving nothing behind; InvalidInputError when a
/// coordinate that the file does not have would change.
void write_copy(const SourceFile& source, const CoordinatePlaces& places, const Points& before,
                const Points& after, const std::filesystem::path& target);

/// See MeshCopier::readable.
Points readable_points(const CoordinatePlaces& places, const Points& before, const Points& after);

/// A copier for a format of one file with its coordinates at such places.
std::unique_ptr<const MeshCopier> make_copier(SourceFile source, CoordinatePlaces places);

}  // namespace cadmorph
