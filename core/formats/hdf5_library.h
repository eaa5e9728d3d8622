#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/formats/coordinate_places.h"
#include "core/mesh.h"

namespace cadmorph {

/// How a dataset's numbers are stored.
struct Hdf5Number {
  BinaryRun::Type type = BinaryRun::Type::Float64;
  bool is_big_endian = false;
};

/// Numbers of a dataset that lie in the file one after the other.
struct Hdf5Extent {
  Index first = 0;
  Index count = 0;
  std::uint64_t place = 0;
};

/// Takes the values of a dataset in row-major order, piece after piece; `total` is their number.
template <class Value>
using TakeHdf5Piece = std::function<void(Index total, std::span<const Value> piece)>;

/// A file opened with the HDF5 library, which crashes on some damaged files: see Hdf5File, whose
/// members ask those of the same name in another process. All throw IoError.
class Hdf5Library {
 public:
  enum class Mode { Read, Write };

  explicit Hdf5Library(const std::filesystem::path& path, Mode mode = Mode::Read);
  ~Hdf5Library();

  bool has(const std::string& object) const;
  bool is_dataset(const std::string& object) const;
  std::vector<std::string> children(const std::string& group) const;

  std::vector<Index> shape(const std::string& dataset) const;
  void integers(const std::string& dataset, const TakeHdf5Piece<Index>& take) const;
  void numbers(const std::string& dataset, const TakeHdf5Piece<double>& take) const;
  std::vector<std::string> texts(const std::string& dataset) const;
  bool is_integral(const std::string& dataset) const;

  bool has_attribute(const std::string& object, const std::string& name) const;
  std::vector<Index> integer_attribute(const std::string& object, const std::string& name) const;
  std::vector<double> number_attribute(const std::string& object, const std::string& name) const;
  std::string text_attribute(const std::string& object, const std::string& name) const;

  /// Throws for a dataset of others than float32 and float64.
  Hdf5Number coordinate_type(const std::string& dataset) const;
  /// Where a dataset's numbers lie; nothing for one that is compressed, scattered or the like.
  std::vector<Hdf5Extent> extents(const std::string& dataset) const;

  /// Writes a dataset of numbers anew, with `values` at `positions` (row-major).
  void replace(const std::string& dataset, std::span<const Index> positions,
               std::span<const double> values) const;
  /// Brings what was written to the file.
  void flush() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
