#include <algorithm>
#include <cctype>
#include <map>
#include <string>
#include <utility>

#include "core/cell_topology.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/formats.h"
#include "core/formats/number_input.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

constexpr Index kMostNodes = Index{1} << 40;  // keeps sums from overflowing
constexpr Index kDimension = 3, kVertices = 4, kEnd = 54;

struct Keyword {
  std::string_view name;
  Index code;  ///< in binary files
};

struct ElementKeyword : Keyword {
  CellType type;
};

/// Node orders are VTK's.
constexpr ElementKeyword kElements[] = {
    {{"Edges", 5}, Line},
    {{"Triangles", 6}, Triangle},
    {{"Quadrilaterals", 7}, Quad},
    {{"Tetrahedra", 8}, Tetra},
    {{"Prisms", 9}, Wedge},
    {{"Pentahedra", 9}, Wedge},  // an old name
    {{"Hexahedra", 10}, Hexahedron},
    {{"TrianglesP2", 24}, QuadraticTriangle},
    {{"EdgesP2", 25}, QuadraticEdge},
    {{"QuadrilateralsQ2", 27}, BiquadraticQuad},
    {{"TetrahedraP2", 30}, QuadraticTetra},
    {{"Pyramids", 49}, Pyramid},
};

/// Elements and node orders that are not read: a mesh without them would not be whole.
constexpr Keyword kUnread[] = {
    {"HexahedraQ2", 33},
    {"Polyhedra", 46},
    {"PrismsP2", 86},
    {"PyramidsP2", 87},
    {"QuadrilateralsQ3", 88},
    {"QuadrilateralsQ4", 89},
    {"TrianglesP3", 90},
    {"TrianglesP4", 91},
    {"TetrahedraP3", 96},
    {"TetrahedraP4", 97},
    {"HexahedraQ3", 98},
    {"HexahedraQ4", 99},
    {"PyramidsP3", 100},
    {"PyramidsP4", 101},
    {"PrismsP3", 102},
    {"PrismsP4", 103},
    {"BezierBasis", 125},
    {"EdgesP2Ordering", 127},
    {"TrianglesP2Ordering", 129},
    {"QuadrilateralsQ2Ordering", 131},
    {"TetrahedraP2Ordering", 133},
};

/// What depends on coordinates and can't follow them.
constexpr Keyword kOfBase[] = {
    {"VerticesOnGeometricEdges", 41},
    {"VerticesOnGeometricTriangles", 42},
    {"VerticesOnGeometricQuadrilaterals", 43},
    {"BoundingBox", 50},
    {"Tangents", 59},
    {"Normals", 60},
    {"ByteFlow", 126},
};

/// What says nothing of elements.
constexpr std::string_view kLeftAlone[] = {"AngleOfCornerBound",
                                           "Corners",
                                           "Geometry",
                                           "Identifier",
                                           "NormalAtVertices",
                                           "RequiredEdges",
                                           "RequiredTriangles",
                                           "RequiredVertices",
                                           "Ridges",
                                           "SubDomainFromGeom",
                                           "SubDomainFromMesh",
                                           "TangentAtVertices",
                                           "TangentAtEdgeVertices",
                                           "NormalAtTriangleVertices",
                                           "RequiredQuadrilaterals",
                                           "NormalAtQuadrilateralVertices"};

/// The keyword of a text, by name, or of a binary file, by code.
template <class Word, std::size_t N>
const Word* find_keyword(const Word (&keywords)[N], std::string_view name, Index code) {
  const auto found = std::ranges::find_if(keywords, [&](const Word& keyword) {
    return name.empty() ? keyword.code == code : keyword.name == name;
  });
  return found == std::end(keywords) ? nullptr : &*found;
}

/// The elements of one keyword.
struct Block {
  CellType type;
  std::vector<Index> nodes;
  std::vector<Index> references;  ///< one an element
};

bool is_binary(std::string_view bytes) {
  using namespace std::string_view_literals;
  return bytes.starts_with("\1\0\0\0"sv) || bytes.starts_with("\0\0\0\1"sv);
}

class Reader {
 public:
  Reader(std::string_view bytes, const fs::path& path)
      : bytes_(bytes), path_(path), in_(bytes, path, '#') {}

  ReadMesh run(SourceFile source) {
    if (is_binary(bytes_))
      read_binary();
    else
      read_text();
    if (!has_vertices_) in_.fail("there are no vertices (Vertices)");
    check_nodes();
    build();
    CoordinatePlaces places;
    if (in_.is_binary())
      places = std::move(binary_places_);
    else
      places = std::move(text_places_);
    result_.copier = make_copier(std::move(source), std::move(places));
    return std::move(result_);
  }

 private:
  void read_text() {
    TextScanner& text = in_.text();
    text.word("MeshVersionFormatted");
    version_ = int(text.index("the version of the format", 1, 5));
    bool is_skipping = false;  // numbers of a keyword that is not read
    while (text.skip_space()) {
      const std::size_t place = text.place();
      const std::string_view word = text.word("a keyword");
      if (word == "End") return;
      if (word.starts_with('"'))
        skip_quotes(place);
      else if (std::isalpha(static_cast<unsigned char>(word.front())))
        is_skipping = !read_keyword(word, 0, place);
      else if (!is_skipping)
        text.fail_at(place,
                     "there is a number in place of a keyword: what stands before has more "
                     "numbers than its keyword and count say");
    }
  }

  void skip_quotes(std::size_t begin) {
    const std::size_t end = bytes_.find('"', begin + 1);
    if (end == std::string_view::npos) in_.text().fail_at(begin, "quotes without an end");
    in_.text().go_to(end + 1);
  }

  void read_binary() {
    in_.set_binary();
    ByteScanner& bytes = in_.bytes();
    bytes.set_big_endian(bytes_.front() == 0);
    bytes.int32("the number one");
    version_ = int(bytes.index("the version of the format", 4, 1, 5));
    const int position_size = version_ < 3 ? 4 : 8;
    while (true) {
      const std::size_t place = bytes.place();
      const Index code = bytes.int32("the code of a keyword");
      const Index next = bytes.integer("the place of the next keyword", position_size);
      if (code == kEnd) return;
      if (next <= Index(place) || next > std::ssize(bytes_))
        bytes.fail_at(place, "the place of the keyword after that of code " + std::to_string(code) +
                                 " is " + std::to_string(next) + ", not in (" +
                                 std::to_string(place) + ", " + std::to_string(bytes_.size()) +
                                 "]: the file is cut off or damaged");
      read_keyword({}, code, place);
      if (bytes.place() > std::size_t(next))
        bytes.fail_at(place, "the items of the keyword of code " + std::to_string(code) +
                                 " reach into the next");
      bytes.go_to(std::size_t(next));
    }
  }

  int int_size() const { return version_ < 4 ? 4 : 8; }
  int real_size() const { return version_ < 2 ? 4 : 8; }

  /// Reads the items of a keyword, in text by name, in binary by code; false, and nothing is read,
  /// where it is not needed.
  bool read_keyword(std::string_view name, Index code, std::size_t place) {
    if (name == "Dimension" || code == kDimension) {
      dimension_ = int(in_.index("the dimension", 4, 2, 4));
    } else if (name == "Vertices" || code == kVertices) {
      read_vertices(place);
    } else if (const auto* element = find_keyword(kElements, name, code)) {
      read_elements(element->type);
    } else if (const auto* unread = find_keyword(kUnread, name, code)) {
      in_.fail_at(place, std::string(unread->name) +
                             " are not read; write the mesh with elements of first order, or with "
                             "TrianglesP2 and TetrahedraP2 in their usual order");
    } else {
      if (const auto* of_base = find_keyword(kOfBase, name, code))
        of_base_ += (of_base_.empty() ? "" : ", ") + std::string(of_base->name);
      else if (!name.empty() && std::ranges::find(kLeftAlone, name) == std::end(kLeftAlone))
        result_.remarks.push_back("what the file has under '" + std::string(name.substr(0, 40)) +
                                  "' is not known and copied as it is");
      return false;
    }
    return true;
  }

  void read_vertices(std::size_t place) {
    if (dimension_ == 0) in_.fail_at(place, "there are vertices before the dimension");
    if (has_vertices_) in_.fail_at(place, "there are vertices a second time");
    has_vertices_ = true;
    const auto stride = std::size_t(dimension_ * real_size() + int_size());
    const Index count = in_.count("the number of vertices", int_size(), stride, 6);
    Points& points = result_.mesh.points;
    points.setZero(count, 3);
    if (in_.is_binary()) {
      for (int c = 0; c < dimension_; ++c)
        binary_places_.runs.push_back(
            {.place = in_.place() + std::size_t(c * real_size()),
             .stride = stride,
             .count = count,
             .component = c,
             .type = real_size() == 4 ? BinaryRun::Type::Float32 : BinaryRun::Type::Float64,
             .is_big_endian = in_.bytes().is_big_endian()});
      read_runs(bytes_, binary_places_, path_, points);
      return in_.bytes().skip("vertices", stride * std::uint64_t(count));
    }
    text_places_.components = dimension_;
    text_places_.tokens.reserve(std::size_t(dimension_ * count));
    for (Index node = 0; node < count; ++node) {
      for (int c = 0; c < dimension_; ++c)
        text_places_.tokens.push_back(in_.text().number("a coordinate", points(node, c)));
      in_.text().integer("the reference of a vertex");
    }
  }

  void read_elements(CellType type) {
    const auto width = std::size_t(cell_node_count(type));
    const Index count = in_.count("the number of elements", int_size(),
                                  (width + 1) * std::size_t(int_size()), 2 * (width + 1));
    Block& block = blocks_.emplace_back(Block{.type = type, .nodes = {}, .references = {}});
    block.nodes.resize(width * std::size_t(count));
    block.references.resize(std::size_t(count));
    auto node = block.nodes.begin();
    for (Index& reference : block.references) {
      const std::size_t place = in_.position();
      for (std::size_t i = 0; i < width; ++i) {
        *node = in_.index("vertex", int_size(), 1, kMostNodes) - 1;
        if (*node > highest_node_) {
          highest_node_ = *node;
          highest_place_ = place;
        }
        ++node;
      }
      reference = in_.integer("the reference of an element", int_size());
    }
  }

  /// Elements may stand before the vertices.
  void check_nodes() {
    const Index count = result_.mesh.node_count();
    if (highest_node_ >= count)
      in_.fail_behind(highest_place_, "an element has the vertex " +
                                          std::to_string(highest_node_ + 1) +
                                          ", but there are only " + std::to_string(count));
  }

  /// Cells are the elements of the highest dimension; the references of faces, and of edges where
  /// there are no solids, name groups.
  void build() {
    Mesh& mesh = result_.mesh;
    int highest = 0;
    for (const Block& block : blocks_)
      if (!block.references.empty()) highest = std::max(highest, dimension(block.type));
    for (Block& block : blocks_) {
      const bool is_face = dimension(block.type) == 2 && dimension_ == 3;
      const bool is_edge = dimension(block.type) == 1 && highest == 2;
      if (is_face || is_edge) add_groups(block, is_face ? "reference " : "edge reference ");
      if (dimension(block.type) == highest) add_cells(std::move(block));
    }
    mesh.region_array = "reference";
    tidy_groups(mesh);
    if (!of_base_.empty()) result_.remarks.push_back(of_base_ + " in the file are of the base");
  }

  void add_cells(Block block) {
    Mesh& mesh = result_.mesh;
    cadmorph::add_cells(mesh, block.type, std::move(block.nodes));
    for (const Index reference : block.references) mesh.regions.push_back(int(reference));
  }

  void add_groups(const Block& block, const std::string& prefix) {
    std::vector<NodeGroup>& groups = result_.mesh.groups;
    const auto width = std::ptrdiff_t(cell_node_count(block.type));
    auto node = block.nodes.begin();
    const int kind = dimension(block.type);
    for (const Index reference : block.references) {
      const auto [entry, is_new] = group_of_.try_emplace({kind, reference}, groups.size());
      if (is_new)
        groups.push_back(
            {.name = prefix + std::to_string(reference), .kind = "reference", .nodes = {}});
      std::vector<Index>& nodes = groups[entry->second].nodes;
      nodes.insert(nodes.end(), node, node + width);
      node += width;
    }
  }

  std::string_view bytes_;
  const fs::path& path_;
  NumberInput in_;
  ReadMesh result_;
  int version_ = 1, dimension_ = 0;
  bool has_vertices_ = false;
  TextPlaces text_places_;
  BinaryPlaces binary_places_;
  std::vector<Block> blocks_;
  Index highest_node_ = -1;
  std::size_t highest_place_ = 0;
  std::map<std::pair<int, Index>, std::size_t> group_of_;  ///< by dimension and reference
  std::string of_base_;
};

Recognition recognise(const FileStart& start) {
  if (is_binary(start.bytes)) {
    ByteScanner bytes(start.bytes, start.path);
    bytes.set_big_endian(start.bytes.front() == 0);
    if (bytes.rest() < 12) return Recognition::No;
    bytes.int32("one");
    const Index version = bytes.int32("the version");
    const bool is_medit =
        version >= 1 && version <= 4 && bytes.int32("the first keyword") == kDimension;
    return is_medit ? Recognition::Sure : Recognition::No;
  }
  TextScanner text(start.bytes, start.path, '#');
  const bool is_medit =
      text.skip_space() && text.word("the first word").starts_with("MeshVersionFormatted");
  return is_medit ? Recognition::Sure : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  SourceBytes file = read_source(path);
  return Reader(file.bytes, path).run(std::move(file.source));
}

}  // namespace

const MeshFormat& medit_format() {
  static const MeshFormat format{
      .name = "Medit", .extensions = {".mesh", ".meshb"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
