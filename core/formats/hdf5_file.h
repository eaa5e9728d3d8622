#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/hdf5_library.h"
#include "core/formats/mesh_format.h"

namespace cadmorph {

/// Sure for an HDF5 file that has `mark` among its first bytes, or an object of such a name;
/// Possible for one that can't be read.
Recognition recognise_hdf5(const FileStart& start, const std::string& object,
                           std::string_view mark);

/// Makes the library run in this process from now on: for a fuzzer, which is to see where a reading
/// fails.
void read_without_process();

/// An HDF5 file open for reading. The library runs in a process of its own, for it crashes on some
/// damaged files: each member asks that process. Objects are named by their path ("/mesh/points").
/// Members throw IoError, naming the file and the object, for what is missing, damaged or of
/// another type or size than asked for; the library itself prints nothing.
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

  /// How a dataset of float32 or float64 is stored; others throw.
  Hdf5Number coordinate_type(const std::string& dataset) const;
  /// Where a dataset's numbers lie; nothing for one that is compressed, scattered or the like.
  std::vector<Hdf5Extent> extents(const std::string& dataset) const;

  /// Throws IoError: "can't read the mesh PATH: 'OBJECT': WHY".
  [[noreturn]] void fail(const std::string& object, const std::string& why) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
