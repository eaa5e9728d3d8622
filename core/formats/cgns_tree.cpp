#include "core/formats/cgns_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <map>

#include "core/formats/coordinate_places.h"
#include "core/formats/hdf5_coordinates.h"
#include "core/formats/source_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr std::size_t kDeepest = 40;  // CGNS itself needs about 10
constexpr const char* kLinkRemedy = "put all of the mesh into one file (cgnscompress does)";

class Hdf5Tree : public CgnsTree {
 public:
  explicit Hdf5Tree(const fs::path& path) : CgnsTree(path), file_(path) { read_children(root_, 0); }

  std::vector<Index> integers(const CgnsNode& node) const override {
    return file_.integers(data_of(node));
  }
  std::vector<double> numbers(const CgnsNode& node) const override {
    return file_.numbers(data_of(node));
  }
  std::string text(const CgnsNode& node) const override {
    std::string all;
    for (const std::string& text : file_.texts(data_of(node))) all += text;
    return all;
  }
  std::unique_ptr<const MeshCopier> read_coordinates(const std::vector<CgnsRun>& runs,
                                                     Points& points) const override {
    std::vector<Hdf5Run> all;
    for (const CgnsRun& run : runs)
      all.push_back({.dataset = data_of(*run.node),
                     .count = std::ssize(run.nodes),
                     .component = run.component,
                     .nodes = run.nodes});
    return read_hdf5_coordinates(file_, all, points);
  }

 private:
  static std::string data_of(const CgnsNode& node) { return node.path + "/ data"; }

  void read_children(CgnsNode& node, std::size_t depth) {
    if (depth > kDeepest) fail(node, "its nodes are nested too deep; the file is damaged");
    const std::string group = node.path.empty() ? "/" : node.path;
    for (const std::string& name : file_.children(group)) {
      if (name.starts_with(' ')) continue;  // of the node itself
      CgnsNode child;
      child.path = node.path + "/" + name;
      if (!file_.has(child.path) || file_.is_dataset(child.path)) continue;
      if (!file_.has_attribute(child.path, "label")) continue;
      child.name = name;
      child.label = file_.text_attribute(child.path, "label");
      child.type = file_.text_attribute(child.path, "type");
      if (child.type == "LK" || file_.has(child.path + "/ file"))
        fail(child, std::string("it is a link to another file; ") + kLinkRemedy);
      if (child.type != "MT" && file_.has(data_of(child)))
        child.shape = file_.shape(data_of(child));
      read_children(child, depth + 1);
      node.children.push_back(std::move(child));
    }
  }

  Hdf5File file_;
};

/// ADF as its documentation has it: nodes of text with pointers in hexadecimal digits.
class AdfTree : public CgnsTree {
 public:
  explicit AdfTree(const fs::path& path) : CgnsTree(path), file_(read_source(path)) {
    constexpr std::size_t kRoot = 266, kFormat = 100;  // places in the file
    const std::string_view format = piece(kFormat, 1);
    is_big_endian_ = format == "B";
    if (!is_big_endian_ && format != "L")
      fail_reading(path_, "its numbers are of format '" + std::string(format) +
                              "'; convert it with adf2hdf");
    read_node(root_, kRoot, 0);
    root_.path.clear();
  }

  std::vector<Index> integers(const CgnsNode& node) const override {
    if (node.type == "I4") return values<std::int32_t, std::uint32_t, Index>(node);
    if (node.type == "I8") return values<std::int64_t, std::uint64_t, Index>(node);
    fail(node, "it holds no integers but data of type " + node.type);
  }
  std::vector<double> numbers(const CgnsNode& node) const override {
    if (node.type == "R4") return values<float, std::uint32_t, double>(node);
    if (node.type == "R8") return values<double, std::uint64_t, double>(node);
    fail(node, "it holds no numbers but data of type " + node.type);
  }
  std::string text(const CgnsNode& node) const override {
    if (node.type != "C1") fail(node, "it holds no text but data of type " + node.type);
    std::string all = data(node);
    while (all.ends_with(' ') || all.ends_with('\0')) all.pop_back();
    return all;
  }

  std::unique_ptr<const MeshCopier> read_coordinates(const std::vector<CgnsRun>& runs,
                                                     Points& points) const override {
    BinaryPlaces places;
    for (const CgnsRun& run : runs) {
      const std::uint64_t size = size_of(*run.node);
      Index first = 0;
      for (const Piece& piece : pieces(*run.node)) {
        const Index count = std::min(Index(piece.size / size), std::ssize(run.nodes) - first);
        if (piece.size % size != 0)
          fail(*run.node,
               "its data are cut within a number, which is not read; convert the file "
               "with adf2hdf");
        places.runs.push_back(
            {.place = piece.place,
             .stride = size,
             .count = count,
             .component = run.component,
             .type = size == sizeof(float) ? BinaryRun::Type::Float32 : BinaryRun::Type::Float64,
             .is_big_endian = is_big_endian_,
             .nodes = {run.nodes.begin() + first, run.nodes.begin() + first + count}});
        first += count;
      }
    }
    read_runs(file_.bytes, places, path_, points);
    return make_copier(file_.source, std::move(places));
  }

 private:
  struct Piece {
    std::uint64_t place = 0, size = 0;
  };

  [[noreturn]] void fail_at(std::uint64_t place, const std::string& why) const {
    fail_reading(path_, "byte " + std::to_string(place) + ": " + why);
  }

  std::string_view piece(std::uint64_t place, std::uint64_t size) const {
    const std::string_view bytes = file_.bytes;
    if (place > bytes.size() || size > bytes.size() - place)
      fail_at(place, "the file ends before what is expected there; it is damaged or cut off");
    return bytes.substr(place, size);
  }

  std::uint64_t hexadecimal(std::uint64_t place, std::uint64_t digits) const {
    const std::string_view text = piece(place, digits);
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + digits, value, 16);
    if (error != std::errc() || end != text.data() + digits)
      fail_at(place, "expected " + std::to_string(digits) + " hexadecimal digits");
    return value;
  }

  /// A block of 4096 bytes, and the place in it.
  std::uint64_t pointer(std::uint64_t place) const {
    return hexadecimal(place, 8) * 4096 + hexadecimal(place + 8, 4);
  }

  void expect(std::uint64_t place, std::string_view tag) const {
    if (piece(place, tag.size()) != tag)
      fail_at(place, "expected '" + std::string(tag) + "'; the file is damaged");
  }

  std::string name_at(std::uint64_t place) const {
    constexpr std::uint64_t kLength = 32;  // of ADF's names
    std::string name(piece(place, kLength));
    while (name.ends_with(' ') || name.ends_with('\0')) name.pop_back();
    return name;
  }

  void read_node(CgnsNode& node, std::uint64_t place, std::size_t depth) {
    if (depth > kDeepest || ++nodes_ > file_.bytes.size() / kNodeSize)
      fail_at(place, "its nodes go in circles; the file is damaged");
    expect(place, "NoDe");
    node.name = name_at(place + 4);
    node.path += "/" + node.name;
    node.label = name_at(place + 36);
    node.type = name_at(place + 96);
    if (node.type == "LK") fail(node, std::string("it is a link to another file; ") + kLinkRemedy);
    const std::uint64_t rank = hexadecimal(place + 128, 2);
    if (rank > 12) fail_at(place + 128, "a node has " + std::to_string(rank) + " dimensions");
    for (std::uint64_t d = rank; d > 0; --d)
      node.shape.push_back(Index(hexadecimal(place + 130 + 8 * (d - 1), 8)));
    std::uint64_t count = 1;
    for (const Index length : node.shape)
      if (__builtin_mul_overflow(count, std::uint64_t(length), &count) ||
          count > file_.bytes.size())
        fail(node, "it would have more data than the file; the file is damaged");
    chunks_.emplace(node.path,
                    Chunks{.count = hexadecimal(place + 226, 4),
                           .place = hexadecimal(place + 226, 4) > 0 ? pointer(place + 230) : 0});
    read_children(node, place, depth);
  }

  void read_children(CgnsNode& node, std::uint64_t place, std::size_t depth) {
    constexpr std::uint64_t kTableHead = 16, kEntry = 44;  // bytes; an entry: name and pointer
    const std::uint64_t count = hexadecimal(place + 68, 8);
    if (count == 0) return;
    const std::uint64_t table = pointer(place + 84);
    expect(table, "SNTb");
    for (std::uint64_t i = 0; i < count; ++i) {
      CgnsNode child;
      child.path = node.path == root_.path ? "" : node.path;
      read_node(child, pointer(table + kTableHead + i * kEntry + 32), depth + 1);
      node.children.push_back(std::move(child));
    }
  }

  std::uint64_t size_of(const CgnsNode& node) const {
    return node.type == "R8" || node.type == "I8" ? 8 : node.type == "C1" ? 1 : 4;
  }

  /// Where a node's data lie, as many bytes as it says that it has.
  std::vector<Piece> pieces(const CgnsNode& node) const {
    std::uint64_t size = size_of(node);
    for (const Index length : node.shape) size *= std::uint64_t(length);
    constexpr std::uint64_t kHead = 16;  // tag and the pointer to the end
    std::vector<Piece> result;
    const auto add = [&](std::uint64_t place, std::uint64_t end) {
      expect(place, "DaTa");
      if (end < place + kHead) fail_at(place, "data end before they begin; the file is damaged");
      const std::uint64_t length = std::min(size, end - place - kHead);
      piece(place + kHead, length);
      result.push_back({place + kHead, length});
      size -= length;
    };
    const Chunks& chunks = chunks_.at(node.path);
    if (chunks.count == 1) {
      add(chunks.place, pointer(chunks.place + 4));
    } else if (chunks.count > 1) {
      expect(chunks.place, "DCtb");
      for (std::uint64_t i = 0; i < chunks.count; ++i) {
        const std::uint64_t entry = chunks.place + kHead + 24 * i;
        add(pointer(entry), pointer(entry + 12));
      }
    }
    if (size > 0)
      fail(node, std::to_string(size) + " bytes of its data are missing; the file is damaged");
    return result;
  }

  std::string data(const CgnsNode& node) const {
    std::string all;
    for (const Piece& part : pieces(node)) all += piece(part.place, part.size);
    return all;
  }

  template <class Stored, class Bits, class Value>
  std::vector<Value> values(const CgnsNode& node) const {
    const std::string all = data(node);
    std::vector<Value> result(all.size() / sizeof(Bits));
    const bool is_swapped = (std::endian::native == std::endian::big) != is_big_endian_;
    for (std::size_t i = 0; i < result.size(); ++i) {
      std::array<char, sizeof(Bits)> bytes;
      std::memcpy(bytes.data(), all.data() + i * sizeof(Bits), sizeof(Bits));
      if (is_swapped) std::ranges::reverse(bytes);
      result[i] = Value(std::bit_cast<Stored>(bytes));
    }
    return result;
  }

  struct Chunks {
    std::uint64_t count = 0, place = 0;
  };
  static constexpr std::size_t kNodeSize = 246;  // bytes, of ADF's nodes

  SourceBytes file_;
  bool is_big_endian_ = false;
  std::size_t nodes_ = 0;
  std::map<std::string, Chunks> chunks_;
};

}  // namespace

const CgnsNode* CgnsNode::with_label(std::string_view wanted) const {
  const auto found = std::ranges::find(children, wanted, &CgnsNode::label);
  return found == children.end() ? nullptr : &*found;
}

const CgnsNode* CgnsNode::with_name(std::string_view wanted) const {
  const auto found = std::ranges::find(children, wanted, &CgnsNode::name);
  return found == children.end() ? nullptr : &*found;
}

void CgnsTree::fail(const CgnsNode& node, const std::string& why) const {
  fail_reading(path_, "'" + (node.path.empty() ? "/" : node.path) + "': " + why);
}

bool is_adf(const FileStart& start) {
  // Behind four bytes, "@(#)" with or without their highest bits.
  return start.bytes.find("ADF Database") == 4;
}

std::unique_ptr<const CgnsTree> read_cgns_tree(const fs::path& path) {
  const FileStart start{.path = path, .extension = "", .bytes = read_start(path, 64)};
  if (is_adf(start)) return std::make_unique<AdfTree>(path);
  return std::make_unique<Hdf5Tree>(path);
}

}  // namespace cadmorph
