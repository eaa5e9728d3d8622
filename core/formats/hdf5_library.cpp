#include "core/formats/hdf5_library.h"

#include <hdf5.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <type_traits>
#include <utility>

#include "core/errors.h"
#include "core/formats/mesh_format.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

/// An id of the library, given back at the end.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&&) = delete;

  hid_t get() const { return id_; }
  bool is_valid() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// A file can't hold much more than it is long, however it is compressed.
std::uint64_t largest_content(std::uint64_t size) {
  constexpr std::uint64_t kStrongestCompression = 1100;  // of deflate: 1032
  constexpr std::uint64_t kSmall = 1 << 24;
  return std::max(kSmall, size * kStrongestCompression);
}

/// What the library says of its last error, innermost first.
std::string last_error() {
  std::string text;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned, const H5E_error2_t* error, void* data) -> herr_t {
        auto& found = *static_cast<std::string*>(data);
        if (found.empty() && error->desc) found = error->desc;
        return 0;
      },
      &text);
  return text.empty() ? "" : " (HDF5: " + text + ")";
}

Handle open_file(const fs::path& path, unsigned mode) {
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // No other process writes to it, and some file systems have no locks.
  H5Pset_file_locking(access.get(), false, true);
  return {H5Fopen(path.c_str(), mode, access.get()), H5Fclose};
}

std::uint64_t size_of(const fs::path& path) {
  std::error_code error;
  const std::uint64_t size = fs::file_size(path, error);
  if (error) fail_reading(path, error.message());
  return size;
}

std::string trimmed(std::string text) {
  const auto end = text.find('\0');
  if (end != std::string::npos) text.resize(end);
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

/// The names of an object and of the groups that it lies in: "/a", "/a/b".
std::vector<std::string> steps_of(const std::string& object) {
  std::vector<std::string> steps;
  for (std::size_t at = 1; at < object.size();) {
    const std::size_t slash = std::min(object.find('/', at), object.size());
    if (slash > at) steps.push_back(object.substr(0, slash));
    at = slash + 1;
  }
  return steps;
}

std::optional<BinaryRun::Type> number_type(hid_t type) {
  if (H5Tequal(type, H5T_IEEE_F32LE) > 0 || H5Tequal(type, H5T_IEEE_F32BE) > 0)
    return BinaryRun::Type::Float32;
  if (H5Tequal(type, H5T_IEEE_F64LE) > 0 || H5Tequal(type, H5T_IEEE_F64BE) > 0)
    return BinaryRun::Type::Float64;
  return {};
}

}  // namespace

struct Hdf5Library::Impl {
  fs::path path;
  Handle file;
  std::uint64_t size = 0;

  hid_t id() const { return file.get(); }

  [[noreturn]] void fail(const std::string& object, const std::string& why) const {
    fail_reading(path, "'" + object + "': " + why);
  }

  /// Looks for the object step by step, so that no other file is opened.
  bool has(const std::string& object) const {
    for (const std::string& step : steps_of(object)) {
      if (H5Lexists(id(), step.c_str(), H5P_DEFAULT) <= 0) return false;
      H5L_info_t info;
      if (H5Lget_info(id(), step.c_str(), &info, H5P_DEFAULT) < 0)
        fail(step, "the link is damaged" + last_error());
      if (info.type == H5L_TYPE_EXTERNAL)
        fail(step, "it is a link to another file" + external_target(step, info.u.val_size) +
                       "; put all of the mesh into one file");
      if (H5Oexists_by_name(id(), step.c_str(), H5P_DEFAULT) <= 0) return false;
    }
    return true;
  }

  std::string external_target(const std::string& link, std::size_t size) const {
    std::string value(std::min<std::size_t>(size, 1 << 16), '\0');
    const char* name = nullptr;
    const char* object = nullptr;
    unsigned flags = 0;
    if (value.empty() ||
        H5Lget_val(id(), link.c_str(), value.data(), value.size(), H5P_DEFAULT) < 0 ||
        H5Lunpack_elink_val(value.data(), value.size(), &flags, &name, &object) < 0)
      return "";
    return std::string(" (") + name + ")";
  }

  Handle open_object(const std::string& object) const {
    if (!has(object)) fail(object, "it is missing");
    Handle handle(H5Oopen(id(), object.c_str(), H5P_DEFAULT), H5Oclose);
    if (!handle.is_valid()) fail(object, "it can't be opened" + last_error());
    return handle;
  }

  Handle open_dataset(const std::string& object) const {
    Handle handle = open_object(object);
    if (H5Iget_type(handle.get()) != H5I_DATASET) fail(object, "it is no dataset");
    return handle;
  }

  std::vector<Index> shape(hid_t space, const std::string& object) const {
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 0) fail(object, "its sizes can't be read" + last_error());
    std::vector<hsize_t> sizes(std::size_t(rank), 0);
    if (rank > 0 && H5Sget_simple_extent_dims(space, sizes.data(), nullptr) < 0)
      fail(object, "its sizes can't be read" + last_error());
    const std::uint64_t most = largest_content(size);
    std::uint64_t total = 1;
    for (const hsize_t length : sizes)
      if (__builtin_mul_overflow(total, std::max<hsize_t>(length, 1), &total) || total > most)
        fail(object, "it would have more values than the file can hold; the file is damaged");
    return {sizes.begin(), sizes.end()};
  }

  /// The number of values.
  std::size_t value_count(hid_t space, const std::string& object) const {
    if (H5Sget_simple_extent_type(space) == H5S_NULL) return 0;
    std::uint64_t total = 1;
    for (const Index size : shape(space, object)) total *= std::uint64_t(size);
    return total;
  }

  template <class Value>
  void read(const std::string& object, std::initializer_list<H5T_class_t> classes, const char* what,
            const TakeHdf5Piece<Value>& take) const {
    const Handle dataset = open_dataset(object);
    const Handle type(H5Dget_type(dataset.get()), H5Tclose);
    if (std::ranges::find(classes, H5Tget_class(type.get())) == classes.end())
      fail(object, std::string("it holds no ") + what);
    const Handle space(H5Dget_space(dataset.get()), H5Sclose);
    const Index total = Index(value_count(space.get(), object));
    if (total == 0) return;
    std::vector<Index> sizes = shape(space.get(), object);
    if (sizes.empty()) sizes = {1};
    const Index row = total / sizes[0];  // values in one row of the first dimension
    const Index most = rows_at_once(dataset.get(), sizes, row);
    std::vector<Value> values(std::size_t(std::min(most, sizes[0]) * row));
    const Handle transfer = transfer_of(values.size());
    for (Index begin = 0; begin < sizes[0]; begin += most) {
      const Index rows = std::min(most, sizes[0] - begin);
      if (rows < sizes[0]) select_rows(space.get(), begin, rows, sizes);
      const hsize_t count = hsize_t(rows * row);
      const Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
      const hid_t number = std::is_same_v<Value, Index> ? H5T_NATIVE_INT64 : H5T_NATIVE_DOUBLE;
      if (H5Dread(dataset.get(), number, memory.get(), space.get(), transfer.get(), values.data()) <
          0)
        fail(object, "it can't be read: it is damaged, or compressed in a way that is not known" +
                         last_error());
      take(total, std::span(values).first(std::size_t(count)));
    }
  }

  /// How so many numbers are read: with no larger buffer for their conversion than they need, of
  /// which the library clears the default, a megabyte, each time.
  static Handle transfer_of(std::size_t count) {
    constexpr std::size_t kDefault = 1 << 20, kLargestNumber = 16;
    Handle transfer(H5Pcreate(H5P_DATASET_XFER), H5Pclose);
    H5Pset_buffer(transfer.get(), std::min(kDefault, count * kLargestNumber), nullptr, nullptr);
    return transfer;
  }

  /// About a megabyte, and whole chunks, so that none is uncompressed twice.
  static Index rows_at_once(hid_t dataset, const std::vector<Index>& sizes, Index row) {
    constexpr Index kValues = 1 << 17;  // of 8 bytes
    const Handle made(H5Dget_create_plist(dataset), H5Pclose);
    std::vector<hsize_t> chunk(sizes.size(), 1);
    if (H5Pget_layout(made.get()) == H5D_CHUNKED)
      H5Pget_chunk(made.get(), int(chunk.size()), chunk.data());
    const Index step = std::clamp<Index>(Index(chunk[0]), 1, sizes[0]);
    return step * std::max<Index>(1, kValues / (step * row));
  }

  static void select_rows(hid_t space, Index begin, Index rows, const std::vector<Index>& sizes) {
    std::vector<hsize_t> start(sizes.size(), 0), count(sizes.begin(), sizes.end());
    start[0] = hsize_t(begin);
    count[0] = hsize_t(rows);
    H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
  }

  template <class Value>
  std::vector<Value> read_attribute(const std::string& object, const std::string& name,
                                    hid_t memory_type, std::initializer_list<H5T_class_t> classes,
                                    const char* what) const {
    const Handle attribute = open_attribute(object, name);
    const Handle type(H5Aget_type(attribute.get()), H5Tclose);
    if (std::ranges::find(classes, H5Tget_class(type.get())) == classes.end())
      fail(object, "its attribute '" + name + "' is no " + what);
    const Handle space(H5Aget_space(attribute.get()), H5Sclose);
    std::vector<Value> values(value_count(space.get(), object));
    if (!values.empty() && H5Aread(attribute.get(), memory_type, values.data()) < 0)
      fail(object, "its attribute '" + name + "' can't be read" + last_error());
    return values;
  }

  Handle open_attribute(const std::string& object, const std::string& name) const {
    const Handle owner = open_object(object);
    Handle attribute(H5Aopen(owner.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
    if (!attribute.is_valid()) fail(object, "its attribute '" + name + "' is missing");
    return attribute;
  }

  /// Strings of a variable or of a fixed length; `read` fills a buffer of the type it is given.
  std::vector<std::string> strings(hid_t type, hid_t space, const std::string& object,
                                   const std::function<herr_t(hid_t, void*)>& read) const {
    const std::size_t count = value_count(space, object);
    std::vector<std::string> result;
    if (count == 0) return result;
    if (H5Tis_variable_str(type) > 0) {
      const Handle memory(H5Tcopy(H5T_C_S1), H5Tclose);
      H5Tset_size(memory.get(), H5T_VARIABLE);
      H5Tset_cset(memory.get(), H5Tget_cset(type));
      std::vector<char*> values(count, nullptr);
      if (read(memory.get(), values.data()) < 0)
        fail(object, "its text can't be read" + last_error());
      for (const char* value : values) result.push_back(value ? trimmed(value) : "");
      H5Dvlen_reclaim(memory.get(), space, H5P_DEFAULT, values.data());
      return result;
    }
    const std::size_t size = H5Tget_size(type);
    std::string values(count * size, '\0');
    if (read(type, values.data()) < 0) fail(object, "its text can't be read" + last_error());
    for (std::size_t i = 0; i < count; ++i) result.push_back(values.substr(i * size, size));
    return result;
  }

  std::vector<Hdf5Extent> extents(const std::string& object) const {
    const Handle dataset = open_dataset(object);
    const Handle space(H5Dget_space(dataset.get()), H5Sclose);
    const std::vector<Index> sizes = shape(space.get(), object);
    const Index total =
        std::accumulate(sizes.begin(), sizes.end(), Index{1}, std::multiplies<Index>());
    const Handle made(H5Dget_create_plist(dataset.get()), H5Pclose);
    if (H5Pget_external_count(made.get()) > 0)
      fail(object, "its data are in another file; put all of the mesh into one file");
    switch (H5Pget_layout(made.get())) {
      case H5D_CONTIGUOUS: {
        const haddr_t place = H5Dget_offset(dataset.get());
        if (place == HADDR_UNDEF) return {};
        return {{.first = 0, .count = total, .place = place}};
      }
      case H5D_CHUNKED:
        return H5Pget_nfilters(made.get()) == 0
                   ? chunk_extents(dataset.get(), space.get(), made.get(), sizes)
                   : std::vector<Hdf5Extent>{};
      case H5D_VIRTUAL:
        fail(object, "its data are in other datasets; put them into one");
      default:
        return {};
    }
  }

  static std::vector<Hdf5Extent> chunk_extents(hid_t dataset, hid_t space, hid_t made,
                                               const std::vector<Index>& sizes) {
    std::vector<hsize_t> chunk(sizes.size());
    if (H5Pget_chunk(made, int(chunk.size()), chunk.data()) != int(sizes.size())) return {};
    Index row = 1;  // numbers in one row of the first dimension
    for (std::size_t d = 1; d < sizes.size(); ++d) {
      if (Index(chunk[d]) != sizes[d]) return {};
      row *= sizes[d];
    }
    hsize_t count = 0;
    if (H5Dget_num_chunks(dataset, space, &count) < 0) return {};
    std::vector<Hdf5Extent> extents;
    for (hsize_t i = 0; i < count; ++i) {
      std::vector<hsize_t> origin(sizes.size());
      unsigned mask = 0;
      haddr_t place = HADDR_UNDEF;
      hsize_t bytes = 0;
      if (H5Dget_chunk_info(dataset, space, i, origin.data(), &mask, &place, &bytes) < 0 ||
          place == HADDR_UNDEF || Index(origin[0]) >= sizes[0])
        return {};
      const Index rows = std::min(Index(chunk[0]), sizes[0] - Index(origin[0]));
      extents.push_back({.first = Index(origin[0]) * row, .count = rows * row, .place = place});
    }
    return extents;
  }
};

Hdf5Library::Hdf5Library(const fs::path& path, Mode mode) {
  // In a child process (see ChildProcess) the list of functions for the exit may be locked for
  // ever: by a thread of the parent's that the child has not.
  H5dont_atexit();
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const std::uint64_t size = size_of(path);
  Handle file = open_file(path, mode == Mode::Write ? H5F_ACC_RDWR : H5F_ACC_RDONLY);
  if (!file.is_valid())
    fail_reading(path, "it is no HDF5 file, or it is damaged or cut off" + last_error());
  impl_.reset(new Impl{.path = path, .file = std::move(file), .size = size});
}

Hdf5Library::~Hdf5Library() = default;

bool Hdf5Library::has(const std::string& object) const { return impl_->has(object); }

bool Hdf5Library::is_dataset(const std::string& object) const {
  if (!has(object)) return false;
  return H5Iget_type(impl_->open_object(object).get()) == H5I_DATASET;
}

std::vector<std::string> Hdf5Library::children(const std::string& group) const {
  const Handle handle = impl_->open_object(group);
  if (H5Iget_type(handle.get()) != H5I_GROUP) impl_->fail(group, "it is no group");
  const auto collect = [](hid_t, const char* name, const H5L_info_t*, void* data) -> herr_t {
    static_cast<std::vector<std::string>*>(data)->emplace_back(name);
    return 0;
  };
  std::vector<std::string> names;
  for (const H5_index_t order : {H5_INDEX_CRT_ORDER, H5_INDEX_NAME}) {
    names.clear();
    hsize_t at = 0;
    if (H5Literate(handle.get(), order, H5_ITER_INC, &at, collect, &names) >= 0) return names;
  }
  impl_->fail(group, "its members can't be listed" + last_error());
}

std::vector<Index> Hdf5Library::shape(const std::string& dataset) const {
  const Handle handle = impl_->open_dataset(dataset);
  const Handle space(H5Dget_space(handle.get()), H5Sclose);
  return impl_->shape(space.get(), dataset);
}

void Hdf5Library::integers(const std::string& dataset, const TakeHdf5Piece<Index>& take) const {
  impl_->read(dataset, {H5T_INTEGER}, "integers", take);
}

void Hdf5Library::numbers(const std::string& dataset, const TakeHdf5Piece<double>& take) const {
  impl_->read(dataset, {H5T_FLOAT, H5T_INTEGER}, "numbers", take);
}

bool Hdf5Library::is_integral(const std::string& dataset) const {
  const Handle handle = impl_->open_dataset(dataset);
  const Handle type(H5Dget_type(handle.get()), H5Tclose);
  return H5Tget_class(type.get()) == H5T_INTEGER;
}

std::vector<std::string> Hdf5Library::texts(const std::string& dataset) const {
  const Handle handle = impl_->open_dataset(dataset);
  const Handle type(H5Dget_type(handle.get()), H5Tclose);
  const Handle space(H5Dget_space(handle.get()), H5Sclose);
  const std::vector<Index> sizes = impl_->shape(space.get(), dataset);
  std::string all;
  std::size_t length = sizes.empty() ? 1 : std::size_t(sizes.back());
  if (H5Tget_class(type.get()) == H5T_ARRAY && H5Tdetect_class(type.get(), H5T_VLEN) <= 0) {
    length = H5Tget_size(type.get());
    for (const std::string& text :
         impl_->strings(type.get(), space.get(), dataset, [&](hid_t memory, void*values) {
           return H5Dread(handle.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values);
         }))
      all += text;
  } else if (H5Tget_class(type.get()) == H5T_STRING) {
    std::vector<std::string> strings =
        impl_->strings(type.get(), space.get(), dataset, [&](hid_t memory, void* values) {
          return H5Dread(handle.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values);
        });
    if (H5Tis_variable_str(type.get()) > 0 || H5Tget_size(type.get()) > 1) {
      for (std::string& text : strings) text = trimmed(std::move(text));
      return strings;
    }
    for (const std::string& text : strings) all += text;
  } else {
    integers(dataset, [&](Index, std::span<const Index> codes) {
      for (const Index code : codes) all += char(code);
    });
  }
  std::vector<std::string> result;
  for (std::size_t at = 0; length > 0 && at + length <= all.size(); at += length)
    result.push_back(trimmed(all.substr(at, length)));
  return result;
}

bool Hdf5Library::has_attribute(const std::string& object, const std::string& name) const {
  return H5Aexists(impl_->open_object(object).get(), name.c_str()) > 0;
}

std::vector<Index> Hdf5Library::integer_attribute(const std::string& object,
                                                  const std::string& name) const {
  return impl_->read_attribute<Index>(object, name, H5T_NATIVE_INT64, {H5T_INTEGER}, "integer");
}

std::vector<double> Hdf5Library::number_attribute(const std::string& object,
                                                  const std::string& name) const {
  return impl_->read_attribute<double>(object, name, H5T_NATIVE_DOUBLE, {H5T_FLOAT, H5T_INTEGER},
                                       "number");
}

std::string Hdf5Library::text_attribute(const std::string& object, const std::string& name) const {
  const Handle attribute = impl_->open_attribute(object, name);
  const Handle type(H5Aget_type(attribute.get()), H5Tclose);
  if (H5Tget_class(type.get()) != H5T_STRING)
    impl_->fail(object, "its attribute '" + name + "' is no text");
  const Handle space(H5Aget_space(attribute.get()), H5Sclose);
  std::string all;
  for (const std::string& text : impl_->strings(
           type.get(), space.get(), object,
           [&](hid_t memory, void*values) { return H5Aread(attribute.get(), memory, values); }))
    all += text;
  return trimmed(std::move(all));
}

Hdf5Number Hdf5Library::coordinate_type(const std::string& dataset) const {
  const Handle handle = impl_->open_dataset(dataset);
  const Handle type(H5Dget_type(handle.get()), H5Tclose);
  const std::optional<BinaryRun::Type> found = number_type(type.get());
  if (!found)
    impl_->fail(dataset, "it holds no coordinates: expected numbers of float32 or float64");
  return {.type = *found, .is_big_endian = H5Tget_order(type.get()) == H5T_ORDER_BE};
}

std::vector<Hdf5Extent> Hdf5Library::extents(const std::string& dataset) const {
  return impl_->extents(dataset);
}

void Hdf5Library::replace(const std::string& dataset, std::span<const Index> positions,
                          std::span<const double> values) const {
  std::vector<double> all;
  numbers(dataset, [&](Index, std::span<const double> piece) {
    all.insert(all.end(), piece.begin(), piece.end());
  });
  for (std::size_t i = 0; i < positions.size(); ++i) all.at(std::size_t(positions[i])) = values[i];
  const Handle handle = impl_->open_dataset(dataset);
  if (H5Dwrite(handle.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, all.data()) < 0)
    impl_->fail(dataset, "it can't be written" + last_error());
}

void Hdf5Library::flush() const {
  if (H5Fflush(impl_->id(), H5F_SCOPE_GLOBAL) < 0)
    fail_reading(impl_->path, "it can't be written" + last_error());
}

}  // namespace cadmorph
