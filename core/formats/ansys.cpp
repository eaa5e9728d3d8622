#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "core/cell_topology.h"
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
    for (const auto& [name, count] : left_out_)
      result.remarks.push_back(std::to_string(count) + " elements of type " + name +
                               " are no cells of the mesh; their nodes follow the others");
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
    std::string text(trimmed(found).substr(0, 40));
    std::ranges::replace_if(
        text, [](unsigned char c) { return c < 32 || c > 126; }, '?');
    fail("expected " + std::string(what) + ", found '" + text + "'");
  }

  void read_command(std::string_view line) {
    const char first = line.empty() ? ' ' : char(std::toupper(static_cast<unsigned char>(line[0])));
    if (first != 'N' && first != 'E' && first != 'C') return;
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
    else if (name == "NGEN" || name == "NSYM" || name == "NSCALE")
      fail(name +
           " makes nodes out of others, which can't be moved one by one: write the model "
           "anew with CDWRITE");
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
    types_[number] = int(type);
  }

  BlockFormat read_format() {
    const std::string_view line = next_line();
    const BlockFormat format = parse_format(line);
    if (format.integers == 0 || format.integer_width == 0)
      fail_expected("a format such as (3i9,6e21.13e3)", line);
    return format;
  }

  void read_nodes() {
    const BlockFormat format = read_format();
    if (format.real_width == 0 || format.reals < 3)
      fail("the format of the nodes has no three coordinates");
    const std::size_t first = format.integers * format.integer_width;
    const auto style = std::make_shared<NodeColumns>(first, format.real_width, format.decimals,
                                                     format.exponent_digits);
    NodeRecords records{.file = 0, .style = style};
    while (true) {
      if (at_ >= text_.size()) fail("the nodes end too soon: the file is cut off");
      const std::string_view line = next_line();
      if (line.starts_with('N') || line.starts_with('n') || trimmed(line) == "-1") break;
      if (trimmed(line).empty()) continue;
      read_node(line, format, *style, records);
    }
    mesh_.records.push_back(std::move(records));
  }

  void read_node(std::string_view line, const BlockFormat& format, const NodeStyle& style,
                 NodeRecords& records) {
    Index number = 0;
    const std::string_view field = columns(line, 0, format.integer_width);
    if (!read_integer(field, number) || number < 1 || number > kHighestNumber)
      fail_expected("the number of a node", field);
    Eigen::RowVector3d point;
    const std::string_view bad = style.read(line, point);
    if (!bad.empty()) fail_expected("a coordinate", bad);
    if (line.size() > 0xffff) fail("the line is too long");
    const std::size_t end = format.integers * format.integer_width + 3 * format.real_width;
    has_rotations_ = has_rotations_ || !trimmed(columns(line, end, line.size())).empty();
    records.places.push_back({.place = line_, .length = line.size()});
    records.nodes.push_back(std::ssize(mesh_.node_numbers));
    mesh_.add_node(number, point);
  }

  /// Appends the integers of a line of columns.
  void read_integers(std::string_view line, const BlockFormat& format,
                     std::vector<Index>& numbers) const {
    for (std::size_t i = 0; i < format.integers; ++i) {
      const std::string_view field = columns(line, i * format.integer_width, format.integer_width);
      if (trimmed(field).empty()) return;
      Index number = 0;
      if (!read_integer(field, number) || std::abs(number) > kHighestNumber)
        fail_expected("a number", field);
      numbers.push_back(number);
    }
  }

  void read_elements(const std::vector<std::string>& fields) {
    const bool is_solid = fields.size() > 2 && fields[2] == "SOLID";
    const BlockFormat format = read_format();
    std::vector<Index> numbers;
    while (true) {
      if (at_ >= text_.size()) fail("the elements end too soon: the file is cut off");
      const std::string_view line = next_line();
      if (trimmed(line) == "-1") return;
      if (trimmed(line).empty()) continue;
      numbers.clear();
      read_integers(line, format, numbers);
      if (is_solid)
        read_element(numbers, format);
      else
        ++left_out_["of an EBLOCK without SOLID"];
    }
  }

  /// Material, type, real constants, section, system, birth, body, shape, number of nodes, -,
  /// number, and up to 8 nodes; the others on the next line.
  void read_element(std::vector<Index>& numbers, const BlockFormat& format) {
    constexpr std::size_t kHead = 11, kMostNodes = 100;
    const DeckPlace place = here();
    if (numbers.size() < kHead + 1) fail("expected 11 numbers of an element and its nodes");
    const Index count = numbers[8];
    if (count < 1 || count > Index(kMostNodes))
      fail("the number of nodes of an element is " + std::to_string(count));
    while (numbers.size() < kHead + std::size_t(count)) {
      if (at_ >= text_.size()) fail("the nodes of an element end too soon");
      const std::size_t before = numbers.size();
      read_integers(next_line(), format, numbers);
      if (numbers.size() == before) fail("the nodes of an element end too soon");
    }
    const auto found = types_.find(numbers[1]);
    if (found == types_.end())
      sources_.fail(place,
                    "element type " + std::to_string(numbers[1]) + " is not defined by ET before");
    const std::string name = std::to_string(found->second);
    const TypeShape* const shape = shape_of(found->second);
    if (!shape) {
      if (!is_left_out(found->second))
        sources_.fail(place, "elements of type " + name + " are not known");
      ++left_out_[name];
      return;
    }
    nodes_.assign(numbers.begin() + kHead, numbers.begin() + std::ptrdiff_t(kHead) + count);
    add_element(*shape, numbers[10], int(std::clamp<Index>(numbers[0], 0, 1 << 30)), place);
  }

  void add_element(const TypeShape& shape, Index number, int material, DeckPlace place) {
    const std::size_t corners = std::size_t(cell_node_count(shape.linear));
    const std::size_t most = std::size_t(cell_node_count(shape.quadratic));
    if (corners == 4 && nodes_.size() == 3 && dimension(shape.linear) == 2)
      nodes_.push_back(nodes_[2]);
    if (nodes_.size() < corners)
      sources_.fail(place, "element " + std::to_string(number) + " has " +
                               std::to_string(nodes_.size()) + " nodes, expected " +
                               std::to_string(corners));
    // What follows the corners of a beam without mid-side node tells its orientation.
    const bool has_all = nodes_.size() >= most &&
                         std::find(nodes_.begin(), nodes_.begin() + std::ptrdiff_t(most), 0) ==
                             nodes_.begin() + std::ptrdiff_t(most);
    const bool has_some = std::any_of(nodes_.begin() + std::ptrdiff_t(corners), nodes_.end(),
                                      [](Index node) { return node != 0; });
    if (!has_all && has_some && most > corners) ++incomplete_;
    nodes_.resize(has_all ? most : corners);
    const CellType full = has_all ? shape.quadratic : shape.linear;
    const CellType type = reduce_collapsed(full, nodes_);
    mesh_.add_element(number, type, nodes_, material, place);
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
      read_integers(next_line(), format, numbers);
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
    constexpr Index kLongest = 1 << 28;
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
  std::map<Index, int> types_;
  std::vector<Index> nodes_;
  std::map<std::string, Index> left_out_;
  Index incomplete_ = 0;
  bool has_rotations_ = false;
};

Recognition recognise(const FileStart& start) {
  const std::string_view text = start.bytes;
  for (std::size_t at = 0; at < text.size();) {
    const std::string name = upper(trimmed(take_line(text, at)).substr(0, 10));
    if (name.empty()) continue;
    if (name.starts_with("/PREP7") || name.starts_with("/COM,ANSYS") || name == "NBLOCK" ||
        name.starts_with("NBLOCK,") || name.starts_with("EBLOCK,"))
      return Recognition::Sure;
    if (name.front() != '/' && name.front() != '!' && name.front() != '*') return Recognition::No;
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
