#pragma once

#include <hdf5.h>

#include <filesystem>
#include <string>
#include <vector>

namespace cadmorph::test {

/// How a dataset is stored.
struct Storage {
  std::vector<hsize_t> shape;       ///< empty: one dimension
  std::vector<hsize_t> chunk = {};  ///< empty: contiguous
  bool is_compressed = false;
  hid_t type = -1;  ///< of the file; -1: that of the values
};

/// Makes HDF5 files for tests.
class Hdf5Writer {
 public:
  explicit Hdf5Writer(const std::filesystem::path& path);
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  hid_t file() const { return file_; }
  void group(const std::string& name);
  void numbers(const std::string& name, const std::vector<double>& values, Storage storage = {});
  void singles(const std::string& name, const std::vector<float>& values, Storage storage = {});
  void integers(const std::string& name, const std::vector<int>& values, Storage storage = {});
  void bytes(const std::string& name, const std::string& values, Storage storage = {});
  void attribute(const std::string& object, const std::string& name,
                 const std::vector<int>& values);
  /// A text of `length` characters; 0: as long as it is.
  void attribute(const std::string& object, const std::string& name, const std::string& text,
                 std::size_t length = 0);

 private:
  void write(const std::string& name, hid_t type, const void* values, std::size_t count,
             Storage storage);

  hid_t file_;
};

}  // namespace cadmorph::test
