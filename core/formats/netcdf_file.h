#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/formats/mesh_format.h"

namespace cadmorph {

/// Coordinates of one component in a variable: `count` numbers from `first` on, of nodes 0, 1, ...
struct NetcdfRun {
  std::string variable;
  Index first = 0;
  Index count = 0;
  int component = 0;
};

/// A netCDF file: classic, with 64-bit offsets, CDF-5, or netCDF-4 (which is HDF5). Members throw
/// IoError, naming the variable, for what is missing, damaged or of another type than asked for.
class NetcdfFile {
 public:
  virtual ~NetcdfFile() = default;

  virtual bool has(const std::string& variable) const = 0;
  virtual std::vector<Index> shape(const std::string& variable) const = 0;
  /// All values, row-major.
  virtual std::vector<Index> integers(const std::string& variable) const = 0;
  /// The rows of an array of characters, without the blanks and zeros at their ends.
  virtual std::vector<std::string> texts(const std::string& variable) const = 0;
  /// Empty where the variable has no such text.
  virtual std::string text_attribute(const std::string& variable,
                                     const std::string& name) const = 0;

  /// Reads the coordinates of `runs` into `points` and returns what copies the file.
  virtual std::unique_ptr<const MeshCopier> read_coordinates(const std::vector<NetcdfRun>& runs,
                                                             Points& points) const = 0;

  [[noreturn]] void fail(const std::string& variable, const std::string& why) const;

 protected:
  explicit NetcdfFile(std::filesystem::path path) : path_(std::move(path)) {}

  std::filesystem::path path_;
};

/// Whether a file begins as one of netCDF but netCDF-4.
bool is_classic_netcdf(const FileStart& start);

/// Opens a file. Throws IoError.
std::unique_ptr<const NetcdfFile> open_netcdf(const std::filesystem::path& path);

}  // namespace cadmorph
