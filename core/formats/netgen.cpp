#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "core/formats/coordinate_places.h"
#include "core/formats/formats.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

constexpr Index kMostNodes = Index{1} << 40;   // keeps sums from overflowing
constexpr std::size_t kMostElementNodes = 20;  // of quadratic hexahedra

/// An element by its number of nodes.
struct ElementKind {
  Index nodes;
  CellType type;
  std::array<std::uint8_t, kMostElementNodes> order;  ///< place in the file of VTK's nodes
};

constexpr ElementKind kFaces[] = {
    {3, Triangle, {0, 1, 2}},
    {4, Quad, {0, 1, 2, 3}},
    {6, QuadraticTriangle, {0, 1, 2, 5, 3, 4}},
    {8, QuadraticQuad, {0, 1, 2, 3, 4, 7, 5, 6}},
};

/// Netgen's solids are the mirror images of VTK's.
constexpr ElementKind kSolids[] = {
    {4, Tetra, {0, 2, 1, 3}},
    {5, Pyramid, {0, 3, 2, 1, 4}},
    {6, Wedge, {0, 2, 1, 3, 5, 4}},
    {8, Hexahedron, {0, 3, 2, 1, 4, 7, 6, 5}},
    {10, QuadraticTetra, {0, 2, 1, 3, 5, 7, 4, 6, 9, 8}},
    {12, QuadraticLinearWedge, {0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10}},
    {13, QuadraticPyramid, {0, 3, 2, 1, 4, 7, 6, 8, 5, 9, 12, 11, 10}},
    {15, QuadraticWedge, {0, 2, 1, 3, 5, 4, 7, 8, 6, 13, 14, 12, 9, 11, 10}},
    {20, QuadraticHexahedron, {0,  3, 2,  1,  4,  7,  6,  5,  10, 9,
                               11, 8, 14, 13, 15, 12, 16, 19, 18, 17}},
};

class Reader {
 public:
  Reader(std::string_view text, const fs::path& path) : in_(text, path, '#') {}

  ReadMesh run(SourceFile source) {
    in_.word("mesh3d");
    while (in_.skip_space() && read_line()) {
    }
    if (!has_points_) in_.fail("there are no points");
    check_nodes();
    build();
    result_.copier = make_copier(std::move(source), std::move(places_));
    return std::move(result_);
  }

 private:
  struct Element {
    const ElementKind* kind;
    std::array<Index, kMostElementNodes> nodes;
  };

  /// Reads a section, or skips a line of one that is not read; false at the end of the mesh.
  bool read_line() {
    const std::size_t place = in_.place();
    if (!std::isalpha(static_cast<unsigned char>(in_.text()[place]))) {
      in_.skip_line();
      return true;
    }
    const std::string_view name = in_.word("a section");
    if (name == "dimension")
      dimension_ = int(in_.index("the dimension", 2, 4));
    else if (name.starts_with("surfaceelements"))
      read_faces();
    else if (name == "volumeelements")
      read_solids();
    else if (name == "edgesegmentsgi2" && dimension_ == 2)
      read_edges();
    else if (name == "points")
      read_points(place);
    else if (name == "bcnames")
      read_names();
    else if (name == "endmesh")
      return end();
    else
      in_.skip_line();
    return true;
  }

  bool end() {
    if (in_.skip_space())
      result_.remarks.push_back("the geometry after the mesh in the file is that of the base");
    return false;
  }

  void read_nodes(std::span<Index> nodes, std::size_t place) {
    for (Index& node : nodes) {
      node = in_.index("point", 1, kMostNodes) - 1;
      if (node > highest_node_) {
        highest_node_ = node;
        highest_place_ = place;
      }
    }
  }

  template <std::size_t N>
  Element read_element(const ElementKind (&kinds)[N], const std::string& what) {
    in_.skip_space();
    const std::size_t place = in_.place();
    const Index count = in_.integer("the number of points of an element");
    const auto kind = std::ranges::find(kinds, count, &ElementKind::nodes);
    if (kind == std::end(kinds))
      in_.fail_at(place,
                  what + " of " + std::to_string(count) + " points is of no kind that is read");
    Element element{.kind = kind, .nodes = {}};
    read_nodes(std::span(element.nodes).first(std::size_t(count)), place);
    in_.skip_line();
    return element;
  }

  void read_faces() {
    const Index count = in_.count("the number of surface elements", 12);
    faces_.reserve(std::size_t(count));
    face_conditions_.reserve(std::size_t(count));
    for (Index i = 0; i < count; ++i) {
      in_.integer("the surface of an element");
      face_conditions_.push_back(in_.integer("the boundary condition of an element"));
      in_.integer("the domain inside");
      in_.integer("the domain outside");
      faces_.push_back(read_element(kFaces, "a surface element"));
    }
  }

  void read_solids() {
    const Index count = in_.count("the number of volume elements", 10);
    for (Index i = 0; i < count; ++i) {
      const Index material = in_.integer("the material of an element");
      add(read_element(kSolids, "a volume element"), material);
    }
  }

  /// The boundary of a plane mesh.
  void read_edges() {
    const Index count = in_.count("the number of edge segments", 6);
    for (Index i = 0; i < count; ++i) {
      const Index condition = in_.integer("the boundary condition of an edge");
      in_.integer("the number of an edge");
      in_.skip_space();
      std::array<Index, 2> nodes;
      read_nodes(nodes, in_.place());
      in_.skip_line();
      add_to_group(condition, nodes);
    }
  }

  void read_points(std::size_t place) {
    if (has_points_) in_.fail_at(place, "there are points a second time");
    has_points_ = true;
    const Index count = in_.count("the number of points", 6);
    result_.mesh.points.resize(count, 3);
    places_.tokens.reserve(3 * std::size_t(count));
    for (Index node = 0; node < count; ++node) {
      for (int c = 0; c < 3; ++c)
        places_.tokens.push_back(in_.number("a coordinate", result_.mesh.points(node, c)));
      in_.skip_line();
    }
  }

  void read_names() {
    const Index count = in_.count("the number of names", 2);
    in_.skip_line();
    for (Index i = 0; i < count; ++i) {
      const Index number = in_.integer("the number of a boundary condition");
      std::string_view name = in_.skip_blanks() ? in_.line() : std::string_view{};
      while (name.ends_with(' ') || name.ends_with('\t')) name.remove_suffix(1);
      if (!name.empty() && name != "default") names_[number] = name;
    }
  }

  void add(const Element& element, Index region) {
    std::array<Index, kMostElementNodes> nodes;
    const auto count = std::size_t(element.kind->nodes);
    for (std::size_t i = 0; i < count; ++i) nodes[i] = element.nodes[element.kind->order[i]];
    add_cell(result_.mesh, element.kind->type, std::span(nodes).first(count));
    result_.mesh.regions.push_back(int(region));
  }

  void add_to_group(Index condition, std::span<const Index> nodes) {
    std::vector<Index>& group = group_nodes_[condition];
    group.insert(group.end(), nodes.begin(), nodes.end());
  }

  /// Elements stand before the points.
  void check_nodes() const {
    const Index count = result_.mesh.node_count();
    if (highest_node_ >= count)
      in_.fail_at(highest_place_, "point " + std::to_string(highest_node_ + 1) +
                                      " is used, but there are only " + std::to_string(count));
  }

  /// Surface elements are groups, by the names of their boundary conditions; where there are no
  /// volume elements, cells too.
  void build() {
    Mesh& mesh = result_.mesh;
    mesh.region_array = "material";
    const bool are_cells = mesh.types.empty();
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      if (are_cells) add(faces_[i], face_conditions_[i]);
      if (dimension_ == 3)
        add_to_group(face_conditions_[i],
                     std::span(faces_[i].nodes).first(std::size_t(faces_[i].kind->nodes)));
    }
    std::map<std::string, std::size_t> group_of;
    for (const auto& [condition, nodes] : group_nodes_) {
      const auto named = names_.find(condition);
      const std::string name =
          named != names_.end() ? named->second : "boundary " + std::to_string(condition);
      const auto [entry, is_new] = group_of.try_emplace(name, mesh.groups.size());
      if (is_new) mesh.groups.push_back({.name = name, .kind = "boundary condition", .nodes = {}});
      std::vector<Index>& group = mesh.groups[entry->second].nodes;
      group.insert(group.end(), nodes.begin(), nodes.end());
    }
    tidy_groups(mesh);
  }

  TextScanner in_;
  ReadMesh result_;
  TextPlaces places_;
  int dimension_ = 3;
  bool has_points_ = false;
  std::vector<Element> faces_;
  std::vector<Index> face_conditions_;
  std::map<Index, std::vector<Index>> group_nodes_;
  std::map<Index, std::string> names_;  ///< of boundary conditions
  Index highest_node_ = -1;
  std::size_t highest_place_ = 0;
};

Recognition recognise(const FileStart& start) {
  TextScanner in(start.bytes, start.path, '#');
  if (!in.skip_space() || in.word("mesh3d") != "mesh3d") return Recognition::No;
  return in.skip_space() && in.word("dimension") == "dimension" ? Recognition::Sure
                                                                : Recognition::Possible;
}

ReadMesh read(const fs::path& path) {
  SourceBytes file = read_source(path);
  return Reader(file.bytes, path).run(std::move(file.source));
}

}  // namespace

const MeshFormat& netgen_format() {
  static const MeshFormat format{
      .name = "Netgen", .extensions = {".vol"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
