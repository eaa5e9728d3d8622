#include "core/formats/netcdf_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <map>

#include "core/formats/coordinate_places.h"
#include "core/formats/hdf5_coordinates.h"
#include "core/formats/source_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

std::string trimmed(std::string text) {
  text.resize(std::min(text.find('\0'), text.size()));
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

/// The classic format: a header, then each variable's numbers in big-endian order.
class ClassicFile : public NetcdfFile {
 public:
  explicit ClassicFile(const fs::path& path) : NetcdfFile(path), file_(read_source(path)) {
    version_ = bytes(3, 1)[0];
    at_ = 4;
    size_word();  // the number of records
    read_dimensions();
    read_attributes();
    read_variables();
  }

  bool has(const std::string& variable) const override { return variables_.contains(variable); }
  std::vector<Index> shape(const std::string& variable) const override {
    return find(variable).shape;
  }

  std::vector<Index> integers(const std::string& name) const override {
    const Variable& variable = find(name);
    switch (variable.type) {
      case kInt:
        return values<std::int32_t, std::uint32_t>(name);
      case kInt64:
        return values<std::int64_t, std::uint64_t>(name);
      case kShort:
        return values<std::int16_t, std::uint16_t>(name);
      default:
        fail(name, "it holds no integers");
    }
  }

  std::vector<std::string> texts(const std::string& name) const override {
    const Variable& variable = find(name);
    if (variable.type != kChar) fail(name, "it holds no characters");
    const std::string_view all = data(name);
    const std::size_t length = variable.shape.empty() ? 1 : std::size_t(variable.shape.back());
    std::vector<std::string> rows;
    for (std::size_t at = 0; length > 0 && at + length <= all.size(); at += length)
      rows.push_back(trimmed(std::string(all.substr(at, length))));
    return rows;
  }

  std::string text_attribute(const std::string& variable, const std::string& name) const override {
    const auto& attributes = find(variable).texts;
    const auto found = attributes.find(name);
    return found == attributes.end() ? "" : found->second;
  }

  std::unique_ptr<const MeshCopier> read_coordinates(const std::vector<NetcdfRun>& runs,
                                                     Points& points) const override {
    BinaryPlaces places;
    for (const NetcdfRun& run : runs) {
      const Variable& variable = find(run.variable);
      const std::uint64_t size = variable.type == kDouble ? 8 : 4;
      if (variable.type != kDouble && variable.type != kFloat)
        fail(run.variable, "it holds no coordinates: expected float or double");
      if (std::uint64_t(run.first + run.count) * size > data(run.variable).size())
        fail(run.variable, "it has too few numbers for " + std::to_string(run.count) + " nodes");
      places.runs.push_back(
          {.place = variable.begin + std::uint64_t(run.first) * size,
           .stride = size,
           .count = run.count,
           .component = run.component,
           .type = size == 8 ? BinaryRun::Type::Float64 : BinaryRun::Type::Float32,
           .is_big_endian = true});
    }
    read_runs(file_.bytes, places, path_, points);
    return make_copier(file_.source, std::move(places));
  }

 private:
  enum Type : std::uint64_t {
    kByte = 1,
    kChar = 2,
    kShort = 3,
    kInt = 4,
    kFloat = 5,
    kDouble = 6,
    kInt64 = 10,
    kLastType = 11,
  };
  struct Variable {
    std::vector<Index> shape;
    std::uint64_t type = 0, begin = 0;
    bool has_records = false;
    std::map<std::string, std::string> texts;
  };

  [[noreturn]] void fail_here(const std::string& why) const {
    fail_reading(path_, "byte " + std::to_string(at_) + ": " + why);
  }

  std::string_view bytes(std::uint64_t place, std::uint64_t size) const {
    const std::string_view all = file_.bytes;
    if (place > all.size() || size > all.size() - place)
      fail_reading(path_, "byte " + std::to_string(place) + ": expected " + std::to_string(size) +
                              " bytes more; the file is cut off or damaged");
    return all.substr(place, size);
  }

  std::uint64_t word(std::uint64_t size) {
    std::uint64_t value = 0;
    for (const char c : bytes(at_, size)) value = value << 8 | std::uint8_t(c);
    at_ += size;
    return value;
  }
  std::uint64_t size_word() { return word(version_ == 5 ? 8 : 4); }

  std::string name() {
    const std::uint64_t length = size_word();
    const std::string text(bytes(at_, length));
    at_ += (length + 3) / 4 * 4;
    return text;
  }

  /// The number of items of a list, which begins with its tag or 0.
  std::uint64_t list(std::uint64_t tag, const char* what) {
    const std::uint64_t found = word(4);
    if (found != tag && found != 0)
      fail_here("expected the list of " + std::string(what) + "; the file is damaged");
    const std::uint64_t count = size_word();
    if (count > file_.bytes.size() || (found == 0 && count > 0))
      fail_here("a list of " + std::to_string(count) + " " + what + " can't be in this file");
    return count;
  }

  void read_dimensions() {
    const std::uint64_t count = list(10, "dimensions");
    for (std::uint64_t i = 0; i < count; ++i) {
      name();
      dimensions_.push_back(Index(size_word()));
    }
  }

  std::map<std::string, std::string> read_attributes() {
    constexpr std::array<std::uint64_t, kLastType + 1> kSizes = {0, 1, 1, 2, 4, 4,
                                                                 8, 1, 2, 4, 8, 8};
    std::map<std::string, std::string> texts;
    const std::uint64_t count = list(12, "attributes");
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::string key = name();
      const std::uint64_t type = word(4), length = size_word();
      if (type == 0 || type > kLastType)
        fail_here("type " + std::to_string(type) + " is not known");
      if (length > file_.bytes.size()) fail_here("an attribute is longer than the file");
      const std::string_view value = bytes(at_, length * kSizes[type]);
      at_ += (value.size() + 3) / 4 * 4;
      if (type == kChar) texts[key] = trimmed(std::string(value));
    }
    return texts;
  }

  void read_variables() {
    const std::uint64_t count = list(11, "variables");
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::string key = name();
      Variable variable;
      const std::uint64_t rank = size_word();
      std::uint64_t total = 1;
      for (std::uint64_t d = 0; d < rank; ++d) {
        const std::uint64_t id = size_word();
        if (id >= dimensions_.size())
          fail_here("variable '" + key + "' has dimension " + std::to_string(id) + " of " +
                    std::to_string(dimensions_.size()));
        const Index length = dimensions_[id];
        variable.has_records |= d == 0 && length == 0;
        variable.shape.push_back(length);
        if (length < 0 || __builtin_mul_overflow(total, std::uint64_t(length), &total) ||
            total > file_.bytes.size())
          fail_here("variable '" + key + "' would be larger than the file");
      }
      variable.texts = read_attributes();
      variable.type = word(4);
      size_word();  // its size, which overflows for large ones
      variable.begin = word(version_ == 1 ? 4 : 8);
      variables_[key] = std::move(variable);
    }
  }

  const Variable& find(const std::string& variable) const {
    const auto found = variables_.find(variable);
    if (found == variables_.end()) fail(variable, "it is missing");
    return found->second;
  }

  std::string_view data(const std::string& name) const {
    const Variable& variable = find(name);
    if (variable.has_records) fail(name, "it has a value a time step, which is not read");
    std::uint64_t size = variable.type == kDouble || variable.type == kInt64 ? 8
                         : variable.type == kShort                           ? 2
                         : variable.type <= kChar                            ? 1
                                                                             : 4;
    for (const Index length : variable.shape) size *= std::uint64_t(length);
    return bytes(variable.begin, size);
  }

  template <class Stored, class Bits>
  std::vector<Index> values(const std::string& name) const {
    const std::string_view all = data(name);
    std::vector<Index> result(all.size() / sizeof(Bits));
    for (std::size_t i = 0; i < result.size(); ++i) {
      Bits value = 0;
      for (std::size_t b = 0; b < sizeof(Bits); ++b)
        value = Bits(value << 8 | std::uint8_t(all[i * sizeof(Bits) + b]));
      result[i] = std::bit_cast<Stored>(value);
    }
    return result;
  }

  SourceBytes file_;
  char version_ = 0;
  std::uint64_t at_ = 0;
  std::vector<Index> dimensions_;
  std::map<std::string, Variable> variables_;
};

class Netcdf4File : public NetcdfFile {
 public:
  explicit Netcdf4File(const fs::path& path) : NetcdfFile(path), file_(path) {}

  bool has(const std::string& variable) const override { return file_.is_dataset("/" + variable); }
  std::vector<Index> shape(const std::string& variable) const override {
    return file_.shape("/" + variable);
  }
  std::vector<Index> integers(const std::string& variable) const override {
    return file_.integers("/" + variable);
  }
  std::vector<std::string> texts(const std::string& variable) const override {
    return file_.texts("/" + variable);
  }
  std::string text_attribute(const std::string& variable, const std::string& name) const override {
    return file_.has_attribute("/" + variable, name) ? file_.text_attribute("/" + variable, name)
                                                     : "";
  }
  std::unique_ptr<const MeshCopier> read_coordinates(const std::vector<NetcdfRun>& runs,
                                                     Points& points) const override {
    std::vector<Hdf5Run> all;
    for (const NetcdfRun& run : runs)
      all.push_back({.dataset = "/" + run.variable,
                     .first = run.first,
                     .count = run.count,
                     .component = run.component});
    return read_hdf5_coordinates(file_, all, points);
  }

 private:
  Hdf5File file_;
};

bool is_classic(std::string_view bytes) {
  return bytes.starts_with("CDF") && bytes.size() > 3 &&
         (bytes[3] == 1 || bytes[3] == 2 || bytes[3] == 5);
}

}  // namespace

void NetcdfFile::fail(const std::string& variable, const std::string& why) const {
  fail_reading(path_, "variable '" + variable + "': " + why);
}

bool is_classic_netcdf(const FileStart& start) { return is_classic(start.bytes); }

std::unique_ptr<const NetcdfFile> open_netcdf(const fs::path& path) {
  if (is_classic(read_start(path, 4))) return std::make_unique<ClassicFile>(path);
  return std::make_unique<Netcdf4File>(path);
}

}  // namespace cadmorph
