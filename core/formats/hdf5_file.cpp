#include "core/formats/hdf5_file.h"

#include <fcntl.h>
#include <hdf5.h>
#include <limits.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <functional>
#include <numeric>
#include <optional>
#include <utility>

#include "core/errors.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/source_file.h"
#include "core/temporary_file.h"

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

/// Whether a file begins as one of HDF5: its mark stands at 0, or behind a block of the user's.
bool is_hdf5(std::string_view bytes) {
  for (std::size_t place = 0; place + 8 <= bytes.size();
       place = std::max<std::size_t>(512, 2 * place))
    if (bytes.substr(place, 8) == "\x89HDF\r\n\x1a\n") return true;
  return false;
}

/// A file can't hold much more than it is long, however it is compressed.
std::uint64_t largest_content(std::uint64_t size) {
  constexpr std::uint64_t kStrongestCompression = 1100;  // of deflate: 1032
  constexpr std::uint64_t kSmall = 1 << 24;
  return std::max(kSmall, size * kStrongestCompression);
}

void silence() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

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

/// Set in a process that tries a reading (see read_safely).
bool is_trial = false;
bool has_trials = true;

enum class Outcome { Done, False, Threw, Died };

/// Calls `action` in a process of its own: HDF5 1.10 runs into invalid memory on some damaged
/// files, or comes to no end. `error`, if not null, gets the text of what it threw: a file that the
/// library complains of may leave it damaged, and is not to be read again here.
Outcome try_out(std::uint64_t file_size, const std::function<bool()>& action,
                std::string* error = nullptr) {
  if (is_trial || !has_trials) return action() ? Outcome::Done : Outcome::False;
  int pipe_ends[2] = {-1, -1};
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) return Outcome::Died;
  const pid_t child = fork();
  if (child == 0) {
    is_trial = true;
    constexpr rlim_t kSeconds = 20, kBytesASecond = 1 << 22;
    const rlim_t seconds = kSeconds + file_size / kBytesASecond;
    const rlimit no_core{0, 0}, time{seconds, seconds};
    setrlimit(RLIMIT_CORE, &no_core);
    setrlimit(RLIMIT_CPU, &time);
    for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU})
      std::signal(fault, SIG_DFL);
    if (const int nothing = open("/dev/null", O_WRONLY); nothing >= 0) dup2(nothing, STDERR_FILENO);
    Outcome outcome = Outcome::Threw;
    try {
      outcome = action() ? Outcome::Done : Outcome::False;
    } catch (const std::exception& failure) {
      // What fits into a pipe that nobody reads yet.
      const std::string_view text = std::string_view(failure.what()).substr(0, PIPE_BUF);
      if (write(pipe_ends[1], text.data(), text.size()) < 0) outcome = Outcome::Died;
    }
    _exit(int(outcome));
  }
  close(pipe_ends[1]);
  char text[PIPE_BUF];
  ssize_t size = 0;
  while ((size = ::read(pipe_ends[0], text, sizeof text)) > 0 || (size < 0 && errno == EINTR))
    if (error && size > 0) error->append(text, std::size_t(size));
  close(pipe_ends[0]);
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return child > 0 && WIFEXITED(status) ? Outcome(WEXITSTATUS(status)) : Outcome::Died;
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

std::optional<BinaryRun::Type> number_type(hid_t type, bool& is_big_endian) {
  is_big_endian = H5Tget_order(type) == H5T_ORDER_BE;
  if (H5Tequal(type, H5T_IEEE_F32LE) > 0 || H5Tequal(type, H5T_IEEE_F32BE) > 0)
    return BinaryRun::Type::Float32;
  if (H5Tequal(type, H5T_IEEE_F64LE) > 0 || H5Tequal(type, H5T_IEEE_F64BE) > 0)
    return BinaryRun::Type::Float64;
  return {};
}

/// Numbers of a dataset that lie in the file one after the other.
struct Extent {
  Index first = 0;
  Index count = 0;
  std::uint64_t place = 0;
};

}  // namespace

struct Hdf5File::Impl {
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
  std::vector<Value> read(const std::string& object, hid_t memory_type,
                          std::initializer_list<H5T_class_t> classes, const char* what) const {
    const Handle dataset = open_dataset(object);
    const Handle type(H5Dget_type(dataset.get()), H5Tclose);
    if (std::ranges::find(classes, H5Tget_class(type.get())) == classes.end())
      fail(object, std::string("it holds no ") + what);
    const Handle space(H5Dget_space(dataset.get()), H5Sclose);
    std::vector<Value> values(value_count(space.get(), object));
    if (!values.empty() &&
        H5Dread(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
      fail(object, "it can't be read: it is damaged, or compressed in a way that is not known" +
                       last_error());
    return values;
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

  BinaryRun::Type coordinate_type(const std::string& object, bool& is_big_endian) const {
    const Handle dataset = open_dataset(object);
    const Handle type(H5Dget_type(dataset.get()), H5Tclose);
    const std::optional<BinaryRun::Type> found = number_type(type.get(), is_big_endian);
    if (!found) fail(object, "it holds no coordinates: expected numbers of float32 or float64");
    return *found;
  }

  /// Where a dataset's numbers lie; nothing for one that is compressed, scattered or the like.
  std::vector<Extent> extents(const std::string& object) const {
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
        return H5Pget_nfilters(made.get()) == 0 ? chunk_extents(dataset.get(), made.get(), sizes)
                                                : std::vector<Extent>{};
      case H5D_VIRTUAL:
        fail(object, "its data are in other datasets; put them into one");
      default:
        return {};
    }
  }

  static std::vector<Extent> chunk_extents(hid_t dataset, hid_t made,
                                           const std::vector<Index>& sizes) {
    std::vector<hsize_t> chunk(sizes.size());
    if (H5Pget_chunk(made, int(chunk.size()), chunk.data()) != int(sizes.size())) return {};
    Index row = 1;  // numbers in one row of the first dimension
    for (std::size_t d = 1; d < sizes.size(); ++d) {
      if (Index(chunk[d]) != sizes[d]) return {};
      row *= sizes[d];
    }
    hsize_t count = 0;
    if (H5Dget_num_chunks(dataset, H5S_ALL, &count) < 0) return {};
    std::vector<Extent> extents;
    for (hsize_t i = 0; i < count; ++i) {
      std::vector<hsize_t> origin(sizes.size());
      unsigned mask = 0;
      haddr_t place = HADDR_UNDEF;
      hsize_t bytes = 0;
      if (H5Dget_chunk_info(dataset, H5S_ALL, i, origin.data(), &mask, &place, &bytes) < 0 ||
          place == HADDR_UNDEF || Index(origin[0]) >= sizes[0])
        return {};
      const Index rows = std::min(Index(chunk[0]), sizes[0] - Index(origin[0]));
      extents.push_back({.first = Index(origin[0]) * row, .count = rows * row, .place = place});
    }
    return extents;
  }
};

namespace {

/// A run in a dataset that HDF5 has to write.
struct RewrittenRun {
  std::string dataset;
  BinaryRun run;  ///< its place and stride count numbers, not bytes
};

struct Part {
  BinaryRun run;
  Index first = 0, step = 1;  ///< of its numbers in the dataset
};

/// The part of `run` whose numbers lie in `extent`; nothing where there is none.
std::optional<Part> part_in(const Hdf5Run& run, const Extent& extent, BinaryRun::Type type,
                            bool is_big_endian) {
  const auto step_to = [&](Index number) {  // the first i with first + i * step >= number
    return number <= run.first ? 0 : (number - run.first + run.step - 1) / run.step;
  };
  const Index begin = step_to(extent.first);
  const Index end = std::min(run.count, step_to(extent.first + extent.count));
  if (begin >= end) return {};
  const std::uint64_t size = type == BinaryRun::Type::Float32 ? sizeof(float) : sizeof(double);
  BinaryRun part{
      .place = extent.place + std::uint64_t(run.first + begin * run.step - extent.first) * size,
      .stride = std::uint64_t(run.step) * size,
      .count = end - begin,
      .component = run.component,
      .type = type,
      .is_big_endian = is_big_endian,
      .first_node = run.first_node + begin};
  if (!run.nodes.empty()) part.nodes.assign(run.nodes.begin() + begin, run.nodes.begin() + end);
  return Part{.run = std::move(part), .first = run.first + begin * run.step, .step = run.step};
}

/// Whether the bytes at the places of `part` are the values that the library gave.
bool lies_there(const Part& part, const std::vector<double>& values, std::string_view bytes,
                const fs::path& path) {
  if (part.run.place > bytes.size()) return false;
  BinaryRun run = part.run;
  run.nodes.clear();
  run.first_node = 0;
  run.component = 0;
  Points found(run.count, 3);
  read_runs(bytes, {{run}}, path, found);
  for (Index i = 0; i < run.count; ++i)
    if (found(i, 0) != values[std::size_t(part.first + i * part.step)]) return false;
  return true;
}

template <class Number>
bool rewrite(hid_t dataset, hid_t type, std::size_t count, std::span<const RewrittenRun> runs,
             const Points& before, const Points& after) {
  std::vector<Number> numbers(count);
  if (H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()) < 0) return false;
  for (const auto& [name, run] : runs)
    for (Index i = 0; i < run.count; ++i) {
      const Index node = run.nodes.empty() ? run.first_node + i : run.nodes[std::size_t(i)];
      const double value = after(node, run.component);
      if (value == before(node, run.component)) continue;
      numbers[run.place + std::uint64_t(i) * run.stride] = Number(value);
    }
  return H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()) >= 0;
}

class Hdf5Copier : public MeshCopier {
 public:
  Hdf5Copier(SourceFile source, BinaryPlaces places, std::vector<RewrittenRun> rewritten)
      : source_(std::move(source)), places_(std::move(places)), rewritten_(std::move(rewritten)) {
    all_ = places_;
    for (const RewrittenRun& run : rewritten_) all_.runs.push_back(run.run);
  }

  void write(const fs::path& target, const Points& before, const Points& after) const override {
    check_components(all_, before, after);
    const bool is_rewritten = std::ranges::any_of(
        rewritten_, [&](const RewrittenRun& run) { return has_changed(run.run, before, after); });
    if (!is_rewritten) return write_places(source_, places_, before, after, target);
    FileBytes bytes = read_again(source_);
    replace_coordinates({bytes.data(), bytes.size()}, places_, before, after);
    TemporaryFile file(target);
    file.write(bytes.data(), bytes.size(), 0);
    if (try_out(bytes.size(), [&] { return rewrite_datasets(file.path(), before, after); }) !=
        Outcome::Done)
      fail_writing(target, "HDF5 can't write its coordinates anew; it may be damaged");
    file.commit();
  }
  Points readable(const Points& before, const Points& after) const override {
    return readable_points(all_, before, after);
  }

 private:
  static bool has_changed(const BinaryRun& run, const Points& before, const Points& after) {
    for (Index i = 0; i < run.count; ++i) {
      const Index node = run.nodes.empty() ? run.first_node + i : run.nodes[std::size_t(i)];
      if (before(node, run.component) != after(node, run.component)) return true;
    }
    return false;
  }

  bool rewrite_datasets(const fs::path& path, const Points& before, const Points& after) const {
    silence();
    const Handle file = open_file(path, H5F_ACC_RDWR);
    if (!file.is_valid()) return false;
    for (std::size_t begin = 0, end = 0; begin < rewritten_.size(); begin = end) {
      const std::string& name = rewritten_[begin].dataset;
      while (end < rewritten_.size() && rewritten_[end].dataset == name) ++end;
      if (!rewrite_dataset(file.get(), std::span(rewritten_).subspan(begin, end - begin), before,
                           after))
        return false;
    }
    return H5Fflush(file.get(), H5F_SCOPE_GLOBAL) >= 0;
  }

  static bool rewrite_dataset(hid_t file, std::span<const RewrittenRun> runs, const Points& before,
                              const Points& after) {
    const Handle dataset(H5Dopen2(file, runs.front().dataset.c_str(), H5P_DEFAULT), H5Dclose);
    if (!dataset.is_valid()) return false;
    const Handle space(H5Dget_space(dataset.get()), H5Sclose);
    const std::size_t count = std::size_t(H5Sget_simple_extent_npoints(space.get()));
    return runs.front().run.type == BinaryRun::Type::Float32
               ? rewrite<float>(dataset.get(), H5T_NATIVE_FLOAT, count, runs, before, after)
               : rewrite<double>(dataset.get(), H5T_NATIVE_DOUBLE, count, runs, before, after);
  }

  SourceFile source_;
  BinaryPlaces places_;
  std::vector<RewrittenRun> rewritten_;  ///< those of a dataset one after the other
  BinaryPlaces all_;                     ///< both, for all but their places
};

}  // namespace

Recognition recognise_hdf5(const FileStart& start, const std::string& object,
                           std::string_view mark) {
  if (start.is_folder || !is_hdf5(start.bytes)) return Recognition::No;
  if (start.bytes.find(mark) != std::string::npos) return Recognition::Sure;
  const Outcome outcome =
      try_out(size_of(start.path), [&] { return Hdf5File(start.path).has(object); });
  return outcome == Outcome::Done    ? Recognition::Sure
         : outcome == Outcome::False ? Recognition::No
                                     : Recognition::Possible;
}

void read_without_trial() { has_trials = false; }

ReadMesh read_safely(const fs::path& path, const std::function<ReadMesh()>& read) {
  if (!has_trials) return read();
  std::string error;
  const auto try_reading = [&] {
    read();
    return true;
  };
  const Outcome outcome = try_out(size_of(path), try_reading, &error);
  if (outcome == Outcome::Threw) throw IoError(error);
  if (outcome != Outcome::Done)
    fail_reading(path, "it is damaged: the HDF5 library fails on it; copy or write it again");
  return read();
}

Hdf5File::Hdf5File(const fs::path& path) {
  silence();
  const std::uint64_t size = size_of(path);
  Handle file = open_file(path, H5F_ACC_RDONLY);
  if (!file.is_valid())
    fail_reading(path, "it is no HDF5 file, or it is damaged or cut off" + last_error());
  impl_.reset(new Impl{.path = path, .file = std::move(file), .size = size});
}

Hdf5File::~Hdf5File() = default;
Hdf5File::Hdf5File(Hdf5File&&) noexcept = default;
Hdf5File& Hdf5File::operator=(Hdf5File&&) noexcept = default;

const fs::path& Hdf5File::path() const { return impl_->path; }

bool Hdf5File::has(const std::string& object) const { return impl_->has(object); }

bool Hdf5File::is_dataset(const std::string& object) const {
  if (!has(object)) return false;
  return H5Iget_type(impl_->open_object(object).get()) == H5I_DATASET;
}

std::vector<std::string> Hdf5File::children(const std::string& group) const {
  const Handle handle = impl_->open_object(group);
  if (H5Iget_type(handle.get()) != H5I_GROUP) fail(group, "it is no group");
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
  fail(group, "its members can't be listed" + last_error());
}

std::vector<Index> Hdf5File::shape(const std::string& dataset) const {
  const Handle handle = impl_->open_dataset(dataset);
  const Handle space(H5Dget_space(handle.get()), H5Sclose);
  return impl_->shape(space.get(), dataset);
}

std::vector<Index> Hdf5File::integers(const std::string& dataset) const {
  return impl_->read<Index>(dataset, H5T_NATIVE_INT64, {H5T_INTEGER}, "integers");
}

std::vector<double> Hdf5File::numbers(const std::string& dataset) const {
  return impl_->read<double>(dataset, H5T_NATIVE_DOUBLE, {H5T_FLOAT, H5T_INTEGER}, "numbers");
}

bool Hdf5File::is_integral(const std::string& dataset) const {
  const Handle handle = impl_->open_dataset(dataset);
  const Handle type(H5Dget_type(handle.get()), H5Tclose);
  return H5Tget_class(type.get()) == H5T_INTEGER;
}

std::vector<std::string> Hdf5File::texts(const std::string& dataset) const {
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
    for (const Index code : integers(dataset)) all += char(code);
  }
  std::vector<std::string> result;
  for (std::size_t at = 0; length > 0 && at + length <= all.size(); at += length)
    result.push_back(trimmed(all.substr(at, length)));
  return result;
}

bool Hdf5File::has_attribute(const std::string& object, const std::string& name) const {
  return H5Aexists(impl_->open_object(object).get(), name.c_str()) > 0;
}

std::vector<Index> Hdf5File::integer_attribute(const std::string& object,
                                               const std::string& name) const {
  return impl_->read_attribute<Index>(object, name, H5T_NATIVE_INT64, {H5T_INTEGER}, "integer");
}

std::vector<double> Hdf5File::number_attribute(const std::string& object,
                                               const std::string& name) const {
  return impl_->read_attribute<double>(object, name, H5T_NATIVE_DOUBLE, {H5T_FLOAT, H5T_INTEGER},
                                       "number");
}

std::string Hdf5File::text_attribute(const std::string& object, const std::string& name) const {
  const Handle attribute = impl_->open_attribute(object, name);
  const Handle type(H5Aget_type(attribute.get()), H5Tclose);
  if (H5Tget_class(type.get()) != H5T_STRING)
    fail(object, "its attribute '" + name + "' is no text");
  const Handle space(H5Aget_space(attribute.get()), H5Sclose);
  std::string all;
  for (const std::string& text : impl_->strings(
           type.get(), space.get(), object,
           [&](hid_t memory, void*values) { return H5Aread(attribute.get(), memory, values); }))
    all += text;
  return trimmed(std::move(all));
}

std::unique_ptr<const MeshCopier> Hdf5File::read_coordinates(const std::vector<Hdf5Run>& runs,
                                                             Points& points) const {
  const SourceBytes source = is_trial ? SourceBytes{} : read_source(path());
  BinaryPlaces places;
  std::vector<RewrittenRun> rewritten;
  std::string name;
  Index size = 0;
  std::vector<double> values;
  std::vector<Extent> extents;
  BinaryRun::Type type{};
  bool is_big_endian = false;
  for (const Hdf5Run& run : runs) {
    if (run.count == 0) continue;
    if (run.dataset != name) {
      name = run.dataset;
      type = impl_->coordinate_type(name, is_big_endian);
      values = numbers(name);
      size = std::ssize(values);
      extents = impl_->extents(name);
    }
    const Index last = run.first + (run.count - 1) * run.step;
    if (last >= size)
      fail(name, "it has " + std::to_string(size) + " numbers, too few for the coordinates of " +
                     std::to_string(run.count) + " nodes");
    for (Index i = 0; i < run.count; ++i) {
      const Index node = run.nodes.empty() ? run.first_node + i : run.nodes[std::size_t(i)];
      points(node, run.component) = values[std::size_t(run.first + i * run.step)];
    }
    BinaryPlaces parts;
    Index count = 0;
    for (const Extent& extent : extents)
      if (std::optional<Part> part = part_in(run, extent, type, is_big_endian)) {
        if (!lies_there(*part, values, source.bytes, path())) break;
        count += part->run.count;
        parts.runs.push_back(std::move(part->run));
      }
    if (count == run.count)
      std::ranges::move(parts.runs, std::back_inserter(places.runs));
    else
      rewritten.push_back({name,
                           {.place = std::uint64_t(run.first),
                            .stride = std::uint64_t(run.step),
                            .count = run.count,
                            .component = run.component,
                            .type = type,
                            .first_node = run.first_node,
                            .nodes = run.nodes}});
  }
  return std::make_unique<Hdf5Copier>(source.source, std::move(places), std::move(rewritten));
}

void Hdf5File::fail(const std::string& object, const std::string& why) const {
  impl_->fail(object, why);
}

}  // namespace cadmorph
