#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/formats/collapsed_cells.h"
#include "core/formats/deck.h"
#include "core/formats/formats.h"
#include "core/formats/node_styles.h"
#include "core/formats/number_fields.h"
#include "core/formats/numbered_mesh.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

/// The fields of a command, "NBLOCK,6,SOLID", in capitals.
std::vector<std::string> command_fields(std::string_view line) {
  line = line.substr(0, std::min(line.find('!'), line.size()));
  std::vector<std::string> fields;
  for (std::size_t at = 0; at <= line.size();) {
    const std::size_t comma = std::min(line.find(',', at), line.size());
    fields.push_back(upper(trimmed(line.substr(at, comma - at))));
    at = comma + 1;
  }
  return fields;
}

/// "(3i9,6e21.13e3)": how many integers of which width, and the reals.
struct BlockFormat {
  std::size_t integers = 0, integer_width = 0;
  std::size_t reals = 0, real_width = 0;
  int decimals = -1, exponent_digits = 2;
};

std::size_t take_number(std::string_view& text) {
  std::size_t value = 0;
  const auto [last, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  text.remove_prefix(std::size_t(last - text.data()));
  return std::min<std::size_t>(value, 1000);
}

BlockFormat parse_format(std::string_view line) {
  BlockFormat format;
  std::string_view text = trimmed(line);
  if (!text.starts_with('(') || !text.ends_with(')')) return format;
  text = text.substr(1, text.size() - 2);
  while (!text.empty()) {
    if (text[0] == ',' || text[0] == ' ') {
      text.remove_prefix(1);
      continue;
    }
    const std::size_t count = take_number(text);
    const char kind = text.empty() ? ' ' : char(std::tolower(static_cast<unsigned char>(text[0])));
    if (text.empty()) break;
    text.remove_prefix(1);
    const std::size_t width = take_number(text);
    if (kind == 'i') {
      format.integers = std::max<std::size_t>(count, 1);
      format.integer_width = width;
    } else if (kind == 'e' || kind == 'g' || kind == 'f') {
      format.reals = std::max<std::size_t>(count, 1);
      format.real_width = width;
      if (text.starts_with('.')) {
        text.remove_prefix(1);
        format.decimals = int(take_number(text));
      }
      if (text.starts_with('e') || text.starts_with('E')) {
        text.remove_prefix(1);
        format.exponent_digits = int(take_number(text));
      }
    }
  }
  // A number that its columns can't hold in that form goes in as it fits.
  const int least = format.decimals + format.exponent_digits + 5;
  if (std::size_t(std::max(least, 0)) > format.real_width || format.exponent_digits > 3)
    format.decimals = -1;
  return format;
}

/// The shapes of element types, by their numbers (185 of SOLID185).
struct TypeShape {
  CellType linear, quadratic;  ///< the same where there is no other
  std::set<int> types;
};

const TypeShape kShapes[] = {
    {CellType::Hexahedron,
     CellType::Hexahedron,
     {5, 45, 46, 62, 64, 65, 69, 70, 73, 80, 96, 97, 164, 185, 190, 215, 278}},
    {CellType::Hexahedron,
     CellType::QuadraticHexahedron,
     {89, 90, 95, 122, 186, 191, 220, 226, 231, 236, 239, 279}},
    {CellType::Tetra, CellType::Tetra, {72, 285}},
    {CellType::Tetra,
     CellType::QuadraticTetra,
     {87, 92, 98, 123, 148, 168, 187, 221, 227, 232, 237, 240, 291}},
    {CellType::Quad, CellType::Quad, {13, 25, 28,  41,  42,  43,  55,  57,  63,  67,
                                      75, 79, 131, 143, 157, 162, 163, 181, 182, 192}},
    {CellType::Quad,
     CellType::QuadraticQuad,
     {53, 77, 78, 82, 83, 91, 93, 99, 121, 132, 150, 183, 223, 230, 233, 238, 281, 292, 293}},
    {CellType::Triangle, CellType::QuadraticTriangle, {2, 35, 146}},
    {CellType::Line,
     CellType::Line,
     {1, 3, 4, 8, 10, 11, 16, 23, 24, 32, 33, 44, 54, 68, 160, 161, 180, 188, 288}},
    {CellType::Line, CellType::QuadraticEdge, {189, 289}},
};

/// What ET says of the elements with its number.
struct ElementType {
  int number = 0;
  const TypeShape* shape = nullptr;  ///< null: left out, or not known
};

const TypeShape* shape_of(int type) {
  for (const TypeShape& shape : kShapes)
    if (shape.types.contains(type)) return &shape;
  return nullptr;
}

/// Springs, masses, contact, surface effects, constraints.
bool is_left_out(int type) {
  return type == 7 || type == 12 || type == 14 || type == 18 || type == 20 || type == 21 ||
         (type >= 26 && type <= 40 && type != 28 && type != 35) || (type >= 47 && type <= 52) ||
         type == 59 || type == 60 || type == 71 || type == 94 || (type >= 115 && type <= 116) ||
         (type >= 124 && type <= 126) || type == 130 || type == 138 || type == 139 ||
         (type >= 151 && type <= 156) || type == 165 || type == 166 || type == 167 ||
         (type >= 169 && type <= 179) || type == 184 || (type >= 193 && type <= 214) ||
         (type >= 217 && type <= 219) || type == 250 || type == 251 || type == 257 ||
         (type >= 263 && type <= 265) || type == 290;
}

/// Reads what CDWRITE wrote.
class Reader {
 public:
  explicit Reader(const fs::path& path) : sources_(path), text_(sources_.text(0)) {}

  ReadMesh run() {
    while (at_ < text_.size()) read_command(next_line());
    MeshAssembly assembly(sources_);
    assembly.add(std::move(mesh_));
    ReadMesh result = assembly.finish(std::move(sources_), "material");
    remark_on_left_out(left_out_, result.remarks);
    if (incomplete_ > 0)
      result.remarks.push_back(std::to_string(incomplete_) +
                               " elements lack some of their mid-side nodes and are taken as "
                               "linear; the others of their mid-side nodes follow the rest");
    if (has_rotations_)
      result.remarks.push_back("the rotated coordinate systems of nodes are those of the base");
    return result;
  }

 private:
  DeckPlace here() const { return {0, line_}; }

  std::string_view next_line() {
    line_ = at_;
    return take_line(text_, at_);
  }

  [[noreturn]] void fail(const std::string& why) const { sources_.fail(here(), why); }

  [[noreturn]] void fail_expected(std::string_view what, std::string_view found) const {
    sources_.fail_expected(here(), what, found);
  }

  void read_command(std::string_view line) {
    const char first = line.empty() ? ' ' : char(std::toupper(static_cast<unsigned char>(line[0])));
    if (first != 'N' && first != 'E' && first != 'C' && first != 'M') return;
    const std::vector<std::string> fields = command_fields(line);
    const std::string& name = fields[0];
    if (name == "NBLOCK")
      read_nodes();
    else if (name == "EBLOCK")
      read_elements(fields);
    else if (name == "CMBLOCK")
      read_component(line, fields);
    else if (name == "ET" && fields.size() > 2)
      read_type(fields);
    else if (name == "NGEN" || name == "NSYM" || name == "NSCALE" || name == "NMODIF" ||
             name == "MOVE")
      fail(name +
           " makes nodes out of others or moves them: their places are not what stands in NBLOCK; "
           "write the model anew with CDWRITE");
    else if (name == "N" || name == "EN")
      fail("nodes and elements in commands (" + name +
           ") are not read: write the model with CDWRITE in the blocked format");
  }

  void read_type(const std::vector<std::string>& fields) {
    Index number = 0, type = 0;
    const std::size_t digit = std::min(fields[2].find_first_of("0123456789"), fields[2].size());
    if (!read_integer(fields[1], number) ||
        !read_integer(std::string_view(fields[2]).substr(digit), type) || type < 0 || type > 9999)
      fail_expected("ET, a number and an element type", fields[2]);
    types_[number] = {.number = int(type), .shape = shape_of(int(type))};
  }

  BlockFormat read_format() {
    const std::string_view line = next_line();
    const BlockFormat format = parse_format(line);
    if (format.integers == 0 || format.integer_width == 0)
      fail_expected("a format such as (3i9,6e21.13e3)", line);
    return format;
  }

  /// Some of the lines of nodes.
  struct NodeBlock {
    std::size_t begin = 0, end = 0;
    std::size_t read_to = 0;  ///< before `end`: there the nodes end, or a line can't be read
    std::vector<Index> numbers;
    std::vector<double> coordinates;
    std::vector<TextToken> places;
    bool has_rotations = false;
  };

  static bool ends_nodes(std::string_view line) {
    return line.starts_with('N') || line.starts_with('n') || trimmed(line) == "-1";
  }

  void read_nodes() {
    const BlockFormat format = read_format();
    if (format.real_width == 0 || format.reals < 3)
      fail("the format of the nodes has no three coordinates");
    const std::size_t first = format.integers * format.integer_width;
    const auto style = std::make_shared<NodeColumns>(first, format.real_width, format.decimals,
                                                     format.exponent_digits);
    NodeRecords records{.file = 0, .style = style};
    const auto read = [&](NodeBlock& block) {
      block.numbers.clear();
      block.coordinates.clear();
      block.places.clear();
      block.has_rotations = false;
      try {
        for (block.read_to = block.begin; block.read_to < block.end;) {
          std::size_t at = block.read_to;
          const std::string_view line = take_line(text_, at);
          if (ends_nodes(line)) return;
          read_node({0, block.read_to}, line, format, *style, block);
          block.read_to = at;
        }
      } catch (const Error&) {
        return;  // it is read again in its turn, when what went wrong is told
      }
    };
    const auto take = [&](NodeBlock& block) {
      add_nodes(block, records);
      at_ = block.read_to;
      return block.read_to == block.end;
    };
    const auto goes_on = [](std::size_t) { return false; };
    read_blocks<NodeBlock>(text_, at_, text_.size(), goes_on, read, take);
    if (at_ >= text_.size()) fail("the nodes end too soon: the file is cut off");
    const std::string_view line = next_line();
    NodeBlock rest;
    if (!ends_nodes(line)) read_node(here(), line, format, *style, rest);
    mesh_.records.push_back(std::move(records));
  }

  void add_nodes(const NodeBlock& block, NodeRecords& records) {
    const auto append = [](const auto& more, auto& values) {
      values.insert(values.end(), more.begin(), more.end());
    };
    const Index first = std::ssize(mesh_.node_numbers);
    append(block.numbers, mesh_.node_numbers);
    append(block.coordinates, mesh_.coordinates);
    append(block.places, records.places);
    for (Index row = first; row < std::ssize(mesh_.node_numbers); ++row)
      records.nodes.push_back(row);
    has_rotations_ = has_rotations_ || block.has_rotations;
  }

  void read_node(DeckPlace place, std::string_view line, const BlockFormat& format,
                 const NodeStyle& style, NodeBlock& block) const {
    if (trimmed(line).empty()) return;
    Index number = 0;
    const std::string_view field = columns(line, 0, format.integer_width);
    if (!read_integer(field, number) || number < 1 || number > kHighestNumber)
      sources_.fail_expected(place, "the number of a node", field);
    Eigen::RowVector3d point;
    const std::string_view bad = style.read(line, point);
    if (!bad.empty()) sources_.fail_expected(place, "a coordinate", bad);
    if (line.size() > 0xffff) sources_.fail(place, "the line is too long");
    const std::size_t end = format.integers * format.integer_width + 3 * format.real_width;
    block.has_rotations = block.has_rotations || !trimmed(columns(line, end, line.size())).empty();
    block.places.push_back({.place = place.place, .length = line.size()});
    block.numbers.push_back(number);
    block.coordinates.insert(block.coordinates.end(), point.data(), point.data() + 3);
  }

  /// Appends the integers of a line of columns.
  void read_integers(DeckPlace place, std::string_view line, const BlockFormat& format,
                     std::vector<Index>& numbers) const {
    for (std::size_t i = 0; i < format.integers; ++i) {
      const std::string_view field = columns(line, i * format.integer_width, format.integer_width);
      if (field.empty() || trimmed(field).empty()) return;
      Index number = 0;
      if (!read_integer(field, number) || std::abs(number) > kHighestNumber)
        sources_.fail_expected(place, "a number", field);
      numbers.push_back(number);
    }
  }

  /// Some of the lines of elements.
  struct ElementBlock {
    std::size_t begin = 0, end = 0;
    std::size_t read_to = 0;  ///< before `end`: there the elements end, or one can't be read
    NumberedMesh elements;
    std::map<std::string, Index> left_out;
    Index incomplete = 0;
    std::vector<Index> numbers = {}, nodes = {};  ///< of the element that is being read
  };

  static constexpr std::size_t kHead = 11;  // numbers before the nodes of an element
  static constexpr Index kMostNodes = 100;  // of an element: a larger number is no count of nodes

  /// Whether a line of an element goes on with the one before, as far as can be told from it alone:
  /// it does not tell the number of its nodes.
  bool is_continuation(std::size_t at, const BlockFormat& format) const {
    std::vector<Index> numbers;
    try {
      read_integers({0, at}, take_line(text_, at), format, numbers);
    } catch (const Error&) {
      return false;
    }
    const auto on_line = [&](Index count) {
      return std::min(kHead + std::size_t(count), std::max(format.integers, kHead));
    };
    return numbers.size() > 1 && (numbers.size() < kHead || numbers[8] < 1 ||
                                  numbers[8] > kMostNodes || on_line(numbers[8]) != numbers.size());
  }

  void read_elements(const std::vector<std::string>& fields) {
    const bool is_solid = fields.size() > 2 && fields[2] == "SOLID";
    const BlockFormat format = read_format();
    const auto read_from = [&](std::size_t begin, ElementBlock& block) {
      block.elements.clear_elements();
      block.left_out.clear();
      block.incomplete = 0;
      for (block.read_to = begin; block.read_to < block.end;) {
        std::size_t at = block.read_to;
        if (!read_element(at, is_solid, format, block)) return;
        block.read_to = at;
      }
    };
    const auto read = [&](ElementBlock& block) {
      try {
        read_from(block.begin, block);
      } catch (const Error&) {
        return;  // it is read again in its turn, when what went wrong is told
      }
    };
    const auto take = [&](ElementBlock& block) {
      // The element before may have ended elsewhere than thought.
      if (at_ != block.begin) read_from(std::exchange(block.read_to, at_), block);
      mesh_.reserve_elements(block.elements, blocks_behind(text_, block));
      mesh_.append_elements(block.elements, 0, block.elements.element_count());
      for (const auto& [name, count] : block.left_out) left_out_[name] += count;
      incomplete_ += block.incomplete;
      at_ = block.read_to;
      return at_ >= block.end;
    };
    const auto goes_on = [&](std::size_t place) { return is_continuation(place, format); };
    read_blocks<ElementBlock>(text_, at_, text_.size(), goes_on, read, take);
    ElementBlock rest;
    if (at_ >= text_.size() || read_element(at_, is_solid, format, rest))
      fail("the elements end too soon: the file is cut off");
    next_line();
  }

  /// Reads the element, or the blank line, at a place and goes on behind it; false where the
  /// elements end. Material, type, real constants, section, system, birth, body, shape, number of
  /// nodes, -, number, and up to 8 nodes; the others on the next line.
  bool read_element(std::size_t& at, bool is_solid, const BlockFormat& format,
                    ElementBlock& block) const {
    const DeckPlace place{0, at};
    std::size_t next = at;
    const std::string_view line = take_line(text_, next);
    const std::string_view contents = trimmed(line);
    if (contents == "-1") return false;
    at = next;
    if (contents.empty()) return true;
    std::vector<Index>& numbers = block.numbers;
    numbers.clear();
    read_integers(place, line, format, numbers);
    if (!is_solid) {
      ++block.left_out["of an EBLOCK without SOLID"];
      return true;
    }
    if (numbers.size() < kHead + 1)
      sources_.fail(place, "expected 11 numbers of an element and its nodes");
    const Index count = numbers[8];
    if (count < 1 || count > kMostNodes)
      sources_.fail(place, "the number of nodes of an element is " + std::to_string(count));
    for (DeckPlace last = place; numbers.size() < kHead + std::size_t(count);) {
      if (at >= text_.size()) sources_.fail(last, "the nodes of an element end too soon");
      last.place = at;
      const std::size_t before = numbers.size();
      read_integers(last, take_line(text_, at), format, numbers);
      if (numbers.size() == before) sources_.fail(last, "the nodes of an element end too soon");
    }
    add_element(place, count, block);
    return true;
  }

  void add_element(DeckPlace place, Index count, ElementBlock& block) const {
    const std::vector<Index>& numbers = block.numbers;
    const auto type = types_.find(numbers[1]);
    if (type == types_.end())
      sources_.fail(place,
                    "element type " + std::to_string(numbers[1]) + " is not defined by ET before");
    const TypeShape* const shape = type->second.shape;
    if (!shape) {
      const std::string name = std::to_string(type->second.number);
      if (!is_left_out(type->second.number))
        sources_.fail(place, "elements of type " + name + " are not known");
      ++block.left_out["of type " + name];
      return;
    }
    const auto first = numbers.begin() + std::ptrdiff_t(kHead);
    block.nodes.assign(first, first + count);
    add_cell(*shape, place, block);
  }

  void add_cell(const TypeShape& shape, DeckPlace place, ElementBlock& block) const {
    std::vector<Index>& nodes = block.nodes;
    const Index number = block.numbers[10];
    const std::size_t corners = std::size_t(cell_node_count(shape.linear));
    const std::size_t most = std::size_t(cell_node_count(shape.quadratic));
    if (corners == 4 && nodes.size() == 3 && dimension(shape.linear) == 2)
      nodes.push_back(nodes[2]);
    if (nodes.size() < corners)
      sources_.fail(place, "element " + std::to_string(number) + " has " +
                               std::to_string(nodes.size()) + " nodes, expected " +
                               std::to_string(corners));
    // What follows the corners of a beam without mid-side node tells its orientation.
    const bool has_all =
        nodes.size() >= most && std::find(nodes.begin(), nodes.begin() + std::ptrdiff_t(most), 0) ==
                                    nodes.begin() + std::ptrdiff_t(most);
    const bool has_some = std::any_of(nodes.begin() + std::ptrdiff_t(corners), nodes.end(),
                                      [](Index node) { return node != 0; });
    if (!has_all && has_some && most > corners) ++block.incomplete;
    nodes.resize(has_all ? most : corners);
    const CellType full = has_all ? shape.quadratic : shape.linear;
    const CellType type = reduce_collapsed(full, nodes);
    const int material = int(std::clamp<Index>(block.numbers[0], 0, 1 << 30));
    block.elements.add_element(number, type, nodes, material, place);
  }

  /// CMBLOCK,NAME,NODE|ELEM,count: numbers, negative ones for the end of a range.
  void read_component(std::string_view line, const std::vector<std::string>& fields) {
    Index count = 0;
    if (fields.size() < 4 || !read_integer(fields[3], count) || count < 0 ||
        count > std::ssize(text_))
      fail_expected("CMBLOCK, a name, NODE or ELEM, and a count", line);
    const bool is_of_elements = fields[2].starts_with("ELEM");
    const BlockFormat format = read_format();
    std::vector<Index> numbers;
    while (std::ssize(numbers) < count) {
      if (at_ >= text_.size()) fail("the component ends too soon: the file is cut off");
      const std::size_t before = numbers.size();
      const std::string_view next = next_line();
      read_integers(here(), next, format, numbers);
      if (numbers.size() == before) fail("the component " + fields[1] + " ends too soon");
    }
    NumberedSet set{.name = fields[1],
                    .kind = is_of_elements ? "element component" : "node component",
                    .is_of_elements = is_of_elements,
                    .numbers = {}};
    for (const Index number : numbers) add_number(number, set.numbers);
    mesh_.sets.push_back(std::move(set));
  }

  void add_number(Index number, std::vector<Index>& numbers) const {
    constexpr Index kLongest = 1 << 28;  // 2 GB of numbers: a slip asks for no more
    if (number >= 0 || numbers.empty()) {
      numbers.push_back(number);
      return;
    }
    if (-number - numbers.back() > kLongest) fail("a range of a component is too long");
    for (Index next = numbers.back() + 1; next <= -number; ++next) numbers.push_back(next);
  }

  DeckSources sources_;
  std::string_view text_;
  std::size_t at_ = 0, line_ = 0;
  NumberedMesh mesh_;
  std::map<Index, ElementType> types_;
  std::map<std::string, Index> left_out_;
  Index incomplete_ = 0;
  bool has_rotations_ = false;
};

Recognition recognise(const FileStart& start) {
  const std::string_view text = start.bytes;
  bool is_possible = false;
  for (std::size_t at = 0; at < text.size();) {
    const std::string name = upper(trimmed(take_line(text, at)).substr(0, 10));
    if (name.empty()) continue;
    if (name.starts_with("/PREP7") || name.starts_with("/COM,ANSYS") || name == "NBLOCK" ||
        name.starts_with("NBLOCK,") || name.starts_with("EBLOCK,"))
      return Recognition::Sure;
    const bool is_usual = name.starts_with("FINI") || name.starts_with("ET,");
    if (name.front() != '/' && name.front() != '!' && name.front() != '*' && !is_usual)
      return is_possible ? Recognition::Possible : Recognition::No;
    is_possible |= is_usual;
  }
  return Recognition::No;
}

ReadMesh read(const fs::path& path) { return Reader(path).run(); }

}  // namespace

const MeshFormat& ansys_format() {
  static const MeshFormat format{
      .name = "Ansys", .extensions = {".cdb"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
