#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/formats/collapsed_cells.h"
#include "core/formats/deck.h"
#include "core/formats/formats.h"
#include "core/formats/number_fields.h"
#include "core/formats/numbered_mesh.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

constexpr std::size_t kMostElementNodes = 20;  // of quadratic hexahedra

/// An element by its number ("fe descriptor").
struct ElementKind {
  CellType type;
  std::array<std::uint8_t, kMostElementNodes> order;  ///< place in the file of VTK's nodes
  bool is_beam = false;                               ///< a record of its orientation comes first
};

constexpr ElementKind kLine{Line, {0, 1}, true}, kCurve{QuadraticEdge, {0, 2, 1}, true},
    kTriangle{Triangle, {0, 1, 2}}, kCurvedTriangle{QuadraticTriangle, {0, 2, 4, 1, 3, 5}},
    kQuad{Quad, {0, 1, 2, 3}}, kCurvedQuad{QuadraticQuad, {0, 2, 4, 6, 1, 3, 5, 7}},
    kTetra{Tetra, {0, 1, 2, 3}}, kPyramid{Pyramid, {0, 1, 2, 3, 4}},
    kWedge{Wedge, {0, 1, 2, 3, 4, 5}}, kBrick{Hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}},
    kCurvedTetra{QuadraticTetra, {0, 2, 4, 9, 1, 3, 5, 6, 7, 8}},
    kCurvedWedge{QuadraticWedge, {0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8}},
    kCurvedBrick{QuadraticHexahedron,
                 {0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11}};

const ElementKind* kind_of(Index number) {
  switch (number) {
    case 11:  // rod
    case 21:
    case 22:
      return &kLine;
    case 23:
    case 24:
      return &kCurve;
    case 111:
      return &kTetra;
    case 118:
      return &kCurvedTetra;
    case 101:
    case 112:
      return &kWedge;
    case 102:
    case 113:
      return &kCurvedWedge;
    case 104:
    case 115:
      return &kBrick;
    case 105:
    case 116:
      return &kCurvedBrick;
    case 312:  // gmsh's
      return &kPyramid;
    case 71:
      return &kQuad;
    case 74:
      return &kTriangle;
    default:
      break;
  }
  // Plane stress and strain, plates, membranes, axisymmetric solids, shells: the last digit tells.
  if (number < 41 || number > 95) return nullptr;
  switch (number % 10) {
    case 1:
      return &kTriangle;
    case 2:
      return &kCurvedTriangle;
    case 4:
      return &kQuad;
    case 5:
      return &kCurvedQuad;
    default:
      return nullptr;
  }
}

/// Rigid elements, springs, gaps, dampers, masses.
bool is_left_out(Index number) { return number >= 121 && number < 300; }

/// Three numbers between blanks, each in columns that end where it ends.
class NumbersInColumns : public NodeStyle {
 public:
  /// A number takes `width` characters at most, a blank before it apart.
  explicit NumbersInColumns(std::size_t width) : width_(width) {}

  std::string_view read(std::string_view record, Eigen::RowVector3d& point) const override {
    FreeFields fields(record);
    std::string_view field;
    for (int c = 0; c < 3; ++c) {
      if (!fields.next(field)) return trimmed(record).empty() ? "a blank line" : record;
      if (!read_real(field, point(c))) return field;
    }
    return {};
  }

  void write(std::string_view record, const Eigen::RowVector3d& point,
             const std::array<bool, 3>& is_changed, double /*least*/,
             std::string& text) const override {
    FreeFields fields(record);
    std::string_view field;
    std::size_t kept = 0;
    for (int c = 0; c < 3 && fields.next(field); ++c) {
      const std::size_t end = std::size_t(field.data() - record.data()) + field.size();
      if (is_changed[std::size_t(c)]) {
        const std::string number = spelled(point(c), field);
        const std::size_t columns = end - kept;
        const std::size_t blanks = columns > number.size() ? columns - number.size() : kept > 0;
        text.append(blanks, ' ').append(number);
      } else {
        text.append(record, kept, end - kept);
      }
      kept = end;
    }
    text.append(record, kept);
  }

 private:
  /// With the letter of its exponent that the file has.
  std::string spelled(double value, std::string_view old) const {
    std::string text;
    write_real(value, {.width = width_, .needs_point = true}, text);
    const auto letter = old.find_first_of("dDE");
    if (const auto e = text.find_first_of("eE"); e != text.npos && letter != old.npos)
      text[e] = old[letter];
    return text;
  }

  std::size_t width_;
};

/// A part of a dataset of nodes or elements.
struct Block {
  std::size_t begin = 0, end = 0;
  std::size_t read_to = 0;  ///< before `end`: there the dataset ends, or a record can't be read
  NumberedMesh mesh;
  std::vector<TextToken> places;  ///< of its nodes
  std::map<std::string, Index> left_out;
  std::vector<Index> numbers = {}, nodes = {};  ///< of the element that is being read

  void clear() {
    mesh.node_numbers.clear();
    mesh.coordinates.clear();
    mesh.clear_elements();
    places.clear();
    left_out.clear();
  }
};

/// Reads I-DEAS universal files: datasets between lines of "-1", each with its number.
class Reader {
 public:
  explicit Reader(const fs::path& path) : sources_(path), text_(sources_.text(0)) {}

  ReadMesh run() {
    while (at_ < text_.size()) {
      const std::string_view line = trimmed(next_line());
      if (line.empty()) continue;
      if (line != "-1") fail_expected("-1, which begins a dataset", line);
      read_dataset();
    }
    if (mesh_.element_count() == 0)
      sources_.fail({}, "there are no elements in it (datasets 2412 and 780)");
    MeshAssembly assembly(sources_);
    assembly.add(std::move(mesh_));
    ReadMesh result = assembly.finish(std::move(sources_), "property");
    remark_on_left_out(left_out_, result.remarks);
    return result;
  }

 private:
  std::string_view next_line() {
    line_ = at_;
    return take_line(text_, at_);
  }

  [[noreturn]] void fail(DeckPlace place, const std::string& why) const {
    sources_.fail(place, why);
  }
  [[noreturn]] void fail_expected(std::string_view what, std::string_view found) const {
    sources_.fail_expected({0, line_}, what, found);
  }

  void read_dataset() {
    begin_ = line_;
    const std::string_view name = trimmed(next_line());
    if (name == "2411" || name == "781")
      read_nodes(24);
    else if (name == "15")
      read_short_nodes();
    else if (name == "2412")
      read_elements(5);
    else if (name == "780")
      read_elements(7);
    else if (name == "2435" || name == "2452" || name == "2467" || name == "2477")
      read_groups(4);
    else if (name == "2417" || name == "2429" || name == "2430" || name == "2432")
      read_groups(2);
    else
      skip_dataset();
  }

  void check_end() const {
    if (at_ >= text_.size())
      fail({0, begin_}, "the dataset that begins here does not end: the file is cut off");
  }

  void skip_dataset() {
    for (check_end(); trimmed(next_line()) != "-1"; check_end()) continue;
  }

  /// Appends the integers of a line.
  void read_integers(DeckPlace place, std::string_view line, std::vector<Index>& numbers) const {
    FreeFields fields(line);
    for (std::string_view field; fields.next(field);) {
      Index number = 0;
      if (!read_integer(field, number) || std::abs(number) > kHighestNumber)
        sources_.fail_expected(place, "a whole number", field);
      numbers.push_back(number);
    }
  }

  /// Reads records up to the end of the dataset, on all threads. `goes_on` guesses whether a line
  /// belongs to the record before; `read_record` reads one and goes on behind it, false at the end.
  void read_records(const std::function<bool(std::string_view line)>& goes_on,
                    const std::function<bool(std::size_t& at, Block&)>& read_record,
                    const std::function<void(Block&)>& add) {
    const auto read_from = [&](std::size_t begin, Block& block) {
      block.clear();
      for (block.read_to = begin; block.read_to < block.end;) {
        std::size_t at = block.read_to;
        if (!read_record(at, block)) return;
        block.read_to = at;
      }
    };
    const auto read = [&](Block& block) {
      try {
        read_from(block.begin, block);
      } catch (const Error&) {
        return;  // it is read again in its turn, when what went wrong is told
      }
    };
    const auto take = [&](Block& block) {
      // The record before may have ended elsewhere than thought.
      if (at_ != block.begin) read_from(at_, block);
      add(block);
      at_ = block.read_to;
      return at_ >= block.end;
    };
    read_blocks<Block>(
        text_, at_, text_.size(),
        [&](std::size_t place) { return goes_on(take_line(text_, place)); }, read, take);
    check_end();
    Block rest;
    if (read_record(at_, rest)) check_end();
    next_line();
  }

  /// A line of a record; false at the end of the dataset.
  bool take_record_line(std::size_t& at, std::string_view& line, DeckPlace& place) const {
    place = {0, at};
    std::size_t next = at;
    line = take_line(text_, next);
    if (trimmed(line) == "-1") return false;
    at = next;
    if (line.size() > 0xffff) fail(place, "the line is too long");
    return true;
  }

  Index node_number(DeckPlace place, std::string_view line) const {
    FreeFields fields(line);
    std::string_view field;
    Index number = 0;
    if (!fields.next(field) || !read_integer(field, number) || number < 1 ||
        number > kHighestNumber)
      sources_.fail_expected(place, "the number of a node", line);
    return number;
  }

  static void add_node(Index number, const Eigen::RowVector3d& point, DeckPlace place,
                       std::string_view record, Block& block) {
    block.mesh.add_node(number, point);
    block.places.push_back({.place = place.place, .length = record.size()});
  }

  /// A line of numbers, and one of coordinates.
  void read_nodes(std::size_t width) {
    const auto style = std::make_shared<NumbersInColumns>(width);
    const auto read = [&](std::size_t& at, Block& block) {
      std::string_view line, coordinates;
      DeckPlace place, second;
      if (!take_record_line(at, line, place)) return false;
      if (trimmed(line).empty()) return true;
      const Index number = node_number(place, line);
      if (!take_record_line(at, coordinates, second))
        fail(place, "the node has no coordinates behind it");
      Eigen::RowVector3d point;
      const std::string_view bad = style->read(coordinates, point);
      if (!bad.empty()) sources_.fail_expected(second, "three coordinates", bad);
      add_node(number, point, second, coordinates, block);
      return true;
    };
    add_nodes([](std::string_view line) { return line.find('.') != line.npos; }, read, style);
  }

  /// Four numbers and the coordinates in one line.
  void read_short_nodes() {
    constexpr std::size_t kBefore = 40, kWidth = 12;  // columns: four times 10, then 12 each
    const auto style = std::make_shared<NumbersInColumns>(kWidth);
    const auto read = [&](std::size_t& at, Block& block) {
      std::string_view line;
      DeckPlace place;
      if (!take_record_line(at, line, place)) return false;
      if (trimmed(line).empty()) return true;
      const Index number = node_number(place, line);
      const std::string_view coordinates = columns(line, kBefore, line.size());
      Eigen::RowVector3d point;
      const std::string_view bad = style->read(coordinates, point);
      if (coordinates.empty() || !bad.empty())
        sources_.fail_expected(place, "three coordinates behind column 40", line);
      add_node(number, point, {0, place.place + kBefore}, coordinates, block);
      return true;
    };
    add_nodes([](std::string_view) { return false; }, read, style);
  }

  void add_nodes(const std::function<bool(std::string_view)>& goes_on,
                 const std::function<bool(std::size_t&, Block&)>& read,
                 std::shared_ptr<const NodeStyle> style) {
    NodeRecords records{.file = 0, .style = std::move(style)};
    read_records(goes_on, read, [&](Block& block) {
      const auto append = [](const auto& more, auto& values) {
        values.insert(values.end(), more.begin(), more.end());
      };
      Index row = std::ssize(mesh_.node_numbers);
      append(block.mesh.node_numbers, mesh_.node_numbers);
      append(block.mesh.coordinates, mesh_.coordinates);
      append(block.places, records.places);
      while (row < std::ssize(mesh_.node_numbers)) records.nodes.push_back(row++);
    });
    mesh_.records.push_back(std::move(records));
  }

  /// Number, kind, property, ..., and at `count_at` the number of nodes; for beams a line that
  /// tells their orientation; the nodes, eight a line.
  void read_elements(std::size_t count_at) {
    const auto goes_on = [&](std::string_view line) {
      std::vector<Index> numbers;
      try {
        read_integers({}, line, numbers);
      } catch (const Error&) {
        return false;
      }
      return trimmed(line) != "-1" && (numbers.size() != count_at + 1 || numbers[count_at] < 1 ||
                                       numbers[count_at] > Index(kMostElementNodes) ||
                                       (!kind_of(numbers[1]) && !is_left_out(numbers[1])));
    };
    const auto read = [&](std::size_t& at, Block& block) {
      return read_element(at, count_at, block);
    };
    read_records(goes_on, read, [&](Block& block) {
      mesh_.reserve_elements(block.mesh, blocks_behind(text_, block));
      mesh_.append_elements(block.mesh, 0, block.mesh.element_count());
      for (const auto& [name, count] : block.left_out) left_out_[name] += count;
    });
  }

  bool read_element(std::size_t& at, std::size_t count_at, Block& block) const {
    std::string_view line;
    DeckPlace place, next;
    if (!take_record_line(at, line, place)) return false;
    if (trimmed(line).empty()) return true;
    std::vector<Index>& numbers = block.numbers;
    numbers.clear();
    read_integers(place, line, numbers);
    if (numbers.size() <= count_at)
      sources_.fail_expected(place, std::to_string(count_at + 1) + " numbers of an element", line);
    const Index count = numbers[count_at];
    const ElementKind* const kind = kind_of(numbers[1]);
    if (!kind && !is_left_out(numbers[1]))
      fail(place, "elements of kind " + std::to_string(numbers[1]) + " are not read");
    if (count < 1 || count > 1000)
      fail(place, "the number of nodes of an element is " + std::to_string(count));
    if (kind && kind->is_beam && !take_record_line(at, line, next))
      fail(place, "the orientation of a beam is missing");
    block.nodes.clear();
    while (std::ssize(block.nodes) < count) {
      const std::size_t before = block.nodes.size();
      if (at < text_.size() && take_record_line(at, line, next))
        read_integers(next, line, block.nodes);
      if (block.nodes.size() == before) fail(place, "the nodes of an element end too soon");
    }
    if (!kind)
      ++block.left_out["of kind " + std::to_string(numbers[1])];
    else
      add_element(*kind, place, block);
    return true;
  }

  void add_element(const ElementKind& kind, DeckPlace place, Block& block) const {
    const auto count = std::size_t(cell_node_count(kind.type));
    if (block.nodes.size() != count)
      fail(place, "element " + std::to_string(block.numbers[0]) + " has " +
                      std::to_string(block.nodes.size()) + " nodes, expected " +
                      std::to_string(count));
    std::vector<Index> nodes(count);
    for (std::size_t i = 0; i < count; ++i) nodes[i] = block.nodes[kind.order[i]];
    const CellType type = reduce_collapsed(kind.type, nodes);
    const int property = int(std::clamp<Index>(block.numbers[2], 0, 1 << 30));
    block.mesh.add_element(block.numbers[0], type, nodes, property, place);
  }

  /// Numbers, the last of which counts the members; the name; the members, each kind, number and,
  /// of `fields`, others.
  void read_groups(std::size_t fields) {
    constexpr Index kNode = 7, kElement = 8;  // kinds of members, as the format numbers them
    for (check_end();; check_end()) {
      std::vector<Index> head;
      const std::string_view line = next_line();
      if (trimmed(line) == "-1") return;
      if (trimmed(line).empty()) continue;
      read_integers({0, line_}, line, head);
      check_end();
      const std::string name(trimmed(next_line()));
      NumberedSet nodes{.name = name, .kind = "group of nodes", .numbers = {}};
      NumberedSet elements{
          .name = name, .kind = "group of elements", .is_of_elements = true, .numbers = {}};
      std::vector<Index> members;
      const auto wanted = fields * std::size_t(std::clamp<Index>(head.back(), 0, kHighestNumber));
      while (members.size() < wanted) {
        check_end();
        const std::string_view more = next_line();
        if (trimmed(more) == "-1") fail({0, line_}, "the group " + name + " ends too soon");
        read_integers({0, line_}, more, members);
      }
      for (std::size_t i = 0; i + 1 < members.size(); i += fields) {
        if (members[i] == kNode) nodes.numbers.push_back(members[i + 1]);
        if (members[i] == kElement) elements.numbers.push_back(members[i + 1]);
      }
      mesh_.sets.push_back(std::move(nodes));
      mesh_.sets.push_back(std::move(elements));
    }
  }

  DeckSources sources_;
  std::string_view text_;
  std::size_t at_ = 0, line_ = 0;
  std::size_t begin_ = 0;  ///< of the dataset
  NumberedMesh mesh_;
  std::map<std::string, Index> left_out_;
};

Recognition recognise(const FileStart& start) {
  std::size_t at = 0;
  std::string_view line;
  while (line.empty() && at < start.bytes.size()) line = trimmed(take_line(start.bytes, at));
  Index number = 0;
  return line == "-1" && read_integer(take_line(start.bytes, at), number) && number > 0
             ? Recognition::Sure
             : Recognition::No;
}

ReadMesh read(const fs::path& path) { return Reader(path).run(); }

}  // namespace

const MeshFormat& unv_format() {
  static const MeshFormat format{
      .name = "UNV", .extensions = {".unv"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
