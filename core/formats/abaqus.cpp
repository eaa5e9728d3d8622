#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/formats/deck.h"
#include "core/formats/formats.h"
#include "core/formats/node_styles.h"
#include "core/formats/number_fields.h"
#include "core/formats/numbered_mesh.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr std::size_t kFieldWidth = 20;  // what Abaqus allows and CalculiX reads of a number

std::string_view unquoted(std::string_view text) {
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"')
    return text.substr(1, text.size() - 2);
  return text;
}

/// What an element type of the deck becomes.
struct ElementKind {
  enum class Use { Cell, LeftOut, Unknown };
  Use use = Use::Unknown;
  CellType type = CellType::Vertex;
  bool is_plane = false;  ///< its faces S1, S2, ... are edges
};

struct ElementFamily {
  std::string_view prefix;  ///< the number of nodes follows; longer ones first
  int dimension;            ///< -1: left out
  bool is_plane = false;
};

constexpr ElementFamily kFamilies[] = {
    {"C3D", 3},        {"DC3D", 3},        {"DCC3D", 3},        {"AC3D", 3},
    {"QC3D", 3},       {"F3D", 3},         {"FC3D", 3},         {"EC3D", 3},
    {"COH3D", 3},      {"CSS", 3},         {"SC", 3},           {"CPS", 2, true},
    {"CPEG", 2, true}, {"CPE", 2, true},   {"CAX", 2, true},    {"CGAX", 2, true},
    {"DC2D", 2, true}, {"DCC2D", 2, true}, {"DCAX", 2, true},   {"DCCAX", 2, true},
    {"AC2D", 2, true}, {"ACAX", 2, true},  {"WARP2D", 2, true}, {"STRI", 2},
    {"DS", 2},         {"M3D", 2},         {"SFM3D", 2},        {"S", 2},
    {"US", 2},         {"T2D", 1},         {"T3D", 1},          {"B2", 1},
    {"B3", 1},         {"PIPE2", 1},       {"PIPE3", 1},        {"ELBOW3", 1},
    {"SAX", 1},        {"DSAX", 1},        {"MAX", 1},          {"CIN", -1},
    {"R3D", 2},        {"R2D", -1},        {"RAX", -1},         {"RB", -1},
    {"SPRING", -1},    {"DASHPOT", -1},    {"MASS", -1},        {"ROTARYI", -1},
    {"HEATCAP", -1},   {"DCOUP", -1},      {"CONN", -1},        {"GAP", -1},
    {"DGAP", -1},      {"JOINTC", -1},     {"ITS", -1},         {"ITT", -1},
    {"DRAG", -1},      {"DC1D", -1},       {"AC1D", -1},        {"FRAME", -1},
    {"GK", -1},        {"U", -1},          {"D", -1},
};

CellType cell_type(int dimension, int nodes) {
  using enum CellType;
  constexpr CellType kTypes[][9] = {
      {Line, QuadraticEdge},
      {Triangle, Quad, QuadraticTriangle, QuadraticQuad, BiquadraticQuad},
      {Tetra, Pyramid, Wedge, Hexahedron, QuadraticTetra, QuadraticPyramid, QuadraticWedge,
       QuadraticHexahedron, TriquadraticHexahedron}};
  for (const CellType type : kTypes[dimension - 1])
    if (type != CellType{} && cell_node_count(type) == nodes) return type;
  return CellType{};
}

/// The digits that follow the family's prefix tell the number of nodes: C3D10M, S8R5, CPE4.
ElementKind element_kind(const std::string& name) {
  using Use = ElementKind::Use;
  ElementKind kind;
  const ElementFamily* family = nullptr;
  for (const ElementFamily& candidate : kFamilies) {
    if (!name.starts_with(candidate.prefix)) continue;
    const bool has_digit = name.size() > candidate.prefix.size() &&
                           std::isdigit(static_cast<unsigned char>(name[candidate.prefix.size()]));
    if (candidate.dimension > 0 && !has_digit) continue;
    if (!family || candidate.prefix.size() > family->prefix.size()) family = &candidate;
  }
  if (!family) return kind;
  if (family->dimension < 0) return {.use = Use::LeftOut};
  const std::string_view rest = std::string_view(name).substr(family->prefix.size());
  int nodes = 0;
  std::from_chars(rest.data(), rest.data() + rest.size(), nodes);
  const bool is_beam = family->prefix.starts_with('B') || family->prefix.starts_with("PIPE") ||
                       family->prefix.starts_with("ELBOW");
  if (is_beam) nodes = nodes == 2 ? 3 : 2;                                // B31, B32, B33
  if (family->prefix.ends_with("AX") && family->dimension == 1) ++nodes;  // SAX1, SAX2
  if (family->prefix == "STRI") nodes = nodes == 65 ? 6 : nodes;
  if (family->prefix == "S" && name.starts_with("S4R5")) nodes = 4;
  if (rest.find('V') != std::string_view::npos) return kind;  // C3D15V: a number that varies
  kind.type = cell_type(family->dimension, nodes);
  kind.use = kind.type == CellType{} ? Use::Unknown : Use::Cell;
  kind.is_plane = family->is_plane;
  return kind;
}

/// Corners of the faces S1, S2, ... of the solid elements.
std::span<const std::array<int, 4>> face_corners(CellType type) {
  using enum CellType;
  using Faces = std::array<int, 4>;
  static constexpr Faces kTetra[] = {{0, 1, 2, -1}, {0, 3, 1, -1}, {1, 3, 2, -1}, {2, 3, 0, -1}};
  static constexpr Faces kHexahedron[] = {{0, 1, 2, 3}, {4, 7, 6, 5}, {0, 4, 5, 1},
                                          {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}};
  static constexpr Faces kWedge[] = {
      {0, 1, 2, -1}, {3, 5, 4, -1}, {0, 3, 4, 1}, {1, 4, 5, 2}, {2, 5, 3, 0}};
  static constexpr Faces kPyramid[] = {
      {0, 1, 2, 3}, {0, 4, 1, -1}, {1, 4, 2, -1}, {2, 4, 3, -1}, {3, 4, 0, -1}};
  switch (type) {
    case Tetra:
    case QuadraticTetra:
      return kTetra;
    case Hexahedron:
    case QuadraticHexahedron:
    case TriquadraticHexahedron:
      return kHexahedron;
    case Wedge:
    case QuadraticWedge:
      return kWedge;
    case Pyramid:
    case QuadraticPyramid:
      return kPyramid;
    default:
      return {};
  }
}

bool is_corner(const LocalFace& face, int node) {
  const auto corners =
      std::span(face.nodes).first(std::size_t(corner_count(face.type, face.count)));
  return std::ranges::find(corners, node) != corners.end();
}

/// Local nodes of face `number` (from 1) of a cell; all where there is no such face.
std::vector<int> face_nodes(CellType type, bool is_edge, int number) {
  std::vector<int> nodes;
  const auto faces = face_corners(type);
  if (number >= 1 && number <= std::ssize(faces)) {
    const auto& corners = faces[std::size_t(number - 1)];
    for (const LocalFace& face : local_faces(type)) {
      const bool is_it =
          std::ranges::all_of(corners, [&](int c) { return c < 0 || is_corner(face, c); }) &&
          (corners[3] < 0) == (corner_count(face.type, face.count) == 3);
      if (is_it) nodes.assign(face.nodes.begin(), face.nodes.begin() + face.count);
    }
    return nodes;
  }
  const int count = cell_node_count(type);
  const int corners = dimension(type) == 2 ? corner_count(type, count) : 0;
  if (is_edge && number >= 1 && number <= corners) {
    nodes = {number - 1, number % corners};
    if (count >= 2 * corners) nodes.push_back(corners + number - 1);
    return nodes;
  }
  for (int i = 0; i < count; ++i) nodes.push_back(i);
  return nodes;
}

/// A line that begins with '*': its name without blanks, and its parameters, in capitals.
struct Keyword {
  std::string name;
  std::map<std::string, std::string> parameters;  ///< their values as they are spelled

  bool has(const std::string& key) const { return parameters.contains(key); }
  std::string get(const std::string& key) const {
    const auto found = parameters.find(key);
    return found == parameters.end() ? std::string() : found->second;
  }
};

Keyword parse_keyword(std::string_view line) {
  Keyword keyword;
  line.remove_prefix(1);
  for (bool is_name = true; !line.empty(); is_name = false) {
    const std::size_t comma = std::min(line.find(','), line.size());
    const std::string_view part = trimmed(line.substr(0, comma));
    line.remove_prefix(std::min(comma + 1, line.size()));
    if (is_name) {
      keyword.name = upper(part);
      std::erase(keyword.name, ' ');
      continue;
    }
    const std::size_t equals = std::min(part.find('='), part.size());
    const std::string_view value =
        equals < part.size() ? trimmed(part.substr(equals + 1)) : std::string_view();
    keyword.parameters[upper(trimmed(part.substr(0, equals)))] = unquoted(value);
  }
  return keyword;
}

/// A set as the deck gives it; its members may be sets, and may be of an instance.
struct SetLines {
  struct Member {
    Index number = 0;
    std::string set = {};       ///< in capitals; empty: the number counts
    std::string instance = {};  ///< in capitals; empty: the own one
    int face = 0;               ///< of a surface
    bool is_edge = false;
  };
  std::string name;
  std::string kind;
  bool is_of_elements = false;
  std::vector<Index> numbers = {};  ///< members without anything else
  std::vector<Member> members = {};
};

/// Sets of one kind by their names in capitals, in the order of the deck.
struct SetTable {
  std::vector<SetLines> sets;
  std::map<std::string, std::size_t> by_name;

  SetLines& get(const std::string& name, const std::string& kind, bool is_of_elements) {
    const auto [found, is_new] = by_name.emplace(upper(name), sets.size());
    if (is_new)
      sets.push_back({.name = name,
                      .kind = kind,
                      .is_of_elements = is_of_elements,
                      .numbers = {},
                      .members = {}});
    return sets[found->second];
  }
  const SetLines* find(const std::string& upper_name) const {
    const auto found = by_name.find(upper_name);
    return found == by_name.end() ? nullptr : &sets[found->second];
  }
};

/// A node, or a set of some, that the deck ties to others.
struct TieLines {
  SetLines::Member nodes = {};
  SetLines others = {};
  SetLines::Member surface = {};  ///< whose nodes are others, too
};

/// A part, or the whole of a deck without parts (and what an assembly has of its own).
struct Part {
  std::string name = {};
  NumberedMesh mesh = {};
  std::vector<bool> is_plane = {};  ///< of each element
  SetTable nodes = {}, elements = {}, surfaces = {};
  std::vector<std::pair<std::string, std::string>> sections = {};  ///< set of elements, material
  std::vector<TieLines> ties = {};
  /// The node of an element of a coupling, and where such are counted, by its set in capitals.
  std::map<std::string, std::pair<Index, Index*>> couplings = {};
  std::vector<std::string> element_sets = {};  ///< that *ELEMENT names, in capitals, each once
  int instances = 0;
  int placed = 0;  ///< of the instances; after the last the mesh is gone
};

struct Instance {
  std::string name;
  std::string part;
  DeckPlace place;
  std::vector<NodeFrame> frames;
};

/// A part in the mesh.
struct Placed {
  std::string instance;  ///< in capitals; empty: the deck's own
  const Part* part = nullptr;
  NumberTable elements = {};
  MeshAssembly::Placed nodes = {};
};

/// Reads a deck of Abaqus or CalculiX.
class Reader {
 public:
  explicit Reader(const fs::path& path) : sources_(path) {}

  ReadMesh run() {
    read_file(0);
    end_keyword();
    if (is_in_part_) sources_.fail(part_place_, "*END PART is missing");
    assemble();
    ReadMesh result =
        assembly_.finish(std::move(sources_), has_sections_ ? "material" : "element set");
    add_remarks(result);
    return result;
  }

 private:
  enum class Data { Skip, Nodes, Elements, Set, Surface, System, Instance, Coupling, Pairs };

  void read_file(std::size_t file) {
    const std::string_view text = sources_.text(file);
    for (std::size_t at = 0; at < text.size();) {
      here_ = {file, at};
      const std::string_view line = take_line(text, at);
      if (!line.starts_with('*') || line.starts_with("**")) {
        read_data(line);
        continue;
      }
      read_keyword(joined(text, line, at));
      if (data_ != Data::Nodes && (data_ != Data::Elements || left_out_)) continue;
      const std::size_t end = end_of_data(text, at);
      if (end - at < kTextBlock) continue;
      read_data_blocks(file, at, end);
      at = end;
    }
  }

  /// The next keyword, or the end of the text.
  static std::size_t end_of_data(std::string_view text, std::size_t at) {
    if (at > 0) --at;  // the end of the line before
    while (true) {
      at = text.find("\n*", at);
      if (at == std::string_view::npos) return text.size();
      if (!text.substr(at).starts_with("\n**")) return at + 1;
      ++at;
    }
  }

  /// A line under *NODE.
  struct NodeLine {
    DeckPlace place;
    std::size_t length = 0;
    Index number = 0;
    Eigen::RowVector3d point;
    Index long_numbers = 0;
    bool has_normals = false;
  };

  /// Some of the lines under *NODE or *ELEMENT.
  struct DataBlock {
    std::size_t begin = 0, end = 0;
    bool is_whole = false;  ///< all was read, and no element is without its end
    std::vector<NodeLine> nodes;
    NumberedMesh elements;
    std::vector<Index> element = {};  ///< that is being read: its number and nodes
  };

  /// Lines of data on all threads; those that go on in the next block, and errors, on one.
  void read_data_blocks(std::size_t file, std::size_t begin, std::size_t end) {
    const std::string_view text = sources_.text(file);
    const auto goes_on = [&](std::size_t place) {
      const std::size_t line_end = text.find_last_not_of(" \t\r\n", place - 1);
      return line_end != std::string_view::npos && text[line_end] == ',' && data_ == Data::Elements;
    };
    const auto read = [&](DataBlock& block) {
      try {
        block.is_whole = read_block(file, block);
      } catch (const Error&) {
        block.is_whole = false;
      }
    };
    const auto take = [&](DataBlock& block) {
      if (block.is_whole && element_.empty()) {
        add_block(file, block);
        return true;
      }
      for (std::size_t at = block.begin; at < block.end;) {
        here_ = {file, at};
        read_data(take_line(text, at));
      }
      return true;
    };
    read_blocks<DataBlock>(text, begin, end, goes_on, read, take);
  }

  /// False where the last element goes on behind the block.
  bool read_block(std::size_t file, DataBlock& block) const {
    const std::string_view text = sources_.text(file);
    const auto width = std::size_t(element_nodes_) + 1;
    block.nodes.clear();
    block.elements.clear_elements();
    block.element.clear();
    DeckPlace element_place;
    for (std::size_t at = block.begin; at < block.end;) {
      const DeckPlace place{file, at};
      const std::string_view line = take_line(text, at);
      if (line.starts_with("**") || trimmed(line).empty()) continue;
      if (data_ == Data::Nodes) {
        block.nodes.push_back(node_line(place, line));
        continue;
      }
      if (block.element.empty()) element_place = place;
      append_numbers(place, line, block.element);
      if (block.element.size() > width) return false;
      if (block.element.size() < width) continue;
      add_element(block.element, element_place, block.elements);
      block.element.clear();
    }
    return block.element.empty();
  }

  void add_block(std::size_t file, const DataBlock& block) {
    Part& in = part();
    for (const NodeLine& node : block.nodes) {
      here_ = node.place;
      add_node(node);
    }
    in.mesh.reserve_elements(block.elements, blocks_behind(sources_.text(file), block));
    in.mesh.append_elements(block.elements, 0, block.elements.element_count());
    end_elements(block.elements.element_numbers);
  }

  /// A keyword's line goes on behind a comma at its end.
  static std::string joined(std::string_view text, std::string_view line, std::size_t& at) {
    std::string result(line);
    while (trimmed(result).ends_with(',') && at < text.size() && text[at] != '*')
      result += take_line(text, at);
    return result;
  }

  void read_data(std::string_view line) {
    if (line.starts_with("**") || data_ == Data::Skip || trimmed(line).empty()) return;
    switch (data_) {
      case Data::Skip:
        return;
      case Data::Nodes:
        return read_node(line);
      case Data::Elements:
        return read_element(line);
      case Data::Set:
        return read_set(line);
      case Data::Surface:
        return read_surface(line);
      case Data::Coupling:
        return read_coupling(line);
      case Data::Pairs:
        return read_pair(line);
      case Data::System:
      case Data::Instance:
        return read_frame_line(line);
    }
  }

  void read_keyword(const std::string& line) {
    const Keyword keyword = parse_keyword(line);
    const std::string& name = keyword.name;
    // What it includes may go on with the data.
    if (name == "INCLUDE") return read_include(keyword.get("INPUT"));
    end_keyword();
    keyword_place_ = here_;
    has_sections_ = has_sections_ || name.ends_with("SECTION");
    if (name == "NODE")
      begin_nodes(keyword);
    else if (name == "ELEMENT")
      begin_elements(keyword);
    else if (name == "NSET" || name == "ELSET")
      begin_set(keyword);
    else if (name == "SURFACE")
      begin_surface(keyword);
    else if (name == "SOLIDSECTION")
      part().sections.emplace_back(upper(keyword.get("ELSET")), upper(keyword.get("MATERIAL")));
    else if (name == "SYSTEM")
      begin_frame(Data::System);
    else if (name == "PART")
      begin_part(keyword);
    else if (name == "ENDPART")
      is_in_part_ = false;
    else if (name == "INSTANCE")
      begin_instance(keyword);
    else if (name == "COUPLING" || name == "KINEMATICCOUPLING" || name == "DISTRIBUTINGCOUPLING" ||
             name == "RIGIDBODY")
      begin_tie(keyword);
    else if (name == "MPC")
      begin_pairs(keyword);
    else
      check_other(name);
    if (data_ != Data::Skip && keyword.has("INPUT")) read_include(keyword.get("INPUT"));
  }

  void end_keyword() {
    if (!element_.empty())
      sources_.fail(element_place_, "the nodes of element " + std::to_string(element_[0]) +
                                        " end too soon: " + std::to_string(element_.size() - 1) +
                                        " of " + std::to_string(element_nodes_));
    if (data_ == Data::System) system_ = system_of(frame_numbers_);
    if (data_ == Data::Instance) instances_.back().frames = instance_frames(frame_numbers_);
    data_ = Data::Skip;
    frame_numbers_.clear();
  }

  /// What would make nodes out of others, or can't be told where it stands, is refused.
  void check_other(const std::string& name) {
    if (name == "NGEN" || name == "NFILL" || name == "NCOPY" || name == "NMAP" ||
        name == "SYMMETRICMODELGENERATION")
      sources_.fail(here_, "*" + name +
                               " makes nodes out of others, which can't be moved one by one: write "
                               "the deck with all its nodes under *NODE");
    if (name == "ELGEN" || name == "ELCOPY")
      sources_.fail(here_, "*" + name +
                               " makes elements out of others, which is not read: write the deck "
                               "with all its elements under *ELEMENT");
    if (name == "ORIENTATION" || name == "TRANSFORM") located_.insert({name, 0});
  }

  void read_include(const std::string& name) {
    if (name.empty()) sources_.fail(here_, "expected INPUT= and the name of a file");
    const DeckPlace from = here_;
    read_file(sources_.include(name, from));
    sources_.leave();
    here_ = from;
  }

  Part& part() { return parts_[is_in_part_ ? current_part_ : 0]; }

  void begin_part(const Keyword& keyword) {
    const std::string name = upper(keyword.get("NAME"));
    if (name.empty()) sources_.fail(here_, "expected NAME= and the name of the part");
    for (std::size_t i = 1; i < parts_.size(); ++i)
      if (parts_[i].name == name) sources_.fail(here_, "a second part of the name " + name);
    parts_.push_back({.name = name});
    current_part_ = parts_.size() - 1;
    is_in_part_ = true;
    part_place_ = here_;
    system_ = {};
  }

  void begin_instance(const Keyword& keyword) {
    const std::string name = upper(keyword.get("NAME")), part = upper(keyword.get("PART"));
    if (part.empty())
      sources_.fail(here_, "expected PART=: instances from other sources (LIBRARY=) are not read");
    instances_.push_back({.name = name, .part = part, .place = here_, .frames = {}});
    begin_frame(Data::Instance);
    system_ = {};
  }

  void begin_frame(Data data) {
    data_ = data;
    frame_numbers_.clear();
  }

  void read_frame_line(std::string_view line) {
    FreeFields fields(line);
    std::string_view field;
    const std::size_t first = frame_numbers_.size();
    while (fields.next(field)) {
      double value = 0;
      if (!read_real(field, value)) fail_number("a coordinate", field);
      frame_numbers_.push_back(value);
    }
    // A system's points are given by threes; a comma at the end adds none.
    if (trimmed(field).empty() && frame_numbers_.size() > first) frame_numbers_.pop_back();
    while (data_ == Data::Instance && frame_numbers_.size() < 3) frame_numbers_.push_back(0);
  }

  /// *SYSTEM: the origin, a point of the x axis, and one of the plane of x and y.
  std::vector<NodeFrame> system_of(const std::vector<double>& numbers) const {
    if (numbers.empty()) return {};
    const auto point = [&](std::size_t i) {
      Eigen::Vector3d result = Eigen::Vector3d::Zero();
      for (std::size_t c = 0; c < 3 && 3 * i + c < numbers.size(); ++c)
        result(Eigen::Index(c)) = numbers[3 * i + c];
      return result;
    };
    NodeFrame frame;
    frame.origin = point(0).transpose();
    if (numbers.size() > 3) {
      const Eigen::Vector3d x = point(1) - point(0);
      const Eigen::Vector3d z = numbers.size() > 6 ? Eigen::Vector3d(x.cross(point(2) - point(0)))
                                                   : Eigen::Vector3d::UnitZ();
      if (x.norm() == 0 || x.cross(z).norm() == 0)
        sources_.fail(keyword_place_, "the points of the system lie on one line");
      frame.axes.col(0) = x.normalized();
      frame.axes.col(1) = z.cross(x).normalized();
      frame.axes.col(2) = frame.axes.col(0).cross(frame.axes.col(1));
    }
    return {frame};
  }

  /// *INSTANCE: a translation, then a rotation about the axis from a to b.
  std::vector<NodeFrame> instance_frames(const std::vector<double>& numbers) const {
    std::vector<NodeFrame> frames;
    if (numbers.size() != 0 && numbers.size() != 3 && numbers.size() != 10)
      sources_.fail(instances_.back().place,
                    "expected a line of 3 numbers (translation) and one of 7 (rotation), found " +
                        std::to_string(numbers.size()) + " numbers");
    if (numbers.size() >= 3) {
      NodeFrame moved;
      moved.origin = Eigen::RowVector3d::Map(numbers.data());
      if (!moved.is_basic()) frames.push_back(moved);
    }
    if (numbers.size() == 10) {
      const Eigen::Vector3d a = Eigen::Vector3d::Map(numbers.data() + 3);
      const Eigen::Vector3d axis = Eigen::Vector3d::Map(numbers.data() + 6) - a;
      if (axis.norm() == 0)
        sources_.fail(instances_.back().place, "the axis of the rotation has no length");
      NodeFrame turned;
      turned.axes =
          Eigen::AngleAxisd(numbers[9] * std::numbers::pi / 180, axis.normalized()).matrix();
      turned.origin = (a - turned.axes * a).transpose();
      if (!turned.is_basic()) frames.push_back(turned);
    }
    return frames;
  }

  void begin_nodes(const Keyword& keyword) {
    const std::string system = upper(keyword.get("SYSTEM"));
    if (!system.empty() && system != "R" && system != "C")
      sources_.fail(here_, "*NODE, SYSTEM=" + system +
                               ": only rectangular (R) and cylindrical (C) coordinates are read; "
                               "write the nodes in one of these");
    node_frames_ = system_;
    if (system == "C") {
      NodeFrame cylindrical;
      cylindrical.is_cylindrical = true;
      node_frames_.insert(node_frames_.begin(), cylindrical);
    }
    data_ = Data::Nodes;
    node_set_ =
        keyword.has("NSET") ? &part().nodes.get(keyword.get("NSET"), "node set", false) : nullptr;
  }

  NodeRecords& node_records() {
    std::vector<NodeRecords>& all = part().mesh.records;
    const bool goes_on =
        records_keyword_ == keyword_place_ && !all.empty() && all.back().file == here_.file;
    if (!goes_on) {
      all.push_back({.file = here_.file, .style = style_, .frames = node_frames_});
      records_keyword_ = keyword_place_;
    }
    return all.back();
  }

  void read_node(std::string_view line) { add_node(node_line(here_, line)); }

  NodeLine node_line(DeckPlace place, std::string_view line) const {
    NodeLine node{.place = place, .length = line.size(), .point = {}};
    const auto is_blank = [](char c) { return c == ' ' || c == '\t'; };
    std::size_t end = 0;
    while (end < line.size() && is_blank(line[end])) ++end;
    while (end < line.size() && line[end] != ',' && !is_blank(line[end])) ++end;
    if (!read_integer(line.substr(0, end), node.number) || node.number < 1 ||
        node.number > kHighestNumber)
      sources_.fail_expected(place, "the number of a node", line.substr(0, end));
    const std::string_view bad = style_->read(line, node.point);
    if (!bad.empty()) sources_.fail_expected(place, "a coordinate", bad);
    if (line.size() > 0xffff) sources_.fail(place, "the line is too long");
    if (line.size() > 2 * kFieldWidth || std::ranges::count(line, ',') > 3)
      check_fields(line, node);
    for (const NodeFrame& frame : node_frames_) node.point = frame.to_mesh(node.point);
    return node;
  }

  void add_node(const NodeLine& node) {
    NodeRecords& records = node_records();
    Part& in = part();
    records.places.push_back({.place = node.place.place, .length = node.length});
    records.nodes.push_back(std::ssize(in.mesh.node_numbers));
    in.mesh.add_node(node.number, node.point);
    if (node_set_) node_set_->numbers.push_back(node.number);
    long_numbers_ += node.long_numbers;
    has_normals_ = has_normals_ || node.has_normals;
  }

  /// Counts coordinates of which CalculiX reads the first 20 characters alone; looks for normals.
  static void check_fields(std::string_view line, NodeLine& node) {
    FreeFields fields(line);
    std::string_view field;
    for (int i = 0; i < 4 && fields.next(field); ++i)
      if (trimmed(field).size() > kFieldWidth) ++node.long_numbers;
    node.has_normals = fields.next(field) && !trimmed(field).empty();
  }

  void begin_elements(const Keyword& keyword) {
    const std::string type = upper(keyword.get("TYPE"));
    if (type.empty()) sources_.fail(here_, "expected TYPE= and the element type");
    kind_ = element_kind(type);
    if (kind_.use == ElementKind::Use::Unknown)
      sources_.fail(here_, "elements of type '" + type + "' are not known");
    data_ = Data::Elements;
    element_nodes_ = std::max(cell_node_count(kind_.type), 0);
    left_out_ = kind_.use == ElementKind::Use::LeftOut ? &left_out_types_[type] : nullptr;
    coupling_ = type.starts_with("DCOUP") ? upper(keyword.get("ELSET")) : std::string();
    is_behind_comma_ = false;
    element_set_ = keyword.has("ELSET")
                       ? &part().elements.get(keyword.get("ELSET"), "element set", true)
                       : nullptr;
    if (!element_set_ || left_out_) return;
    std::vector<std::string>& sets = part().element_sets;
    if (std::string set = upper(keyword.get("ELSET")); std::ranges::find(sets, set) == sets.end())
      sets.push_back(std::move(set));
  }

  void read_element(std::string_view line) {
    if (left_out_) {
      if (!is_behind_comma_) ++*left_out_;
      FreeFields fields(line);
      std::string_view field;
      Index node = 0;
      if (!coupling_.empty() && fields.next(field) && fields.next(field) &&
          read_integer(field, node))
        part().couplings.emplace(coupling_, std::pair(node, left_out_));
      is_behind_comma_ = trimmed(line).ends_with(',');
      return;
    }
    if (element_.empty()) element_place_ = here_;
    append_numbers(here_, line, element_);
    if (std::ssize(element_) <= element_nodes_) return;
    if (std::ssize(element_) > element_nodes_ + 1)
      sources_.fail(here_, "element " + std::to_string(element_[0]) + " has " +
                               std::to_string(element_.size() - 1) + " nodes, expected " +
                               std::to_string(element_nodes_));
    add_element(element_, element_place_, part().mesh);
    end_elements({&element_[0], 1});
    element_.clear();
  }

  /// Appends the numbers of a line: of an element, and of nodes.
  void append_numbers(DeckPlace place, std::string_view line, std::vector<Index>& numbers) const {
    const char* at = line.data();
    const char* const end = at + line.size();
    const auto is_between = [](char c) { return c == ' ' || c == ',' || c == '\t' || c == '\r'; };
    while (true) {
      while (at < end && is_between(*at)) ++at;
      if (at == end) break;
      Index number = 0;
      const auto [last, error] = std::from_chars(at, end, number);
      if (error != std::errc() || (last < end && !is_between(*last)) || number < 1 ||
          number > kHighestNumber)
        sources_.fail_expected(
            place, numbers.empty() ? "the number of an element" : "the number of a node",
            {at, end});
      numbers.push_back(number);
      at = last;
    }
  }

  void add_element(std::vector<Index>& element, DeckPlace place, NumberedMesh& mesh) const {
    if (kind_.type == CellType::QuadraticEdge) std::swap(element[2], element[3]);
    mesh.add_element(element[0], kind_.type, std::span(element).subspan(1), 0, place);
  }

  /// What goes with elements added to the part.
  void end_elements(std::span<const Index> numbers) {
    part().is_plane.resize(part().mesh.types.size(), kind_.is_plane);
    if (element_set_)
      element_set_->numbers.insert(element_set_->numbers.end(), numbers.begin(), numbers.end());
  }

  void begin_set(const Keyword& keyword) {
    const std::string name = keyword.get(keyword.name);
    if (name.empty()) sources_.fail(here_, "expected " + keyword.name + "= and the set's name");
    const bool is_of_elements = keyword.name == "ELSET";
    SetTable& table = is_of_elements ? part().elements : part().nodes;
    set_ = &table.get(name, is_of_elements ? "element set" : "node set", is_of_elements);
    instance_ = upper(keyword.get("INSTANCE"));
    is_generated_ = keyword.has("GENERATE");
    data_ = Data::Set;
    if (!is_of_elements && keyword.has("ELSET"))
      set_->members.push_back({.set = "\n" + upper(keyword.get("ELSET"))});
  }

  /// A number, or the name of a set, of an instance where that is named before a point.
  SetLines::Member member_of(std::string_view word) const {
    SetLines::Member member{.instance = instance_};
    const std::size_t point = word.find('.');
    if (read_integer(word, member.number)) return member;
    if (point != std::string_view::npos) {
      member.instance = upper(word.substr(0, point));
      word.remove_prefix(point + 1);
      if (read_integer(word, member.number)) return member;
    }
    member.set = upper(word);
    return member;
  }

  void read_set(std::string_view line) {
    FreeFields fields(line);
    std::string_view field;
    SetLines& set = *set_;
    if (is_generated_) return read_range(line);
    while (fields.next(field)) {
      const std::string_view word = unquoted(trimmed(field));
      Index number = 0;
      if (word.empty()) continue;
      if (instance_.empty() && read_integer(word, number))
        set.numbers.push_back(number);
      else
        set.members.push_back(member_of(word));
    }
  }

  void read_range(std::string_view line) {
    FreeFields fields(line);
    std::array<Index, 3> range{0, 0, 1};
    std::string_view field;
    for (Index& number : range)
      if (fields.next(field) && !trimmed(field).empty() && !read_integer(field, number))
        fail_number("first, last and step of a set", field);
    constexpr Index kMostSteps = 1 << 28;  // 2 GB of numbers: a slip asks for no more
    if (range[2] < 1 || range[1] < range[0] || (range[1] - range[0]) / range[2] > kMostSteps)
      sources_.fail(here_, "first, last and step of the set make no range");
    for (Index number = range[0]; number <= range[1]; number += range[2]) {
      if (instance_.empty())
        set_->numbers.push_back(number);
      else
        set_->members.push_back({.number = number, .instance = instance_});
    }
  }

  void begin_surface(const Keyword& keyword) {
    const std::string type = upper(keyword.get("TYPE"));
    if (!type.empty() && type != "ELEMENT" && type != "NODE") {
      located_.insert({"SURFACE, TYPE=" + type, 0});
      return;
    }
    SetTable& table = part().surfaces;
    set_ = &table.get(keyword.get("NAME"), "surface", type != "NODE");
    instance_.clear();
    data_ = Data::Surface;
  }

  void read_surface(std::string_view line) {
    FreeFields fields(line);
    std::string_view field;
    if (!fields.next(field) || trimmed(field).empty()) return;
    SetLines::Member member = member_of(unquoted(trimmed(field)));
    if (fields.next(field)) {
      const std::string label = upper(trimmed(field));
      if (label.size() > 1 && (label[0] == 'S' || label[0] == 'E')) {
        std::from_chars(label.data() + 1, label.data() + label.size(), member.face);
        member.is_edge = label[0] == 'E';
      }
    }
    set_->members.push_back(std::move(member));
  }

  void begin_tie(const Keyword& keyword) {
    instance_.clear();
    TieLines tie;
    const bool is_old_coupling = keyword.name == "DISTRIBUTINGCOUPLING";
    for (const auto& [name, value] : keyword.parameters) {
      SetLines::Member member = member_of(value);
      std::string key = name;
      std::erase(key, ' ');
      if (key == "REFNODE")
        tie.nodes = std::move(member);
      else if (key == "SURFACE")
        tie.surface = std::move(member);
      else if (key == "NSET" || key == "TIENSET" || key == "PINNSET" || key == "ROTNODE")
        tie.others.members.push_back(std::move(member));
      else if (key == "ELSET" && is_old_coupling)
        tie.nodes.number = take_coupling(upper(value));
      else if (key == "ELSET")
        tie.others.members.push_back({.set = "\n" + member.set, .instance = member.instance});
    }
    part().ties.push_back(std::move(tie));
    // What is in a file of its own is not read.
    const bool has_lines = is_old_coupling || keyword.name == "KINEMATICCOUPLING";
    if (has_lines && !keyword.has("INPUT")) data_ = Data::Coupling;
  }

  /// The node of the element of a set, which is no longer left out; 0 where there is none.
  Index take_coupling(const std::string& set) {
    const auto found = part().couplings.find(set);
    if (found == part().couplings.end()) return 0;
    const auto [node, count] = found->second;
    part().couplings.erase(found);
    --*count;
    return node;
  }

  /// A node or a set, and its degrees of freedom.
  void read_coupling(std::string_view line) {
    FreeFields fields(line);
    std::string_view field;
    if (fields.next(field))
      part().ties.back().others.members.push_back(member_of(unquoted(trimmed(field))));
  }

  void begin_pairs(const Keyword& keyword) {
    instance_.clear();
    if (!keyword.has("INPUT")) data_ = Data::Pairs;
  }

  /// The type of a constraint, the node or set that depends, and that on which it does.
  void read_pair(std::string_view line) {
    FreeFields fields(line);
    std::string_view type, nodes, others;
    if (!fields.next(type) || !fields.next(nodes) || !fields.next(others)) return;
    const std::string name = upper(trimmed(type));
    if (name != "BEAM" && name != "LINK" && name != "TIE") return;
    TieLines tie{.nodes = member_of(unquoted(trimmed(nodes)))};
    tie.others.members.push_back(member_of(unquoted(trimmed(others))));
    part().ties.push_back(std::move(tie));
  }

  [[noreturn]] void fail_number(std::string_view what, std::string_view found) const {
    sources_.fail_expected(here_, what, found);
  }

  void assemble() {
    if (!parts_[0].mesh.node_numbers.empty() || instances_.empty()) place(parts_[0], {});
    for (const Instance& instance : instances_) {
      const auto is_it = [&](const Part& part) { return part.name == instance.part; };
      const auto found = std::find_if(parts_.begin() + 1, parts_.end(), is_it);
      if (found == parts_.end()) sources_.fail(instance.place, "there is no part " + instance.part);
      ++found->instances;
    }
    for (const Instance& instance : instances_)
      for (Part& part : parts_)
        if (part.name == instance.part) place(part, instance);
    assembly_.order_mid_nodes(CellType::TriquadraticHexahedron);
    // The deck of a mesh generator: its volumes are the sets of its elements.
    if (!has_sections_)
      for (Part& part : parts_)
        for (const std::string& set : part.element_sets) part.sections.emplace_back(set, set);
    std::map<std::string, int> regions;
    for (const Placed& placed : placed_) assign_regions(placed, regions);
    const auto add_named = [&](const Placed& placed) {
      add_groups(*placed.part, placed);
      add_ties(placed);
    };
    std::ranges::for_each(placed_, add_named);
    const bool is_own_placed = !placed_.empty() && placed_[0].part == &parts_[0];
    if (!is_own_placed) add_named({.instance = {}, .part = &parts_[0]});
  }

  void place(Part& part, const Instance& instance) {
    for (NodeRecords& records : part.mesh.records) {
      records.is_shared = part.instances > 1;
      records.owner = "instance " + instance.name;
    }
    Placed placed{.instance = instance.name,
                  .part = &part,
                  .elements = NumberTable(part.mesh.element_numbers)};
    const bool is_last = ++part.placed >= part.instances;
    placed.nodes = is_last ? assembly_.add(std::move(part.mesh), instance.frames)
                           : assembly_.add(part.mesh, instance.frames);
    placed_.push_back(std::move(placed));
  }

  /// The first section that names a cell's set tells its material, and so its region.
  void assign_regions(const Placed& placed, std::map<std::string, int>& regions) {
    Mesh& mesh = assembly_.mesh();
    for (const auto& [set, material] : placed.part->sections) {
      std::vector<Index> cells;
      collect(placed, {.set = set}, true, 0, cells);
      const int region = regions.emplace(material, int(regions.size()) + 1).first->second;
      for (const Index cell : cells)
        if (mesh.regions[std::size_t(cell)] == 0) mesh.regions[std::size_t(cell)] = region;
    }
  }

  void add_groups(const Part& part, const Placed& home) {
    GroupNodes nodes(assembly_.node_count());
    for (const SetTable* table : {&part.nodes, &part.elements, &part.surfaces})
      for (const SetLines& set : table->sets) {
        add_nodes(home, set, nodes);
        NodeGroup group{.name = home.instance.empty() ? set.name : home.instance + "." + set.name,
                        .kind = set.kind,
                        .nodes = nodes.take()};
        if (!group.nodes.empty()) assembly_.mesh().groups.push_back(std::move(group));
      }
  }

  /// Sets of as many nodes are tied one by one.
  void add_ties(const Placed& home) {
    if (home.part->ties.empty()) return;
    GroupNodes gathered(assembly_.node_count());
    for (const TieLines& lines : home.part->ties) {
      std::vector<Index> nodes;
      collect(home, lines.nodes, false, 0, nodes);
      add_nodes(home, lines.others, gathered);
      const bool has_surface = !lines.surface.set.empty();
      const Placed* in = has_surface ? find_placed(home, lines.surface.instance) : nullptr;
      const SetLines* surface = in ? in->part->surfaces.find(lines.surface.set) : nullptr;
      if (surface) add_nodes(*in, *surface, gathered);
      const std::vector<Index> others = gathered.take();
      const bool are_pairs = nodes.size() > 1 && nodes.size() == others.size();
      if (others.empty() || (nodes.size() > 1 && others.size() > 1 && !are_pairs)) continue;
      for (std::size_t i = 0; i < nodes.size(); ++i)
        assembly_.mesh().ties.push_back(
            {nodes[i], are_pairs ? std::vector<Index>{others[i]} : others});
    }
  }

  void add_nodes(const Placed& home, const SetLines& set, GroupNodes& nodes) const {
    std::vector<Index> found;
    const auto add_found = [&](bool is_of_elements, const SetLines::Member& member) {
      if (is_of_elements)
        for (const Index cell : found) add_face(cell, member, nodes);
      else
        nodes.add(found);
      found.clear();
    };
    collect_numbers(home, set.numbers, set.is_of_elements, found);
    add_found(set.is_of_elements, {});
    for (const SetLines::Member& member : set.members) {
      SetLines::Member plain = member;
      const bool is_by_elements = plain.set.starts_with('\n');  // the nodes of a set of elements
      if (is_by_elements) plain.set.erase(0, 1);
      collect(home, plain, set.is_of_elements || is_by_elements, 0, found);
      add_found(set.is_of_elements || is_by_elements, member);
    }
  }

  void add_face(Index cell, const SetLines::Member& member, GroupNodes& nodes) const {
    const Mesh& mesh = assembly_.mesh();
    const auto cell_nodes = mesh.cell(cell);
    if (member.face == 0) return nodes.add(cell_nodes);
    const bool is_edge = member.is_edge || is_plane(cell);
    for (const int node : face_nodes(mesh.types[std::size_t(cell)], is_edge, member.face))
      nodes.add(cell_nodes[std::size_t(node)]);
  }

  bool is_plane(Index cell) const {
    for (const Placed& placed : placed_) {
      const Index row = cell - placed.nodes.first_cell;
      if (row >= 0 && row < std::ssize(placed.part->is_plane))
        return placed.part->is_plane[std::size_t(row)];
    }
    return false;
  }

  /// Appends the nodes, or cells, of numbers; those of nothing are left out, as the solvers do.
  static void collect_numbers(const Placed& in, std::span<const Index> numbers, bool is_of_elements,
                              std::vector<Index>& found) {
    for (const Index number : numbers) {
      const Index row = is_of_elements ? in.elements.find(number) : in.nodes.rows.find(number);
      if (row < 0) continue;
      found.push_back(is_of_elements ? in.nodes.first_cell + row
                                     : in.nodes.nodes[std::size_t(row)]);
    }
  }

  /// The instance of a name, null where there is no such; of an empty one `home`.
  const Placed* find_placed(const Placed& home, const std::string& instance) const {
    if (instance.empty()) return &home;
    const auto placed = std::ranges::find(placed_, instance, &Placed::instance);
    return placed == placed_.end() ? nullptr : &*placed;
  }

  /// Appends the nodes, or cells, of a member; a name of nothing is left out too.
  void collect(const Placed& home, const SetLines::Member& member, bool is_of_elements, int depth,
               std::vector<Index>& found) const {
    constexpr int kDeepest = 32;  // so that sets which name each other come to an end
    if (depth > kDeepest) return;
    const Placed* in = find_placed(home, member.instance);
    if (!in) return;
    if (member.set.empty()) return collect_numbers(*in, {&member.number, 1}, is_of_elements, found);
    const SetLines* set = (is_of_elements ? in->part->elements : in->part->nodes).find(member.set);
    if (!set) return;
    collect_numbers(*in, set->numbers, is_of_elements, found);
    for (const SetLines::Member& inner : set->members)
      collect(*in, inner, is_of_elements, depth + 1, found);
  }

  void add_remarks(ReadMesh& result) const {
    remark_on_left_out(left_out_types_, result.remarks);
    for (const auto& [name, count] : located_)
      result.remarks.push_back("positions under *" + name + " are those of the base");
    if (has_normals_)
      result.remarks.push_back("the normals of nodes under *NODE are those of the base");
    if (long_numbers_ > 0)
      result.remarks.push_back(
          std::to_string(long_numbers_) +
          " coordinates have more than 20 characters, of which CalculiX reads the first 20 alone, "
          "without the exponent of some; those that move are written within 20");
  }

  DeckSources sources_;
  MeshAssembly assembly_{sources_};
  std::vector<Part> parts_ = std::vector<Part>(1);
  std::vector<Instance> instances_;
  std::vector<Placed> placed_;
  std::shared_ptr<const NodeStyle> style_ = std::make_shared<FreeNodeLine>();

  // What is being read.
  DeckPlace here_, keyword_place_, part_place_, element_place_;
  Data data_ = Data::Skip;
  bool is_in_part_ = false, has_sections_ = false;
  std::size_t current_part_ = 0;
  std::vector<NodeFrame> system_, node_frames_;
  std::vector<double> frame_numbers_;
  std::optional<DeckPlace> records_keyword_;
  SetLines *node_set_ = nullptr, *element_set_ = nullptr;
  ElementKind kind_;
  Index element_nodes_ = 0;
  std::vector<Index> element_;  ///< its number and nodes so far
  Index* left_out_ = nullptr;
  std::string coupling_;  ///< set of its element
  bool is_behind_comma_ = false;
  SetLines* set_ = nullptr;
  std::string instance_;
  bool is_generated_ = false;

  // For the remarks.
  std::map<std::string, Index> left_out_types_, located_;
  Index long_numbers_ = 0;
  bool has_normals_ = false;
};

/// The lines that begin with '*' tell: those of LS-DYNA begin so too, but their names are others.
Recognition recognise(const FileStart& start) {
  const std::string_view text = start.bytes;
  bool has_keyword = false;
  for (std::size_t at = 0; at < text.size();) {
    const std::string_view line = take_line(text, at);
    if (line.starts_with("**") || trimmed(line).empty()) continue;
    if (!has_keyword && !line.starts_with('*')) return Recognition::No;
    if (!line.starts_with('*')) continue;
    has_keyword = true;
    const Keyword keyword = parse_keyword(line);
    const std::string& name = keyword.name;
    if (name == "KEYWORD" || name.find('_') != std::string::npos) return Recognition::No;
    if (name == "HEADING" || name == "PART" || name == "SOLIDSECTION" ||
        ((name == "NODE" || name == "NSET") && keyword.has("NSET")) ||
        ((name == "ELEMENT" && keyword.has("TYPE")) || (name == "ELSET" && keyword.has("ELSET"))) ||
        (name == "INCLUDE" && keyword.has("INPUT")))
      return name == "PART" && keyword.parameters.empty() ? Recognition::No : Recognition::Sure;
  }
  return has_keyword ? Recognition::Possible : Recognition::No;
}

ReadMesh read(const fs::path& path) { return Reader(path).run(); }

}  // namespace

const MeshFormat& abaqus_format() {
  static const MeshFormat format{
      .name = "Abaqus", .extensions = {".inp"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
