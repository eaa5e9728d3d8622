#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>

#include "core/cell_topology.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/formats.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

constexpr Index kMostVertices = Index{1} << 32;  // two fit into one number
// Copies of a node in a discontinuous grid function differ by rounding; nodes that a periodic mesh
// identifies lie apart by its size.
constexpr double kSamePlace = 1e-6;  // of the mesh's size

/// An element of MFEM, by its number: corners, edges and faces in MFEM's order.
struct Shape {
  CellType linear, quadratic;
  std::array<std::array<std::uint8_t, 3>, 8> corners;  ///< in the reference element
  std::array<std::array<std::uint8_t, 2>, 12> edges = {};
  std::array<std::uint8_t, 12> edge_order = {};  ///< MFEM's edge of each of VTK's
  std::array<std::array<std::uint8_t, 4>, 6> quads = {};
  std::array<std::uint8_t, 6> quad_order = {};  ///< MFEM's face of each of VTK's
  std::size_t edge_count = 0, quad_count = 0;
  bool has_middle = false;     ///< one node inside at order 2
  int simplex_dimensions = 0;  ///< axes whose coordinates add up to at most 1

  std::size_t corner_count() const { return std::size_t(cell_node_count(linear)); }
  int dimension() const { return cadmorph::dimension(linear); }
};

constexpr Shape kShapes[] = {
    {.linear = Vertex, .quadratic = Vertex, .corners = {}},
    {.linear = Line,
     .quadratic = QuadraticEdge,
     .corners = {{{0, 0, 0}, {1, 0, 0}}},
     .has_middle = true},
    {.linear = Triangle,
     .quadratic = QuadraticTriangle,
     .corners = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
     .edges = {{{0, 1}, {1, 2}, {2, 0}}},
     .edge_order = {0, 1, 2},
     .edge_count = 3,
     .simplex_dimensions = 2},
    {.linear = Quad,
     .quadratic = BiquadraticQuad,
     .corners = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}},
     .edges = {{{0, 1}, {1, 2}, {2, 3}, {3, 0}}},
     .edge_order = {0, 1, 2, 3},
     .edge_count = 4,
     .has_middle = true},
    {.linear = Tetra,
     .quadratic = QuadraticTetra,
     .corners = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
     .edges = {{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}},
     .edge_order = {0, 3, 1, 2, 4, 5},
     .edge_count = 6,
     .simplex_dimensions = 3},
    {.linear = Hexahedron,
     .quadratic = TriquadraticHexahedron,
     .corners =
         {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}},
     .edges = {{{0, 1},
                {1, 2},
                {3, 2},
                {0, 3},
                {4, 5},
                {5, 6},
                {7, 6},
                {4, 7},
                {0, 4},
                {1, 5},
                {2, 6},
                {3, 7}}},
     .edge_order = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11},
     .quads =
         {{{3, 2, 1, 0}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}, {4, 5, 6, 7}}},
     .quad_order = {4, 2, 1, 3, 0, 5},
     .edge_count = 12,
     .quad_count = 6,
     .has_middle = true},
    {.linear = Wedge,
     .quadratic = BiquadraticQuadraticWedge,
     .corners = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}},
     .edges = {{{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}}},
     .edge_order = {0, 1, 2, 3, 4, 5, 6, 7, 8},
     .quads = {{{0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}},
     .quad_order = {0, 1, 2},
     .edge_count = 9,
     .quad_count = 3,
     .simplex_dimensions = 2},
    {.linear = Pyramid, .quadratic = QuadraticPyramid, .corners = {}},
};
constexpr Index kPyramidNumber = 7;  // MFEM's, which are the places in kShapes

/// The vertices of an edge, a face or a corner, ascending; -1 where there are fewer than 4.
using VertexSet = std::array<Index, 4>;

VertexSet vertex_set(std::span<const Index> vertices, std::span<const std::uint8_t> locals) {
  VertexSet set = {-1, -1, -1, -1};
  for (std::size_t i = 0; i < locals.size(); ++i) set[i] = vertices[locals[i]];
  std::ranges::sort(set);
  return set;
}

struct VertexSetHash {
  std::size_t operator()(const VertexSet& set) const {
    std::size_t hash = 0;
    for (const Index vertex : set)
      hash = (hash ^ std::size_t(vertex)) * 0x9e3779b97f4a7c15u + (hash >> 29);
    return hash;
  }
};

/// Numbers edges or faces in the order in which they come first, as MFEM does.
class FirstCome {
 public:
  Index number(const VertexSet& set) { return numbers_.try_emplace(set, size()).first->second; }
  Index size() const { return std::ssize(numbers_); }

 private:
  std::unordered_map<VertexSet, Index, VertexSetHash> numbers_;
};

/// The local nodes of an element at order 1 or 2 in VTK's order, each as the corners in whose
/// middle it lies.
std::vector<std::vector<std::uint8_t>> local_nodes(const Shape& shape, int order) {
  std::vector<std::vector<std::uint8_t>> nodes;
  for (std::uint8_t corner = 0; corner < shape.corner_count(); ++corner) nodes.push_back({corner});
  if (order == 1) return nodes;
  for (std::size_t i = 0; i < shape.edge_count; ++i) {
    const auto& edge = shape.edges[shape.edge_order[i]];
    nodes.emplace_back(edge.begin(), edge.end());
  }
  for (std::size_t i = 0; i < shape.quad_count; ++i) {
    const auto& quad = shape.quads[shape.quad_order[i]];
    nodes.emplace_back(quad.begin(), quad.end());
  }
  if (shape.has_middle) {
    auto& all = nodes.emplace_back();
    for (std::uint8_t corner = 0; corner < shape.corner_count(); ++corner) all.push_back(corner);
  }
  return nodes;
}

/// The place of each of VTK's nodes among the dofs of a discontinuous element, which go through the
/// points of the reference element, x first.
std::vector<Index> discontinuous_order(const Shape& shape, int order) {
  const int dimension = shape.dimension();
  std::map<std::array<int, 3>, Index> places;
  for (int k = 0; k <= (dimension > 2 ? order : 0); ++k)
    for (int j = 0; j <= (dimension > 1 ? order : 0); ++j)
      for (int i = 0; i <= order; ++i) {
        const int sum = shape.simplex_dimensions == 3 ? i + j + k : i + j;
        if (shape.simplex_dimensions == 0 || sum <= order)
          places.emplace(std::array{i, j, k}, std::ssize(places));
      }
  std::vector<Index> result;
  for (const auto& corners : local_nodes(shape, order)) {
    std::array<int, 3> point{};
    for (std::size_t c = 0; c < 3; ++c) {
      for (const std::uint8_t corner : corners) point[c] += order * shape.corners[corner][c];
      point[c] /= int(corners.size());
    }
    result.push_back(places.at(point));
  }
  return result;
}

/// The finite elements of a grid function.
struct Collection {
  int order = 1;
  bool is_discontinuous = false;
};

/// Those whose values are positions of nodes: H1_3D_P2, L2_T1_2D_P1, ...
std::optional<Collection> collection_of(std::string_view name) {
  if (name == "Linear") return Collection{.order = 1};
  if (name == "Quadratic") return Collection{.order = 2};
  const std::size_t last = name.rfind("_P");
  if (last == std::string_view::npos || last < 3) return {};
  Collection collection;
  const std::string_view digits = name.substr(last + 2);
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), collection.order);
  if (error != std::errc() || end != digits.data() + digits.size()) return {};
  if (collection.order < 1) return {};
  const std::string_view basis = name.substr(0, last - 3);  // less "_3D"
  const bool is_positive = basis == "H1Pos" || basis == "H1@P" || basis == "L2_T2";
  const bool is_closed =
      basis == "H1" || basis == "H1@G" || basis == "H1@U" || basis == "L2_T1" || basis == "L2_T4";
  // At order 1 the values of the positive (Bernstein) basis are positions too.
  if (!is_closed && !(is_positive && collection.order == 1)) return {};
  collection.is_discontinuous = basis.starts_with("L2");
  if (collection.is_discontinuous && collection.order > 2) return {};
  return collection;
}

class Reader {
 public:
  Reader(std::string_view bytes, const fs::path& path) : in_(bytes, path, '#') {}

  ReadMesh run(SourceFile source) {
    read_header();
    while (in_.skip_space() && read_section()) {
    }
    if (elements_.empty()) in_.fail("there are no elements");
    if (!has_coordinates_ && !has_nodes_) in_.fail("there are no coordinates (vertices or nodes)");
    for (const Index vertex : vertices_)
      if (vertex >= vertex_count_)
        in_.fail("an element has the vertex " + std::to_string(vertex) + ", but there are only " +
                 std::to_string(vertex_count_));
    build_cells();
    build_groups();
    result_.copier = make_copier(std::move(source), std::move(places_));
    return std::move(result_);
  }

 private:
  struct Element {
    Index attribute = 0;
    const Shape* shape = nullptr;
    std::size_t first = 0;  ///< of its vertices

    std::size_t size() const { return shape->corner_count(); }
  };

  void read_header() {
    in_.skip_space();
    const std::size_t place = in_.place();
    std::string_view line = in_.line();
    while (line.ends_with(' ')) line.remove_suffix(1);
    if (line == "MFEM mesh v1.0" || line == "MFEM mesh v1.1" || line == "MFEM mesh v1.2" ||
        line == "MFEM mesh v1.3")
      return;
    const char* why = "its first line is not that of a version from 1.0 to 1.3";
    if (line.starts_with("MFEM NC mesh"))
      why = "it is a non-conforming mesh, whose hanging nodes are not read; refine it uniformly";
    else if (line.starts_with("MFEM NURBS mesh"))
      why = "it is a NURBS mesh; in MFEM, mesh.SetCurvature(2) makes it one of order 2";
    else if (line.starts_with("MFEM INLINE mesh"))
      why = "it describes a mesh that MFEM makes; load it in MFEM and save it";
    in_.fail_at(place, std::string(why) + " ('" + std::string(line.substr(0, 40)) + "')");
  }

  /// False at the end.
  bool read_section() {
    const std::size_t place = in_.place();
    const std::string_view word = in_.word("a section");
    if (word == "dimension") {
      dimension_ = int(in_.index("the dimension", 1, 4));
    } else if (word == "elements") {
      read_elements(elements_, dimension_, place);
    } else if (word == "boundary") {
      read_elements(boundary_, dimension_ - 1, place);
    } else if (word == "vertices") {
      read_vertices();
    } else if (word == "nodes") {
      read_nodes(place);
    } else if (word == "attribute_sets") {
      read_sets(nullptr);
    } else if (word == "bdr_attribute_sets") {
      read_sets(&boundary_sets_);
    } else if (word == "mfem_mesh_end" || word == "mfem_serial_mesh_end") {
      return false;
    } else if (word == "vertex_parents" || word == "coarse_elements") {
      in_.fail_at(place,
                  "it is a non-conforming mesh, whose hanging nodes are not read; refine it "
                  "uniformly");
    } else {
      in_.go_to(place);
      in_.fail_expected("a section of an MFEM mesh");
    }
    return true;
  }

  void read_elements(std::vector<Element>& elements, int dimension, std::size_t place) {
    if (dimension_ == 0) in_.fail_at(place, "there are elements before the dimension");
    if (!elements.empty()) in_.fail_at(place, "there is such a section before");
    const Index count = in_.count("the number of elements", 6);
    elements.resize(std::size_t(count));
    for (Element& element : elements) {
      element.attribute = in_.integer("the attribute of an element");
      in_.skip_space();
      const std::size_t type_place = in_.place();
      const Index type = in_.index("a geometry type", 0, std::ssize(kShapes));
      element.shape = &kShapes[type];
      if (element.shape->dimension() != dimension)
        in_.fail_at(type_place, "geometry type " + std::to_string(type) + " is not of dimension " +
                                    std::to_string(dimension));
      element.first = vertices_.size();
      for (std::size_t i = 0; i < element.size(); ++i)
        vertices_.push_back(in_.index("vertex", 0, kMostVertices));
    }
  }

  void read_vertices() {
    in_.skip_space();
    vertex_count_ = in_.index("the number of vertices", 1, kMostVertices);
    if (!in_.skip_space()) return;
    const std::size_t place = in_.place();
    const std::string_view word = in_.word("the dimension of space");
    in_.go_to(place);
    if (std::isalpha(static_cast<unsigned char>(word.front()))) return;  // curved: nodes
    has_coordinates_ = true;
    const Index components = in_.index("the dimension of space", 1, 4);
    read_values(vertex_count_, components, false, "vertices");
  }

  /// Values of `count` rows, in the file one row after the other or one component after the other.
  void read_values(Index count, Index components, bool is_by_component, const std::string& what) {
    const std::size_t rest = in_.text().size() - in_.place();
    if (std::size_t(count) > (rest + 1) / 2 / std::size_t(components))
      in_.fail("expected the coordinates of " + std::to_string(count) + " " + what + ", but only " +
               std::to_string(rest) + " bytes follow: the file is cut off or the count wrong");
    places_.components = int(components);
    places_.tokens.resize(std::size_t(count * components));
    values_.setZero(count, 3);
    for (Index i = 0; i < count * components; ++i) {
      const Index row = is_by_component ? i % count : i / components;
      const Index component = is_by_component ? i / count : i % components;
      places_.tokens[std::size_t(row * components + component)] =
          in_.number("a coordinate", values_(row, component));
    }
  }

  void read_nodes(std::size_t place) {
    if (has_coordinates_ || vertex_count_ == 0 || elements_.empty())
      in_.fail_at(place, "expected nodes after elements and vertices without coordinates");
    if (has_nodes_) in_.fail_at(place, "there are nodes a second time");
    has_nodes_ = true;
    expect("FiniteElementSpace");
    expect("FiniteElementCollection:");
    in_.skip_space();
    const std::size_t name_place = in_.place();
    const std::string_view name = in_.word("the finite elements of the nodes");
    const auto collection = collection_of(name);
    if (!collection)
      in_.fail_at(name_place, "its nodes are of " + std::string(name.substr(0, 40)) +
                                  "; those of H1 of any order and of L2_T1 of order 1 and 2 are "
                                  "read: in MFEM, mesh.SetCurvature(2) makes them so");
    collection_ = *collection;
    expect("VDim:");
    const Index components = in_.index("the number of coordinates", 1, 4);
    expect("Ordering:");
    const bool is_by_component = in_.index("the ordering", 0, 2) == 0;
    check_pyramids(name_place);
    number_dofs();
    if (collection_.order > 2) take_corners(components);
    read_values(dof_count_, components, is_by_component, "nodes");
    if (in_.skip_space() && !std::isalpha(static_cast<unsigned char>(in_.text()[in_.place()])))
      in_.fail("there are more values than the coordinates of " + std::to_string(dof_count_) +
               " nodes of these elements");
  }

  void expect(const std::string& word) {
    in_.skip_space();
    const std::size_t place = in_.place();
    if (in_.word(word) == word) return;
    in_.go_to(place);
    in_.fail_expected(word);
  }

  void check_pyramids(std::size_t place) const {
    if (collection_.order == 1 && !collection_.is_discontinuous) return;
    for (const Element& element : elements_)
      if (element.shape == &kShapes[kPyramidNumber])
        in_.fail_at(place,
                    "pyramids of order 2, or with discontinuous nodes, are not read; save "
                    "the mesh with straight elements");
  }

  /// Finds the dofs of each element, in VTK's order, as MFEM numbers them: vertices, edges, faces
  /// of four corners, insides; or element after element.
  void number_dofs() {
    std::map<const Shape*, std::vector<Index>> orders;
    if (collection_.is_discontinuous) {
      for (const Element& element : elements_) {
        auto& order = orders[element.shape];
        if (order.empty()) order = discontinuous_order(*element.shape, collection_.order);
        for (const Index local : order) dofs_.push_back(dof_count_ + local);
        dof_count_ += std::ssize(order);
      }
      return;
    }
    if (collection_.order != 2) {
      dof_count_ = vertex_count_;
      dofs_.assign(vertices_.begin(), vertices_.begin() + std::ptrdiff_t(element_vertices()));
      return;
    }
    FirstCome edges, quads;
    for (const Element& element : elements_) {
      const auto vertices = vertices_of(element);
      for (std::size_t i = 0; i < element.shape->edge_count; ++i)
        edges.number(vertex_set(vertices, element.shape->edges[i]));
      for (std::size_t i = 0; i < element.shape->quad_count; ++i)
        quads.number(vertex_set(vertices, element.shape->quads[i]));
    }
    const Index first_quad = vertex_count_ + edges.size();
    dof_count_ = first_quad + quads.size();
    for (const Element& element : elements_) {
      const Shape& shape = *element.shape;
      const auto vertices = vertices_of(element);
      dofs_.insert(dofs_.end(), vertices.begin(), vertices.end());
      for (std::size_t i = 0; i < shape.edge_count; ++i)
        dofs_.push_back(vertex_count_ +
                        edges.number(vertex_set(vertices, shape.edges[shape.edge_order[i]])));
      for (std::size_t i = 0; i < shape.quad_count; ++i)
        dofs_.push_back(first_quad +
                        quads.number(vertex_set(vertices, shape.quads[shape.quad_order[i]])));
      if (shape.has_middle) dofs_.push_back(dof_count_++);
    }
  }

  /// Above second order the cells are those of the corners, which come first; all other nodes are
  /// points in no cell. Their number is that of the values.
  void take_corners(Index components) {
    const std::size_t place = in_.place();
    Index values = 0;
    while (in_.skip_space() && !std::isalpha(static_cast<unsigned char>(in_.text()[in_.place()]))) {
      in_.number("a coordinate");
      ++values;
    }
    if (values % components != 0 || values / components < vertex_count_)
      in_.fail_at(place, "there are " + std::to_string(values) + " values for " +
                             std::to_string(vertex_count_) + " vertices and more nodes, of " +
                             std::to_string(components) + " coordinates each");
    dof_count_ = values / components;
    in_.go_to(place);
    result_.remarks.push_back("its elements are of order " + std::to_string(collection_.order) +
                              ": their corners alone are put on the CAD and judged, all other "
                              "nodes follow the field");
    collection_.order = 1;
  }

  std::span<const Index> vertices_of(const Element& element) const {
    return std::span(vertices_).subspan(element.first, element.size());
  }
  std::size_t element_vertices() const { return elements_.back().first + elements_.back().size(); }

  /// Named sets of attributes: a number of sets, then each a name in quotes, a count and
  /// attributes.
  void read_sets(std::map<std::string, std::vector<Index>>* sets) {
    const Index count = in_.count("the number of attribute sets", 4);
    for (Index i = 0; i < count; ++i) {
      in_.skip_space();
      const std::size_t begin = in_.place();
      const std::size_t end = in_.text().find('"', begin + 1);
      if (in_.text()[std::min(begin, in_.text().size() - 1)] != '"' ||
          end == std::string_view::npos)
        in_.fail("expected the name of an attribute set in quotes");
      const std::string name(in_.text().substr(begin + 1, end - begin - 1));
      in_.go_to(end + 1);
      const Index size = in_.count("the number of attributes of a set", 2);
      for (Index a = 0; a < size; ++a) {
        const Index attribute = in_.integer("an attribute");
        if (sets) (*sets)[name].push_back(attribute);
      }
    }
  }

  void build_cells() {
    Mesh& mesh = result_.mesh;
    mesh.region_array = "attribute";
    if (!has_nodes_) {
      dofs_.assign(vertices_.begin(), vertices_.begin() + std::ptrdiff_t(element_vertices()));
      dof_count_ = vertex_count_;
    }
    const bool is_quadratic = collection_.order == 2;
    const std::vector<Index> node_of = weld();
    for (Index& dof : dofs_) dof = node_of[std::size_t(dof)];
    mesh.points.resize(node_of.empty() ? 0 : 1 + *std::ranges::max_element(node_of), 3);
    for (Index dof = dof_count_ - 1; dof >= 0; --dof)
      mesh.points.row(node_of[std::size_t(dof)]) = values_.row(dof);
    places_.nodes = node_of;
    std::size_t first = 0;
    reserve_cells(mesh, std::ssize(elements_), std::ssize(dofs_));
    for (const Element& element : elements_) {
      const CellType type = is_quadratic ? element.shape->quadratic : element.shape->linear;
      const auto width = std::size_t(cell_node_count(type));
      add_cell(mesh, type, std::span(dofs_).subspan(first, width));
      mesh.regions.push_back(int(element.attribute));
      first += width;
    }
  }

  /// The node of each dof: of discontinuous elements those of the same vertex, edge or face that
  /// lie at the same place are one node.
  std::vector<Index> weld() const {
    std::vector<Index> node_of(static_cast<std::size_t>(dof_count_));
    for (Index dof = 0; dof < dof_count_; ++dof) node_of[std::size_t(dof)] = dof;
    if (!collection_.is_discontinuous) return node_of;
    std::vector<std::pair<VertexSet, Index>> copies;
    std::map<const Shape*, std::vector<std::vector<std::uint8_t>>> locals_of;
    std::size_t at = 0;
    for (const Element& element : elements_) {
      auto& locals = locals_of[element.shape];
      if (locals.empty()) locals = local_nodes(*element.shape, collection_.order);
      for (const auto& corners : locals) {
        const Index dof = dofs_[at++];
        const bool is_inside = corners.size() > 1 && corners.size() == element.size();
        if (!is_inside) copies.emplace_back(vertex_set(vertices_of(element), corners), dof);
      }
    }
    std::ranges::sort(copies);
    const double size = (values_.colwise().maxCoeff() - values_.colwise().minCoeff()).maxCoeff();
    for (std::size_t i = 0; i < copies.size(); ++i)
      for (std::size_t j = i; j-- > 0 && copies[j].first == copies[i].first;) {
        const Index a = copies[i].second, b = copies[j].second;
        if ((values_.row(a) - values_.row(b)).norm() > kSamePlace * size) continue;
        node_of[std::size_t(a)] = node_of[std::size_t(b)];
        break;
      }
    // The first dof of a node counts the nodes on; the others follow it.
    Index count = 0;
    for (Index dof = 0; dof < dof_count_; ++dof) {
      Index& node = node_of[std::size_t(dof)];
      node = node == dof ? count++ : node_of[std::size_t(node)];
    }
    return node_of;
  }

  void build_groups() {
    Mesh& mesh = result_.mesh;
    std::map<Index, std::size_t> group_of;
    for (const Element& facet : boundary_) {
      const auto [entry, is_new] = group_of.try_emplace(facet.attribute, mesh.groups.size());
      if (is_new)
        mesh.groups.push_back({.name = "boundary " + std::to_string(facet.attribute),
                               .kind = "boundary attribute",
                               .nodes = {}});
    }
    if (has_nodes_)
      add_curved_boundary(group_of);
    else
      for (const Element& facet : boundary_) {
        std::vector<Index>& nodes = mesh.groups[group_of[facet.attribute]].nodes;
        const auto vertices = vertices_of(facet);
        nodes.insert(nodes.end(), vertices.begin(), vertices.end());
      }
    for (const auto& [name, attributes] : boundary_sets_) {
      NodeGroup set{.name = name, .kind = "boundary attribute set", .nodes = {}};
      for (const Index attribute : attributes)
        if (const auto found = group_of.find(attribute); found != group_of.end()) {
          const std::vector<Index>& nodes = mesh.groups[found->second].nodes;
          set.nodes.insert(set.nodes.end(), nodes.begin(), nodes.end());
        }
      mesh.groups.push_back(std::move(set));
    }
    tidy_groups(mesh);
  }

  /// A facet of the boundary tells its vertices alone: its nodes are those of the elements' facets
  /// with the same vertices.
  void add_curved_boundary(const std::map<Index, std::size_t>& group_of) {
    std::unordered_map<VertexSet, std::vector<Index>, VertexSetHash> attributes;
    constexpr std::array<std::uint8_t, 4> kAll = {0, 1, 2, 3};
    for (const Element& facet : boundary_)
      attributes[vertex_set(vertices_of(facet), std::span(kAll).first(facet.size()))].push_back(
          facet.attribute);
    Mesh& mesh = result_.mesh;
    for (std::size_t e = 0; e < elements_.size(); ++e) {
      const Element& element = elements_[e];
      const auto cell = mesh.cell(Index(e));
      const auto add = [&](std::span<const std::uint8_t> corners,
                           std::span<const std::uint8_t> nodes) {
        const auto found = attributes.find(vertex_set(vertices_of(element), corners));
        if (found == attributes.end()) return;
        for (const Index attribute : found->second)
          for (const std::uint8_t node : nodes)
            mesh.groups[group_of.at(attribute)].nodes.push_back(cell[node]);
      };
      for (const LocalFace& face : local_faces(mesh.types[e])) {
        const auto nodes = std::span(face.nodes).first(std::size_t(face.count));
        add(nodes.first(std::size_t(corner_count(face.type, face.count))), nodes);
      }
      if (dimension_ != 2) continue;
      for (std::size_t i = 0; i < element.shape->edge_count; ++i) {
        const auto& edge = element.shape->edges[i];
        const std::array<std::uint8_t, 3> nodes = {edge[0], edge[1],
                                                   std::uint8_t(element.size() + i)};
        add(edge, std::span(nodes).first(collection_.order == 2 ? 3 : 2));
      }
    }
  }

  TextScanner in_;
  ReadMesh result_;
  TextPlaces places_;
  int dimension_ = 0;
  std::vector<Element> elements_, boundary_;
  std::vector<Index> vertices_;  ///< of elements and of the boundary
  Index vertex_count_ = 0;
  bool has_coordinates_ = false, has_nodes_ = false;
  Collection collection_;
  Index dof_count_ = 0;
  std::vector<Index> dofs_;  ///< of each element, in VTK's order
  Points values_;            ///< of vertices or dofs
  std::map<std::string, std::vector<Index>> boundary_sets_;
};

Recognition recognise(const FileStart& start) {
  TextScanner in(start.bytes, start.path, '#');
  if (!in.skip_space()) return Recognition::No;
  return in.line().starts_with("MFEM ") ? Recognition::Sure : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  SourceBytes file = read_source(path);
  return Reader(file.bytes, path).run(std::move(file.source));
}

}  // namespace

const MeshFormat& mfem_format() {
  static const MeshFormat format{
      .name = "MFEM", .extensions = {".mesh"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
