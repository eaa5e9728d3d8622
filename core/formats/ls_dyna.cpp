#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <map>
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

/// Columns of a keyword's integers and coordinates.
enum class Width { Standard, Long, I10 };

/// Solids of second order by the option behind the keyword. P15 is gmsh's.
const std::map<std::string, CellType> kSecondOrder = {
    {"H20", CellType::QuadraticHexahedron},
    {"H27", CellType::TriquadraticHexahedron},
    {"P15", CellType::QuadraticWedge},
};
/// Numbers on an element's line, in columns and at most between commas; gmsh fills its first line
/// with so many.
constexpr std::size_t kColumns = 10, kMostFields = 100, kFilledLine = 11;
constexpr std::size_t kMostPlainNodes = 10;

/// A line that begins with '*': "ELEMENT_SOLID", its columns.
struct Keyword {
  std::string name;
  Width width = Width::Standard;
};

Keyword parse_keyword(std::string_view line, Width deck_width) {
  Keyword keyword{.name = {}, .width = deck_width};
  const std::string text = upper(line.substr(1));
  const std::size_t end = std::min(text.find_first_of(" \t(,"), text.size());
  keyword.name = text.substr(0, end);
  std::string_view rest = trimmed(std::string_view(text).substr(end));
  if (keyword.name.ends_with('+') || rest == "+") keyword.width = Width::Long;
  if (keyword.name.ends_with('-') || rest == "-") keyword.width = Width::Standard;
  if (keyword.name.ends_with('%') || rest == "%") keyword.width = Width::I10;
  while (keyword.name.ends_with('+') || keyword.name.ends_with('-') || keyword.name.ends_with('%'))
    keyword.name.pop_back();
  return keyword;
}

/// The options behind a keyword's name: "_THICKNESS_OFFSET".
std::vector<std::string> options_of(std::string_view name, std::string_view keyword) {
  std::vector<std::string> options;
  name.remove_prefix(keyword.size());
  while (!name.empty()) {
    name.remove_prefix(1);
    const std::size_t end = std::min(name.find('_'), name.size());
    options.emplace_back(name.substr(0, end));
    name.remove_prefix(end);
  }
  return options;
}

bool is_of(std::string_view name, std::string_view keyword) {
  return name.starts_with(keyword) &&
         (name.size() == keyword.size() || name[keyword.size()] == '_');
}

/// Reads a keyword deck.
class Reader {
 public:
  explicit Reader(const fs::path& path) : sources_(path) {}

  ReadMesh run() {
    read_file(0);
    end_element();
    end_ties();
    MeshAssembly assembly(sources_);
    assembly.add(std::move(mesh_));
    for (const auto& [option, type] : kSecondOrder) assembly.order_mid_nodes(type);
    ReadMesh result = assembly.finish(std::move(sources_), "part");
    remark_on_left_out(left_out_, result.remarks);
    return result;
  }

 private:
  enum class Data {
    Skip,
    Nodes,
    Elements,
    LeftOut,
    Title,
    SetHead,
    Set,
    Include,
    Folder,
    Bodies,
    Interpolation
  };

  void read_file(std::size_t file) {
    const std::string_view text = sources_.text(file);
    for (std::size_t at = 0; at < text.size() && !has_ended_;) {
      here_ = {file, at};
      const std::string_view line = take_line(text, at);
      if (line.starts_with('$')) continue;
      if (!line.starts_with('*')) {
        if (data_ != Data::Skip) read_data(line);
        continue;
      }
      read_keyword(line);
      if (data_ != Data::Nodes && data_ != Data::Elements) continue;
      const std::size_t keyword = text.find("\n*", at > 0 ? at - 1 : 0);
      const std::size_t end = keyword == std::string_view::npos ? text.size() : keyword + 1;
      if (end < at + kTextBlock) continue;
      read_data_blocks(file, at, end);
      at = end;
    }
  }

  /// A line under *NODE.
  struct NodeLine {
    DeckPlace place;
    std::size_t length = 0;
    bool is_free = false;
    Index number = 0;
    Eigen::RowVector3d point;
  };

  /// What is known of an element, and of the lines that follow it.
  struct ElementLines {
    DeckPlace place = {};
    std::vector<Index> numbers = {};  ///< of the element, its part, and its nodes
    std::vector<Index> nodes = {};
    int skipped = 0;  ///< lines
    bool has_more_thicknesses = false;
    bool has_commas = false;

    bool is_between() const { return numbers.empty() && skipped == 0; }
    void clear() {
      numbers.clear();
      skipped = 0;
      has_more_thicknesses = false;
    }
  };

  /// Some of the lines under *NODE or *ELEMENT.
  struct DataBlock {
    std::size_t begin = 0, end = 0;
    bool is_whole = false;  ///< all was read, and no element is without its end
    std::vector<NodeLine> nodes;
    NumberedMesh elements;
    ElementLines element = {};
  };

  /// Lines of data on all threads; those of elements over the borders of blocks, and errors, on
  /// one.
  void read_data_blocks(std::size_t file, std::size_t begin, std::size_t end) {
    const std::string_view text = sources_.text(file);
    // A line of the number and the part alone: the nodes are on the next.
    const auto goes_on = [&](std::size_t place) {
      const std::size_t line_begin = text.rfind('\n', place - 2) + 1;
      const std::string_view line = text.substr(line_begin, place - line_begin);
      return data_ == Data::Elements && line.find_last_not_of(" \t\r\n") < 2 * element_width();
    };
    const auto read = [&](DataBlock& block) {
      try {
        read_block(file, block);
      } catch (const Error&) {
        block.is_whole = false;
      }
    };
    const auto take = [&](DataBlock& block) {
      if (block.is_whole && element_.is_between()) {
        for (const NodeLine& node : block.nodes) add_node(node);
        mesh_.reserve_elements(block.elements, blocks_behind(text, block));
        mesh_.append_elements(block.elements, 0, block.elements.element_count());
        return true;
      }
      for (std::size_t at = block.begin; at < block.end;) {
        here_ = {file, at};
        const std::string_view line = take_line(text, at);
        if (!line.starts_with('$')) read_data(line);
      }
      return true;
    };
    read_blocks<DataBlock>(text, begin, end, goes_on, read, take);
  }

  void read_block(std::size_t file, DataBlock& block) const {
    const std::string_view text = sources_.text(file);
    block.nodes.clear();
    block.elements.clear_elements();
    block.element.clear();
    for (std::size_t at = block.begin; at < block.end;) {
      const DeckPlace place{file, at};
      const std::string_view line = take_line(text, at);
      if (line.starts_with('$')) continue;
      if (data_ == Data::Elements)
        read_element(place, line, block.element, block.elements);
      else if (!trimmed(line).empty())
        block.nodes.push_back(node_line(place, line));
    }
    block.is_whole = block.element.is_between();
  }

  void read_keyword(std::string_view line) {
    end_element();
    name_.clear();
    data_ = Data::Skip;
    width_ = deck_width_;
    const Keyword keyword = parse_keyword(line, deck_width_);
    const std::string& name = keyword.name;
    width_ = keyword.width;
    if (name == "END")
      has_ended_ = true;
    else if (name == "KEYWORD")
      read_deck_width(upper(line));
    else if (name == "NODE")
      begin_nodes();
    else if (is_of(name, "ELEMENT"))
      begin_elements(name);
    else if (is_of(name, "SET_NODE") || is_of(name, "SET_SEGMENT"))
      begin_set(name);
    else if (name == "INCLUDE")
      data_ = Data::Include;
    else if (is_of(name, "INCLUDE_PATH"))
      data_ = Data::Folder;
    else if (is_of(name, "CONSTRAINED_NODAL_RIGID_BODY"))
      begin_bodies(name);
    else if (name == "CONSTRAINED_INTERPOLATION")
      begin_interpolation();
    else
      check_other(name);
  }

  void read_deck_width(const std::string& line) {
    std::string text = line;
    std::erase(text, ' ');
    if (text.find("LONG=Y") != std::string::npos) deck_width_ = Width::Long;
    if (text.find("I10=Y") != std::string::npos) deck_width_ = Width::I10;
  }

  void check_other(const std::string& name) const {
    if (is_of(name, "INCLUDE") || is_of(name, "NODE_TRANSFORM") || is_of(name, "NODE_SCALE") ||
        is_of(name, "NODE_REFLECT"))
      sources_.fail(here_, "*" + name +
                               " moves or changes nodes while the deck is read, which is not "
                               "followed: write the deck anew, with its nodes where they are");
  }

  void read_data(std::string_view line) {
    switch (data_) {
      case Data::Skip:
        return;
      case Data::Nodes:
        if (!trimmed(line).empty()) add_node(node_line(here_, line));
        return;
      case Data::Elements:
        return read_element(here_, line, element_, mesh_);
      case Data::LeftOut:
        ++*left_out_lines_;
        return;
      case Data::Title:
        set_.name = trimmed(line);
        data_ = Data::SetHead;
        return;
      case Data::SetHead:
        return read_set_head(line);
      case Data::Set:
        return read_set(line);
      case Data::Include:
        return read_include(line);
      case Data::Folder:
        if (const std::string name = read_name(line); !name.empty()) sources_.add_folder(name);
        return;
      case Data::Bodies:
        return read_body(line);
      case Data::Interpolation:
        return read_interpolation(line);
    }
  }

  [[noreturn]] void fail_expected(std::string_view what, std::string_view found) const {
    sources_.fail_expected(here_, what, found);
  }

  void begin_nodes() {
    data_ = Data::Nodes;
    const std::size_t integer = width_ == Width::Long ? 20 : width_ == Width::I10 ? 10 : 8;
    column_style_ = std::make_shared<NodeColumns>(integer, width_ == Width::Long ? 20 : 16);
    number_width_ = integer;
    records_.fill(~std::size_t{0});
  }

  NodeRecords& node_records(std::size_t file, bool is_free) {
    std::size_t& block = records_[is_free ? 1 : 0];
    if (block >= mesh_.records.size() || mesh_.records[block].file != file) {
      block = mesh_.records.size();
      mesh_.records.push_back({.file = file, .style = is_free ? free_style_ : column_style_});
    }
    return mesh_.records[block];
  }

  NodeLine node_line(DeckPlace place, std::string_view line) const {
    NodeLine node{.place = place, .length = line.size(), .point = {}};
    node.is_free = line.find(',') != std::string_view::npos;
    const std::string_view field =
        node.is_free ? line.substr(0, line.find(',')) : line.substr(0, number_width_);
    if (!read_integer(field, node.number) || node.number < 1 || node.number > kHighestNumber)
      sources_.fail_expected(place, "the number of a node", field);
    const NodeStyle& style = node.is_free ? *free_style_ : *column_style_;
    const std::string_view bad = style.read(line, node.point);
    if (!bad.empty()) sources_.fail_expected(place, "a coordinate", bad);
    if (line.size() > 0xffff) sources_.fail(place, "the line is too long");
    return node;
  }

  void add_node(const NodeLine& node) {
    NodeRecords& records = node_records(node.place.file, node.is_free);
    records.places.push_back({.place = node.place.place, .length = node.length});
    records.nodes.push_back(std::ssize(mesh_.node_numbers));
    mesh_.add_node(node.number, node.point);
  }

  /// Appends the integers of a line; blank ones are 0.
  void read_integers(DeckPlace place, std::string_view line, std::size_t width, std::size_t most,
                     std::vector<Index>& numbers) const {
    const auto add = [&](std::string_view field) {
      Index number = 0;
      const bool is_number = read_integer(field, number) && std::abs(number) <= kHighestNumber;
      if (!is_number && !trimmed(field).empty()) sources_.fail_expected(place, "a number", field);
      numbers.push_back(number);
    };
    const std::size_t end = numbers.size() + most;
    if (line.find(',') != std::string_view::npos) {
      FreeFields fields(line);
      std::string_view field;
      while (numbers.size() < end && fields.next(field)) add(field);
      return;
    }
    for (std::size_t at = 0; at < line.size() && numbers.size() < end; at += width)
      add(line.substr(at, width));
  }

  std::size_t element_width() const {
    return width_ == Width::Long ? 20 : width_ == Width::I10 ? 10 : 8;
  }

  void begin_elements(const std::string& name) {
    kind_ = Kind::None;
    solid_ = CellType{};
    extra_lines_ = 0;
    has_thickness_ = false;
    if (is_of(name, "ELEMENT_SOLID")) {
      kind_ = Kind::Solid;
      for (const std::string& option : options_of(name, "ELEMENT_SOLID")) {
        const auto order = kSecondOrder.find(option);
        if (order != kSecondOrder.end())
          solid_ = order->second;
        else
          add_extra_lines(name, option, {{"ORTHO", 2}, {"DOF", 1}});
      }
    } else if (is_of(name, "ELEMENT_TSHELL")) {
      kind_ = Kind::Solid;
      for (const std::string& option : options_of(name, "ELEMENT_TSHELL"))
        add_extra_lines(name, option, {{"BETA", 1}});
    } else if (is_of(name, "ELEMENT_SHELL")) {
      kind_ = Kind::Shell;
      bool has_thickness = false;
      for (const std::string& option : options_of(name, "ELEMENT_SHELL")) {
        const bool is_thickness = option == "THICKNESS" || option == "BETA" || option == "MCID";
        // They share a line.
        if (!is_thickness || !has_thickness)
          add_extra_lines(name, option,
                          {{"THICKNESS", 1}, {"BETA", 1}, {"MCID", 1}, {"OFFSET", 1}, {"DOF", 1}});
        has_thickness = has_thickness || is_thickness;
      }
      has_thickness_ = has_thickness;
    } else if (name == "ELEMENT_BEAM") {
      kind_ = Kind::Beam;
    }
    data_ = Data::Elements;
    if (kind_ == Kind::None) {
      data_ = Data::LeftOut;
      left_out_lines_ = &left_out_["lines of *" + name];
    }
  }

  void add_extra_lines(const std::string& name, const std::string& option,
                       const std::map<std::string, int>& known) {
    const auto found = known.find(option);
    if (found == known.end())
      sources_.fail(here_, "elements of *" + name + " are not known (the option " + option + ")");
    extra_lines_ += found->second;
  }

  /// An element takes a line, or one for its number and part and others for its nodes, and what its
  /// options add. Between commas gmsh fills lines, whatever they hold.
  void read_element(DeckPlace place, std::string_view line, ElementLines& element,
                    NumberedMesh& mesh) const {
    if (element.skipped > 0) {
      --element.skipped;
      return;
    }
    if (trimmed(line).empty()) return;
    std::vector<Index>& numbers = element.numbers;
    const bool has_head = !numbers.empty();
    if (!has_head) element.place = place;
    const bool is_of_second_order = solid_ != CellType{};
    if (!has_head) element.has_commas = line.find(',') != std::string_view::npos;
    if (element.has_commas) {
      if (const auto last = line.find_last_not_of(" \t\r\n"); line[last] == ',')
        line = line.substr(0, last);
      read_integers(place, line, line.size(), kind_ == Kind::Solid ? kMostFields : kColumns,
                    numbers);
    } else {
      read_integers(place, line, element_width(), !has_head && is_of_second_order ? 2 : kColumns,
                    numbers);
    }
    if (!has_head) {
      if (numbers.size() < 2)
        sources_.fail_expected(place, "the numbers of an element and of its part", line);
      const bool is_head =
          kind_ == Kind::Solid &&
          std::all_of(numbers.begin() + 2, numbers.end(), [](Index number) { return number == 0; });
      if (is_head) {
        numbers.resize(2);
        return;
      }
    }
    if (kind_ == Kind::Solid) {
      const std::size_t nodes = is_of_second_order ? cell_node_count(solid_) : kMostPlainNodes;
      const auto end = numbers.begin() + std::min(numbers.size(), 2 + nodes);
      if (std::any_of(end, numbers.end(), [](Index number) { return number != 0; }))
        sources_.fail(element.place, "element " + std::to_string(numbers[0]) + " has more than " +
                                         std::to_string(nodes) + " nodes");
      const bool is_filled = !has_head && numbers.size() == kFilledLine;
      if (is_of_second_order ? numbers.size() < 2 + nodes : is_filled) return;
    }
    add_element(place, element, mesh);
    numbers.clear();
    // Those at mid-side nodes have a line of their own.
    element.skipped = extra_lines_ + (element.has_more_thicknesses ? 1 : 0);
    element.has_more_thicknesses = false;
  }

  void end_element() {
    if (!element_.numbers.empty())
      sources_.fail(element_.place,
                    "the nodes of element " + std::to_string(element_.numbers[0]) + " are missing");
    element_.skipped = 0;
  }

  void add_element(DeckPlace place, ElementLines& element, NumberedMesh& mesh) const {
    const Index number = element.numbers[0], part = element.numbers[1];
    std::vector<Index>& nodes = element.nodes;
    nodes.assign(element.numbers.begin() + 2, element.numbers.end());
    const CellType type = solid_ != CellType{}   ? solid_
                          : kind_ == Kind::Solid ? solid_type(nodes)
                          : kind_ == Kind::Shell ? shell_type(element)
                                                 : beam_type(nodes);
    if (type == CellType{} || std::ranges::any_of(nodes, [](Index node) { return node < 1; }))
      sources_.fail(element.place, "element " + std::to_string(number) +
                                       " has too few nodes, or some that are no numbers of nodes");
    if (part < 0 || part > (1 << 30))
      sources_.fail_expected(place, "the number of a part", std::to_string(part));
    mesh.add_element(number, type, nodes, int(part), element.place);
  }

  static CellType solid_type(std::vector<Index>& nodes) {
    nodes.resize(10);
    if (nodes[8] != 0 && nodes[9] != 0) return CellType::QuadraticTetra;
    // A solid of four nodes repeats the last or leaves the others out.
    nodes.resize(8);
    for (std::size_t i = 4; i < 8; ++i)
      if (nodes[i] == 0) nodes[i] = nodes[i - 1];
    return reduce_collapsed(CellType::Hexahedron, nodes);
  }

  CellType shell_type(ElementLines& element) const {
    std::vector<Index>& nodes = element.nodes;
    nodes.resize(8);
    const bool has_middles = nodes[4] != 0 && nodes[5] != 0 && nodes[6] != 0;
    if (nodes[3] == 0) nodes[3] = nodes[2];
    const bool is_triangle = nodes[3] == nodes[2];
    element.has_more_thicknesses = has_middles && has_thickness_;
    if (has_middles && is_triangle) {
      nodes = {nodes[0], nodes[1], nodes[2],
               nodes[4], nodes[5], nodes[7] != 0 ? nodes[7] : nodes[6]};
      return CellType::QuadraticTriangle;
    }
    if (has_middles && nodes[7] != 0) return CellType::QuadraticQuad;
    nodes.resize(4);
    return reduce_collapsed(CellType::Quad, nodes);
  }

  static CellType beam_type(std::vector<Index>& nodes) {
    nodes.resize(2);
    return CellType::Line;
  }

  void begin_set(const std::string& name) {
    const bool is_segment = is_of(name, "SET_SEGMENT");
    bool has_title = false;
    is_range_ = false;
    for (const std::string& option : options_of(name, is_segment ? "SET_SEGMENT" : "SET_NODE")) {
      if (option == "TITLE")
        has_title = true;
      else if (option == "GENERATE" && !is_segment)
        is_range_ = true;
      else if (option != "LIST" && option != "COLUMN")
        return;  // by boxes, parts, ...: not read
    }
    set_ = {.name = {}, .kind = is_segment ? "segment set" : "node set", .numbers = {}};
    is_column_ = name.find("COLUMN") != std::string::npos;
    is_segment_ = is_segment;
    data_ = has_title ? Data::Title : Data::SetHead;
  }

  std::size_t set_width() const { return width_ == Width::Long ? 20 : 10; }

  void read_set_head(std::string_view line) {
    std::vector<Index> numbers;
    read_integers(here_, line, set_width(), 1, numbers);
    if (numbers.empty()) fail_expected("the number of a set", line);
    if (set_.name.empty()) set_.name = std::to_string(numbers[0]);
    if (!is_segment_) node_sets_.emplace(numbers[0], mesh_.sets.size());
    mesh_.sets.push_back(std::move(set_));
    data_ = Data::Set;
  }

  void read_set(std::string_view line) {
    if (trimmed(line).empty()) return;
    std::vector<Index> numbers;
    const std::size_t most = is_column_ ? 1 : is_segment_ ? 4 : 8;
    read_integers(here_, line, set_width(), most, numbers);
    std::vector<Index>& all = mesh_.sets.back().numbers;
    if (!is_range_) {
      all.insert(all.end(), numbers.begin(), numbers.end());
      return;
    }
    constexpr Index kLongest = 1 << 28;  // 2 GB of numbers: a slip asks for no more
    for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) {
      if (numbers[i + 1] - numbers[i] > kLongest) sources_.fail(here_, "the range is too long");
      for (Index number = numbers[i]; number != 0 && number <= numbers[i + 1]; ++number)
        all.push_back(number);
    }
  }

  /// What moves as one body: the first node is tied to the others, and to those of sets.
  struct BodyLines {
    std::vector<Index> nodes = {};
    std::vector<Index> sets = {};
  };

  void begin_bodies(const std::string& name) {
    const std::vector<std::string> options = options_of(name, "CONSTRAINED_NODAL_RIGID_BODY");
    has_one_body_ = !options.empty();
    skipped_ = std::ranges::find(options, "TITLE") != options.end() ? 1 : 0;
    data_ = Data::Bodies;
  }

  /// Number, system, set of nodes, node; with options, more lines follow.
  void read_body(std::string_view line) {
    if (skipped_ > 0) {
      --skipped_;
      return;
    }
    if (has_one_body_) data_ = Data::Skip;
    const std::vector<Index> numbers = tie_numbers(line, 4);
    if (numbers.size() < 3 || numbers[2] == 0) return;
    BodyLines& body = bodies_.emplace_back();
    body.sets.push_back(numbers[2]);
    if (numbers.size() == 4 && numbers[3] != 0) body.nodes.push_back(numbers[3]);
  }

  void begin_interpolation() {
    data_ = Data::Interpolation;
    is_first_line_ = true;
  }

  /// Number, node that depends, its directions, system, kind of the others; then a line for each
  /// other node, or each set of others.
  void read_interpolation(std::string_view line) {
    const std::vector<Index> numbers = tie_numbers(line, is_first_line_ ? 5 : 1);
    if (std::exchange(is_first_line_, false)) {
      bodies_.emplace_back();
      if (numbers.size() > 1) bodies_.back().nodes.push_back(numbers[1]);
      are_sets_ = numbers.size() == 5 && numbers[4] == 1;
      if (numbers.size() < 2) data_ = Data::Skip;
    } else if (!numbers.empty()) {
      (are_sets_ ? bodies_.back().sets : bodies_.back().nodes).push_back(numbers[0]);
    }
  }

  /// None where one is no number.
  std::vector<Index> tie_numbers(std::string_view line, std::size_t most) const {
    std::vector<Index> numbers;
    try {
      read_integers(here_, line, set_width(), most, numbers);
    } catch (const Error&) {
      numbers.clear();
    }
    return numbers;
  }

  void end_ties() {
    for (BodyLines& body : bodies_) {
      for (const Index set : body.sets) {
        const auto found = node_sets_.find(set);
        if (found == node_sets_.end()) continue;
        const std::vector<Index>& nodes = mesh_.sets[found->second].numbers;
        body.nodes.insert(body.nodes.end(), nodes.begin(), nodes.end());
      }
      if (body.nodes.size() > 1)
        mesh_.ties.push_back({body.nodes[0], {body.nodes.begin() + 1, body.nodes.end()}});
    }
  }

  /// A name goes on in the next line behind " +"; empty before its last line.
  std::string read_name(std::string_view line) {
    std::string_view part = trimmed(line);
    const bool goes_on = part.ends_with(" +");
    if (goes_on) part = trimmed(part.substr(0, part.size() - 1));
    name_ += part;
    return goes_on ? std::string() : std::exchange(name_, {});
  }

  void read_include(std::string_view line) {
    const std::string name = read_name(line);
    if (name.empty()) return;
    const DeckPlace from = here_;
    data_ = Data::Skip;
    read_file(sources_.include(name, from));
    sources_.leave();
    end_element();
    has_ended_ = false;
    here_ = from;
    data_ = Data::Include;
  }

  enum class Kind { None, Solid, Shell, Beam };

  DeckSources sources_;
  NumberedMesh mesh_;
  std::map<std::string, Index> left_out_;

  // What is being read.
  DeckPlace here_;
  Width deck_width_ = Width::Standard, width_ = Width::Standard;
  Data data_ = Data::Skip;
  bool has_ended_ = false;
  std::shared_ptr<const NodeStyle> free_style_ = std::make_shared<FreeNodeLine>();
  std::shared_ptr<const NodeStyle> column_style_;
  std::size_t number_width_ = 8;
  std::array<std::size_t, 2> records_{};  ///< of the keyword: in columns, and free
  Kind kind_ = Kind::None;
  bool has_thickness_ = false;
  int extra_lines_ = 0;
  CellType solid_ = {};  ///< of solids of second order that a keyword names
  ElementLines element_;
  Index* left_out_lines_ = nullptr;
  NumberedSet set_;
  bool is_range_ = false, is_column_ = false, is_segment_ = false;
  std::map<Index, std::size_t> node_sets_;  ///< of the mesh's sets
  std::vector<BodyLines> bodies_;
  bool has_one_body_ = false, is_first_line_ = false, are_sets_ = false;
  int skipped_ = 0;   ///< lines
  std::string name_;  ///< of a file or a folder
};

/// *KEYWORD begins it; without it, names with '_' tell them from Abaqus's.
Recognition recognise(const FileStart& start) {
  const std::string_view text = start.bytes;
  bool has_keyword = false;
  for (std::size_t at = 0; at < text.size();) {
    const std::string_view line = take_line(text, at);
    if (line.starts_with('$') || trimmed(line).empty()) continue;
    if (!line.starts_with('*')) {
      if (!has_keyword) return Recognition::No;
      continue;
    }
    has_keyword = true;
    const std::string name = parse_keyword(line, Width::Standard).name;
    if (name == "KEYWORD" || is_of(name, "ELEMENT_SOLID") || is_of(name, "ELEMENT_SHELL") ||
        is_of(name, "ELEMENT_BEAM") || is_of(name, "SET_NODE") || is_of(name, "SECTION_SHELL") ||
        is_of(name, "SECTION_SOLID"))
      return Recognition::Sure;
  }
  return has_keyword ? Recognition::Possible : Recognition::No;
}

ReadMesh read(const fs::path& path) { return Reader(path).run(); }

}  // namespace

const MeshFormat& ls_dyna_format() {
  static const MeshFormat format{.name = "LS-DYNA",
                                 .extensions = {".k", ".key", ".dyn"},
                                 .recognise = recognise,
                                 .read = read};
  return format;
}

}  // namespace cadmorph
