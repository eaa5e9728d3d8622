#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/mesh_format.h"

namespace cadmorph {

/// Sure for an HDF5 file that has `mark` among its first bytes, or an object of such a name;
/// Possible for one that can't be read.
Recognition recognise_hdf5(const FileStart& start, const std::string& object,
                           std::string_view mark);

/// Calls `read` twice, first in a process of its own, and throws IoError when that one dies: the
/// HDF5 library crashes on some damaged files. Whatever reads an HDF5 file runs in it.
ReadMesh read_safely(const std::filesystem::path& path, const std::function<ReadMesh()>& read);

/// Makes read_safely and its like call once, in this process, from now on: for a fuzzer, which is
/// to see where a reading fails.
void read_without_trial();

/// Coordinates of one component in a dataset of float32 or float64: every `step`-th number, in
/// row-major order, from `first` on.
struct Hdf5Run {
  std::string dataset;
  Index first = 0;
  Index step = 1;
  Index count = 0;
  int component = 0;
  Index first_node = 0;
  std::vector<Index> nodes = {};  ///< of each number; empty: first_node and those that follow
};

/// An HDF5 file open for reading. Objects are named by their path ("/mesh/points"). Its members
/// throw IoError, naming the file and the object, for what is missing, damaged or of another type
/// or size than asked for; the library itself prints nothing.
class Hdf5File {
 public:
  explicit Hdf5File(const std::filesystem::path& path);
  ~Hdf5File();
  Hdf5File(Hdf5File&&) noexcept;
  Hdf5File& operator=(Hdf5File&&) noexcept;

  const std::filesystem::path& path() const;

  /// Whether there is such an object. A link to another file on the way is refused.
  bool has(const std::string& object) const;
  bool is_dataset(const std::string& object) const;
  /// Names of a group's members, in the order they were made where the file tells it, else by name.
  std::vector<std::string> children(const std::string& group) const;

  /// Sizes of a dataset; empty for a scalar.
  std::vector<Index> shape(const std::string& dataset) const;
  /// All its values, row-major, whatever their size and byte order in the file.
  std::vector<Index> integers(const std::string& dataset) const;
  std::vector<double> numbers(const std::string& dataset) const;
  /// A dataset of characters, bytes or strings, a row each (an array of characters: its last
  /// dimension), without the blanks and zeros at their ends.
  std::vector<std::string> texts(const std::string& dataset) const;
  bool is_integral(const std::string& dataset) const;

  bool has_attribute(const std::string& object, const std::string& name) const;
  std::vector<Index> integer_attribute(const std::string& object, const std::string& name) const;
  std::vector<double> number_attribute(const std::string& object, const std::string& name) const;
  std::string text_attribute(const std::string& object, const std::string& name) const;

  /// Reads the coordinates of `runs` into `points`, which has its rows (of a node with several, the
  /// last counts), and returns what copies the file. In a copy, numbers stored as they are
  /// (contiguous, or in uncompressed chunks of whole rows) are replaced in place, no other byte
  /// changes; a dataset stored otherwise (compressed) is written anew when a number in it changes.
  /// Cost: one reading of the whole file.
  std::unique_ptr<const MeshCopier> read_coordinates(const std::vector<Hdf5Run>& runs,
                                                     Points& points) const;

  /// Throws IoError: "can't read the mesh PATH: 'OBJECT': WHY".
  [[noreturn]] void fail(const std::string& object, const std::string& why) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
