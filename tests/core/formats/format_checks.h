#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/mesh_file.h"

namespace cadmorph::test {

/// A folder for the files of one test, gone with it.
class FormatFolder {
 public:
  FormatFolder();
  ~FormatFolder();
  FormatFolder(const FormatFolder&) = delete;
  FormatFolder& operator=(const FormatFolder&) = delete;

  /// Writes a file and returns its path.
  std::filesystem::path put(const std::string& name, std::string_view bytes) const;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

std::string bytes_of(const std::filesystem::path& path);

/// Every byte of a folder's files, by name: what two folders are compared by.
std::string tree_of(const std::filesystem::path& folder);

/// An affine map that no reader, and no rounding to few digits, can mistake for another.
Points affine(const Points& points);
/// The same in the plane of z = constant.
Points plane_affine(const Points& points);

/// Requires the same cells, groups, ties and regions.
void require_same_contents(const Mesh& a, const Mesh& b);

/// Requires what every format promises of the file (or folder) `path`:
/// - with the same coordinates a copy has the same bytes;
/// - with one node moved, that node alone reads back elsewhere, exactly where it was moved to;
/// - moved by an affine map, every node reads back within `tolerance` (0: to the last bit) of the
///   largest coordinate, with the same cells, groups and regions; nothing else in the file changes,
///   which the way back shows: coordinates restored to the old values give a file that reads as the
///   old one;
/// - a text is read behind a byte-order mark, too, which the copy keeps.
/// `out` names the copy, in a format's own spelling ("out.su2").
void require_promise(const std::filesystem::path& path, const FormatFolder& folder,
                     const std::string& out, double tolerance = 0);

/// Requires that the file cut off at each of many lengths, and with single bytes changed, is read
/// or refused by an Error, never anything else; that at least one of the cut ones is refused, and
/// that all refusals name the file.
void require_robust(const std::filesystem::path& path, const FormatFolder& folder);

/// The same of a file in the folder `path` that is read as one mesh.
void require_robust_folder(const std::filesystem::path& path, const std::string& file,
                           const FormatFolder& folder);

/// Requires that reading the file throws an Error whose text has all of `parts`.
void require_refused(const std::filesystem::path& path, std::initializer_list<std::string> parts);

}  // namespace cadmorph::test
