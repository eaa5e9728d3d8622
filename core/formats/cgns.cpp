#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "core/formats/cgns_tree.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

// ElementType_t's numbers.
constexpr Index kMixed = 20, kNgon = 22, kNface = 23;

/// An element type of CGNS.
struct Element {
  Index number;
  CellType type;
  Index nodes;
  /// CGNS's position of each of VTK's nodes; empty: the same order, as many as VTK's type has.
  std::vector<int> order = {};
};

const Element* element(Index number) {
  static const std::vector<Element> elements = {
      {2, Vertex, 1},
      {3, Line, 2},
      {4, QuadraticEdge, 3},
      {5, Triangle, 3},
      {6, QuadraticTriangle, 6},
      {7, Quad, 4},
      {8, QuadraticQuad, 8},
      {9, BiquadraticQuad, 9},
      {10, Tetra, 4},
      {11, QuadraticTetra, 10},
      {12, Pyramid, 5},
      {13, BiquadraticQuadraticPyramid, 14},
      {14, Wedge, 6},
      {15, QuadraticWedge, 15, {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11}},
      {16,
       BiquadraticQuadraticWedge,
       18,
       {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11, 15, 16, 17}},
      {17, Hexahedron, 8},
      {18, QuadraticHexahedron, 20, {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,
                                     10, 11, 16, 17, 18, 19, 12, 13, 14, 15}},
      {19, TriquadraticHexahedron, 27, {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 16, 17,
                                        18, 19, 12, 13, 14, 15, 24, 22, 21, 23, 20, 25, 26}},
      {21, QuadraticPyramid, 13},
  };
  const auto found = std::ranges::find(elements, number, &Element::number);
  return found == elements.end() ? nullptr : &*found;
}

/// A section of elements: their nodes one after the other, by their numbers in the zone.
struct Section {
  const CgnsNode* node = nullptr;
  Index number = 0;  ///< the element type, or kMixed, kNgon, kNface
  Index first = 0, count = 0;
  std::vector<Index> connectivity;
  std::vector<Index> offsets;            ///< count + 1; empty where all are of one size
  std::vector<std::uint8_t> types = {};  ///< of mixed elements

  Index type(Index i) const { return types.empty() ? number : types[std::size_t(i)]; }
  std::span<const Index> element_nodes(Index i) const {
    if (offsets.empty()) {
      const Index size = element(number)->nodes;
      return std::span(connectivity).subspan(std::size_t(i * size), std::size_t(size));
    }
    return std::span(connectivity)
        .subspan(std::size_t(offsets[std::size_t(i)]),
                 std::size_t(offsets[std::size_t(i) + 1] - offsets[std::size_t(i)]));
  }
  int dimension(Index i) const {
    const Index number = type(i);
    return number == kNgon ? 2 : number == kNface ? 3 : cadmorph::dimension(element(number)->type);
  }
  int highest_dimension() const {
    int highest = 0;
    for (Index i = 0; i < (types.empty() ? std::min<Index>(count, 1) : count); ++i)
      highest = std::max(highest, dimension(i));
    return highest;
  }
};

struct Zone {
  const CgnsNode* node = nullptr;
  bool is_structured = false;
  int dimensions = 1;                  ///< of its indices
  std::array<Index, 3> size{1, 1, 1};  ///< vertices along each index
  Index first = 0, count = 0;          ///< its vertices among those of all zones
  std::vector<Section> sections;       ///< by element number
  std::vector<Index> sorted = {};      ///< first elements, ascending

  Index vertex(const std::array<Index, 3>& at) const {
    return first + at[0] + size[0] * (at[1] + size[1] * at[2]);
  }
};

/// How many polyhedra (2: two or more) each face of a section has.
using FaceUses = std::map<const Section*, std::vector<std::uint8_t>>;

/// Points of the zones that are one node of the mesh.
class Joints {
 public:
  explicit Joints(Index points) : parents_(std::size_t(points)) {
    std::iota(parents_.begin(), parents_.end(), Index{0});
  }
  void join(Index a, Index b) {
    a = find(a), b = find(b);
    parents_[std::size_t(std::max(a, b))] = std::min(a, b);
  }
  Index find(Index a) {
    while (parents_[std::size_t(a)] != a)
      a = parents_[std::size_t(a)] = parents_[std::size_t(parents_[std::size_t(a)])];
    return a;
  }

 private:
  std::vector<Index> parents_;
};

class Reader {
 public:
  explicit Reader(const CgnsTree& tree) : tree_(tree) {}

  ReadMesh run() {
    read_base();
    for (const CgnsNode& node : base_->children)
      if (node.label == "Zone_t") read_zone(node);
    read_coordinates();
    find_nodes();
    for (Zone& zone : zones_) check_sections(zone);
    find_dimension();
    for (const Zone& zone : zones_) add_cells(zone);
    for (const Zone& zone : zones_) add_conditions(zone);
    for (NodeGroup& group : sections_) add_group(std::move(group));
    finish();
    return std::move(result_);
  }

 private:
  // ---- the tree

  void read_base() {
    std::string names;
    Index bases = 0;
    for (const CgnsNode& node : tree_.root().children) {
      if (node.label != "CGNSBase_t" || !node.with_label("Zone_t")) continue;
      base_ = &node;
      names += (bases++ ? ", " : "") + node.name;
    }
    if (bases == 0) tree_.fail(tree_.root(), "there is no base (CGNSBase_t) with a zone");
    if (bases > 1)
      tree_.fail(tree_.root(), "it has " + std::to_string(bases) + " bases with zones (" + names +
                                   "); leave one of them in a copy of the file");
    for (const char* motion : {"RigidGridMotion_t", "ArbitraryGridMotion_t"})
      for (const CgnsNode& zone : base_->children)
        if (zone.with_label(motion))
          remark("the grid motion of zone '" + zone.name + "' is that of the base");
  }

  void remark(std::string text) {
    if (std::ranges::find(result_.remarks, text) == result_.remarks.end())
      result_.remarks.push_back(std::move(text));
  }

  const CgnsNode& need(const CgnsNode& parent, std::string_view label) const {
    const CgnsNode* found = parent.with_label(label);
    if (!found) tree_.fail(parent, "it has no " + std::string(label));
    return *found;
  }

  void read_zone(const CgnsNode& node) {
    Zone zone;
    zone.node = &node;
    const std::string type = tree_.text(need(node, "ZoneType_t"));
    zone.is_structured = type == "Structured";
    if (!zone.is_structured && type != "Unstructured")
      tree_.fail(node, "its zone type is '" + type + "', which is not known");
    const std::vector<Index> sizes = tree_.integers(node);
    if (sizes.size() % 3 != 0 || sizes.size() > 9 || sizes.empty() ||
        (!zone.is_structured && sizes.size() != 3))
      tree_.fail(node, "a zone has 3 sizes for each index, not " + std::to_string(sizes.size()));
    zone.dimensions = int(sizes.size() / 3);
    zone.count = 1;
    for (int d = 0; d < zone.dimensions; ++d) {
      zone.size[std::size_t(d)] = sizes[std::size_t(d)];
      if (sizes[std::size_t(d)] < 1 ||
          __builtin_mul_overflow(zone.count, sizes[std::size_t(d)], &zone.count))
        tree_.fail(node,
                   "its number of vertices is wrong: " + std::to_string(sizes[std::size_t(d)]));
    }
    zone.first = points_count_;
    find_grid(zone);
    points_count_ += zone.count;
    if (!zone.is_structured)
      for (const CgnsNode& child : node.children)
        if (child.label == "Elements_t") zone.sections.push_back(read_section(child));
    std::ranges::sort(zone.sections, {}, &Section::first);
    if (has_cells_as_parents(zone)) zone.sections.push_back(cells_of_parents(zone, sizes[1]));
    for (const Section& section : zone.sections) zone.sorted.push_back(section.first);
    zones_.push_back(std::move(zone));
  }

  // ---- coordinates

  void find_grid(const Zone& zone) {
    const CgnsNode* grid = nullptr;
    int grids = 0;
    for (const CgnsNode& child : zone.node->children) {
      if (child.label != "GridCoordinates_t") continue;
      ++grids;
      if (!grid || child.name == "GridCoordinates") grid = &child;
    }
    if (!grid) tree_.fail(*zone.node, "it has no coordinates (GridCoordinates_t)");
    if (grids > 1)
      remark("zone '" + zone.node->name + "' has " + std::to_string(grids) + " grids; only '" +
             grid->name + "' moves");
    constexpr const char* kNames[] = {"CoordinateX", "CoordinateY", "CoordinateZ"};
    int found = 0;
    for (const CgnsNode& array : grid->children) {
      if (array.label != "DataArray_t" || !array.name.starts_with("Coordinate")) continue;
      const auto name = std::ranges::find(kNames, array.name);
      if (name == std::end(kNames))
        tree_.fail(array, "only Cartesian coordinates are read (CoordinateX, Y, Z)");
      Index count = 1;
      for (const Index size : array.shape) count *= std::max<Index>(size, 0);
      if (count != zone.count)
        tree_.fail(array, "it has " + std::to_string(count) + " numbers for " +
                              std::to_string(zone.count) +
                              " vertices (coordinates of rind planes are not read)");
      std::vector<Index> nodes(std::size_t(zone.count), 0);
      std::iota(nodes.begin(), nodes.end(), zone.first);
      runs_.push_back({&array, int(name - kNames), std::move(nodes)});
      ++found;
    }
    if (found == 0) tree_.fail(*grid, "it has no CoordinateX, CoordinateY, CoordinateZ");
  }

  void read_coordinates() {
    points_ = Points::Zero(points_count_, 3);
    result_.copier = tree_.read_coordinates(runs_, points_);
  }

  /// Joins the points of the zones where the file says that they are one, and numbers the nodes.
  void find_nodes() {
    Joints joints(points_count_);
    for (const Zone& zone : zones_)
      for (const CgnsNode& list : zone.node->children)
        if (list.label == "ZoneGridConnectivity_t")
          for (const CgnsNode& node : list.children) {
            if (node.label == "GridConnectivity1to1_t") join_ranges(zone, node, joints);
            if (node.label == "GridConnectivity_t") join_lists(zone, node, joints);
          }
    nodes_.resize(std::size_t(points_count_));
    Index count = 0;
    std::vector<Index> first_points;
    for (Index p = 0; p < points_count_; ++p) {
      const Index root = joints.find(p);
      nodes_[std::size_t(p)] = root == p ? count++ : nodes_[std::size_t(root)];
      if (root == p) first_points.push_back(p);
    }
    if (count == points_count_) {
      result_.mesh.points = std::move(points_);
      return;
    }
    result_.mesh.points = points_(first_points, Eigen::all);
    for (CgnsRun& run : runs_)
      for (Index& node : run.nodes) node = nodes_[std::size_t(node)];
    Points others = result_.mesh.points;
    result_.copier = tree_.read_coordinates(runs_, others);
  }

  /// Joins two points that the file matches, unless they lie apart, as those of periodic ones do.
  bool join(Index a, Index b, Joints& joints) const {
    constexpr double kSamePlace = 1e-6;  // of the mesh's size: float32 has 7 digits
    if ((points_.row(a) - points_.row(b)).norm() > kSamePlace * size()) return false;
    joints.join(a, b);
    return true;
  }

  double size() const {
    if (size_ == 0) size_ = (points_.colwise().maxCoeff() - points_.colwise().minCoeff()).norm();
    return size_;
  }

  const Zone& donor_of(const CgnsNode& node) const {
    std::string name = tree_.text(node);
    name = name.substr(name.rfind('/') + 1);
    const auto found =
        std::ranges::find_if(zones_, [&](const Zone& zone) { return zone.node->name == name; });
    if (found == zones_.end()) tree_.fail(node, "its donor zone '" + name + "' is missing");
    return *found;
  }

  struct Range {
    std::array<Index, 3> begin{}, end{};  ///< from 0, both in it; may run backwards
  };

  Range read_range(const Zone& zone, const CgnsNode& owner, std::string_view name) const {
    const CgnsNode* node = owner.with_name(name);
    if (!node) tree_.fail(owner, "it has no " + std::string(name));
    const std::vector<Index> values = tree_.integers(*node);
    if (std::ssize(values) != 2 * zone.dimensions)
      tree_.fail(*node, "it has " + std::to_string(values.size()) + " numbers, not " +
                            std::to_string(2 * zone.dimensions));
    Range range;
    for (std::size_t d = 0; d < std::size_t(zone.dimensions); ++d) {
      range.begin[d] = values[d] - 1;
      range.end[d] = values[d + std::size_t(zone.dimensions)] - 1;
      for (const Index at : {range.begin[d], range.end[d]})
        if (at < 0 || (zone.is_structured && at >= zone.size[d]))
          tree_.fail(*node, "index " + std::to_string(at + 1) + " is not in [1, " +
                                std::to_string(zone.size[d]) + "]");
    }
    return range;
  }

  std::array<Index, 3> read_transform(const Zone& zone, const CgnsNode& node) const {
    std::array<Index, 3> transform{1, 2, 3};
    const CgnsNode* child = node.with_name("Transform");
    if (!child) return transform;
    const std::vector<Index> values = tree_.integers(*child);
    if (std::ssize(values) != zone.dimensions) tree_.fail(*child, "it is of a wrong size");
    std::array<bool, 3> is_taken{};
    for (std::size_t d = 0; d < values.size(); ++d) {
      const Index axis = std::abs(values[d]);
      if (axis < 1 || axis > zone.dimensions ||
          std::exchange(is_taken[std::size_t(axis - 1)], true))
        tree_.fail(*child, "it is no transform of the indices");
      transform[d] = values[d];
    }
    return transform;
  }

  void join_ranges(const Zone& zone, const CgnsNode& node, Joints& joints) {
    const Zone& donor = donor_of(node);
    if (!zone.is_structured || !donor.is_structured || zone.dimensions != donor.dimensions)
      tree_.fail(node, "such an interface joins structured zones");
    const Range range = read_range(zone, node, "PointRange");
    const Range other = read_range(donor, node, "PointRangeDonor");
    const std::array<Index, 3> transform = read_transform(zone, node);
    bool is_apart = false;
    for_each(range, [&](const std::array<Index, 3>& at) {
      std::array<Index, 3> there = other.begin;
      for (std::size_t d = 0; d < std::size_t(zone.dimensions); ++d)
        there[std::size_t(std::abs(transform[d]) - 1)] +=
            (transform[d] < 0 ? -1 : 1) * (at[d] - range.begin[d]);
      for (std::size_t d = 0; d < 3; ++d)
        if (there[d] < 0 || there[d] >= donor.size[d])
          tree_.fail(node, "it leads to points that zone '" + donor.node->name + "' does not have");
      if (!join(zone.vertex(at), donor.vertex(there), joints)) is_apart = true;
    });
    if (is_apart) tell_apart(node);
  }

  void tell_apart(const CgnsNode& node) {
    remark("the two sides of interface '" + node.name +
           "' lie apart (as periodic ones do) and are not joined");
  }

  template <class Action>
  static void for_each(const Range& range, const Action& action) {
    std::array<Index, 3> low, high, at;
    for (std::size_t d = 0; d < 3; ++d) {
      low[d] = std::min(range.begin[d], range.end[d]);
      high[d] = std::max(range.begin[d], range.end[d]);
    }
    for (at[2] = low[2]; at[2] <= high[2]; ++at[2])
      for (at[1] = low[1]; at[1] <= high[1]; ++at[1])
        for (at[0] = low[0]; at[0] <= high[0]; ++at[0]) action(at);
  }

  void join_lists(const Zone& zone, const CgnsNode& node, Joints& joints) {
    const CgnsNode* type = node.with_label("GridConnectivityType_t");
    const std::string name = type ? tree_.text(*type) : "Overset";
    const CgnsNode* here = node.with_name("PointList");
    const CgnsNode* there = node.with_name("PointListDonor");
    if (name != "Abutting1to1" || !here || !there) {
      remark("interface '" + node.name + "' (" + name +
             ") matches no points: its sides move apart "
             "where the morph leaves them");
      return;
    }
    const Zone& donor = donor_of(node);
    const bool is_vertex = location_of(node) == "Vertex";
    const auto own = is_vertex ? vertices(zone, *here) : faces(zone, *here);
    const auto others = is_vertex ? vertices(donor, *there) : faces(donor, *there);
    if (own.size() != others.size())
      tree_.fail(node, "its two lists have " + std::to_string(own.size()) + " and " +
                           std::to_string(others.size()) + " entries");
    bool is_apart = false;
    for (std::size_t i = 0; i < own.size(); ++i)
      for (const Index a : own[i]) {
        const bool is_joined =
            std::ranges::any_of(others[i], [&](Index b) { return join(a, b, joints); });
        if (!is_joined) is_apart = true;
      }
    if (is_apart) tell_apart(node);
  }

  std::string location_of(const CgnsNode& node) const {
    const CgnsNode* location = node.with_label("GridLocation_t");
    return location ? tree_.text(*location) : "Vertex";
  }

  /// The points of each vertex, or of each face, of a list.
  std::vector<std::vector<Index>> vertices(const Zone& zone, const CgnsNode& list) const {
    const std::vector<Index> values = tree_.integers(list);
    std::vector<std::vector<Index>> result;
    const std::size_t width = std::size_t(zone.dimensions);
    if (values.size() % width != 0) tree_.fail(list, "it is of a wrong size");
    for (std::size_t i = 0; i < values.size(); i += width) {
      std::array<Index, 3> at{};
      for (std::size_t d = 0; d < width; ++d) {
        at[d] = values[i + d] - 1;
        if (at[d] < 0 || at[d] >= zone.size[d])
          tree_.fail(list, "vertex " + std::to_string(at[d] + 1) + " is not in [1, " +
                               std::to_string(zone.size[d]) + "]");
      }
      result.push_back({zone.vertex(at)});
    }
    return result;
  }

  std::vector<std::vector<Index>> faces(const Zone& zone, const CgnsNode& list) const {
    if (zone.is_structured)
      tree_.fail(list, "a list of faces of a structured zone is not read; give it by vertices");
    std::vector<std::vector<Index>> result;
    for (const Index number : tree_.integers(list))
      add_element_points(zone, list, number, result.emplace_back());
    return result;
  }

  // ---- elements

  Section read_section(const CgnsNode& node) {
    Section section;
    section.node = &node;
    const std::vector<Index> type = tree_.integers(node);
    const CgnsNode* range = node.with_name("ElementRange");
    const CgnsNode* connectivity = node.with_name("ElementConnectivity");
    if (type.empty() || !range || !connectivity)
      tree_.fail(node, "its type, ElementRange or ElementConnectivity is missing");
    section.number = type[0];
    const bool is_polygonal = section.number == kNgon || section.number == kNface;
    if (section.number != kMixed && !is_polygonal) known_element(node, section.number);
    const std::vector<Index> ends = tree_.integers(*range);
    if (ends.size() != 2 || ends[0] < 1 || ends[1] < ends[0] - 1)
      tree_.fail(*range, "expected the numbers of the first and the last element");
    section.first = ends[0];
    section.count = ends[1] - ends[0] + 1;
    section.connectivity = tree_.integers(*connectivity);
    if (section.count > std::ssize(section.connectivity)) fail_length(section);
    const CgnsNode* offsets = node.with_name("ElementStartOffset");
    if (section.number != kMixed && !is_polygonal) {
      if (std::ssize(section.connectivity) != section.count * element(section.number)->nodes)
        fail_length(section);
      return section;
    }
    if (offsets && is_polygonal) {
      section.offsets = tree_.integers(*offsets);
      if (std::ssize(section.offsets) != section.count + 1 || section.offsets.front() != 0 ||
          section.offsets.back() != std::ssize(section.connectivity) ||
          !std::ranges::is_sorted(section.offsets))
        tree_.fail(*offsets, "the offsets do not ascend from 0 to the size of the connectivity");
      return section;
    }
    take_counts_out(section);
    return section;
  }

  [[noreturn]] void fail_length(const Section& section) const {
    tree_.fail(*section.node, "its connectivity has " +
                                  std::to_string(section.connectivity.size()) + " numbers for " +
                                  std::to_string(section.count) + " elements of type " +
                                  std::to_string(section.number));
  }

  const Element& known_element(const CgnsNode& node, Index number) const {
    const Element* found = element(number);
    if (!found)
      tree_.fail(node, "element type " + std::to_string(number) +
                           " of CGNS is not known (elements of first and second order are)");
    return *found;
  }

  /// Leaves the nodes alone of elements that are preceded by their type or their number of nodes.
  void take_counts_out(Section& section) const {
    std::vector<Index> nodes;
    nodes.reserve(section.connectivity.size());
    section.offsets.push_back(0);
    std::size_t at = 0;
    for (Index i = 0; i < section.count; ++i) {
      if (at >= section.connectivity.size()) fail_length(section);
      Index count = section.connectivity[at++];
      if (section.number == kMixed) {
        section.types.push_back(std::uint8_t(known_element(*section.node, count).number));
        count = known_element(*section.node, count).nodes;
      }
      if (count < 0 || count > std::ssize(section.connectivity) - std::ssize(nodes) ||
          at + std::size_t(count) > section.connectivity.size())
        fail_length(section);
      nodes.insert(nodes.end(), section.connectivity.begin() + std::ptrdiff_t(at),
                   section.connectivity.begin() + std::ptrdiff_t(at) + count);
      at += std::size_t(count);
      section.offsets.push_back(std::ssize(nodes));
    }
    if (at != section.connectivity.size()) fail_length(section);
    section.connectivity = std::move(nodes);
  }

  /// Whether the cells are told by their faces alone, in ParentElements.
  bool has_cells_as_parents(const Zone& zone) const {
    const auto is_solid = [](const Section& section) { return section.highest_dimension() == 3; };
    const auto has_parents = [](const Section& section) {
      return section.number == kNgon && section.node->with_name("ParentElements");
    };
    return base_dimension() == 3 && std::ranges::any_of(zone.sections, has_parents) &&
           std::ranges::none_of(zone.sections, is_solid);
  }

  /// The section of NFACE_n that the parents of the faces stand for. The normal of a face points
  /// from its first parent to the second (SIDS, 7.3); 0 is none.
  Section cells_of_parents(const Zone& zone, Index cells) const {
    Section made{.number = kNface, .first = 1, .count = cells, .connectivity = {}, .offsets = {}};
    std::vector<std::pair<Index, Index>> sides;  // a cell, and one of its faces
    for (const Section& section : zone.sections) {
      made.first = std::max(made.first, section.first + section.count);
      if (section.number != kNgon) continue;
      made.node = section.node;
      const CgnsNode* node = section.node->with_name("ParentElements");
      if (!node)
        tree_.fail(*section.node,
                   "it has no ParentElements, which other faces of the zone have; without a "
                   "section NFACE_n all faces need them");
      const std::vector<Index> parents = tree_.integers(*node);
      if (std::ssize(parents) != 2 * section.count)
        tree_.fail(*node, "it has " + std::to_string(parents.size()) + " numbers for " +
                              std::to_string(section.count) + " faces; each face has two parents");
      for (Index i = 0; i < std::ssize(parents); ++i) {
        const bool is_first = i < section.count;
        const Index face = section.first + (is_first ? i : i - section.count);
        if (parents[std::size_t(i)] != 0)
          sides.emplace_back(parents[std::size_t(i)], is_first ? face : -face);
      }
    }
    std::ranges::sort(sides);
    for (std::size_t i = 0; i < sides.size(); ++i) {
      if (i == 0 || sides[i].first != sides[i - 1].first) made.offsets.push_back(Index(i));
      made.connectivity.push_back(sides[i].second);
    }
    if (std::ssize(made.offsets) != cells)
      tree_.fail(*zone.node, "the ParentElements of its faces name " +
                                 std::to_string(made.offsets.size()) + " cells, but it has " +
                                 std::to_string(cells) + "; write the file with NFACE_n");
    made.offsets.push_back(std::ssize(sides));
    return made;
  }

  void check_sections(const Zone& zone) const {
    for (const Section& section : zone.sections) {
      if (section.number == kNface) continue;
      for (const Index node : section.connectivity)
        if (node < 1 || node > zone.count)
          tree_.fail(*section.node, "node " + std::to_string(node) + " is used, but there are " +
                                        std::to_string(zone.count) + " vertices");
    }
  }

  /// The section that holds an element, by its number; null for none.
  static const Section* section_of(const Zone& zone, Index number) {
    const auto after = std::ranges::upper_bound(zone.sorted, number);
    if (after == zone.sorted.begin()) return nullptr;
    const Section& section = zone.sections[std::size_t(after - zone.sorted.begin() - 1)];
    return number < section.first + section.count ? &section : nullptr;
  }

  void add_element_points(const Zone& zone, const CgnsNode& list, Index number,
                          std::vector<Index>& points) const {
    const Section* section = section_of(zone, number);
    if (!section) tree_.fail(list, "there is no element " + std::to_string(number));
    const auto nodes = section->element_nodes(number - section->first);
    if (section->number == kNface) {
      for (const Index face : nodes) {
        const Section* of_face = section_of(zone, std::abs(face));
        if (!of_face || of_face->number != kNgon)
          tree_.fail(*section->node, "there is no face " + std::to_string(face));
        add_element_points(zone, *section->node, std::abs(face), points);
      }
      return;
    }
    for (const Index node : nodes) {
      if (node < 1 || node > zone.count)
        tree_.fail(*section->node, "node " + std::to_string(node) + " is used, but there are " +
                                       std::to_string(zone.count) + " vertices");
      points.push_back(zone.first + node - 1);
    }
  }

  void find_dimension() {
    for (const Zone& zone : zones_) {
      if (zone.is_structured) dimension_ = std::max(dimension_, zone.dimensions);
      for (const Section& section : zone.sections)
        dimension_ = std::max(dimension_, section.highest_dimension());
    }
  }

  Index node_of(const Zone& zone, Index number) const {
    return nodes_[std::size_t(zone.first + number - 1)];
  }

  void add_cells(const Zone& zone) {
    ++zone_number_;
    if (zone.is_structured) return add_structured_cells(zone);
    FaceUses uses;
    for (const Section& section : zone.sections)
      if (section.number == kNface) add_polyhedra(zone, section, uses);
    for (const Section& section : zone.sections)
      if (section.number != kNface) add_elements(zone, section, uses);
  }

  Index base_dimension() const {
    const std::vector<Index> sizes = tree_.integers(*base_);
    return sizes.empty() ? 3 : sizes[0];
  }

  void add_elements(const Zone& zone, const Section& section, const FaceUses& uses) {
    // Faces between cells are no boundary.
    const bool is_inner = section.number == kNgon && has_inner_face(section, uses);
    std::vector<Index> nodes, boundary;
    if (section.count > 0 && section.dimension(0) == dimension_)
      reserve_cells(result_.mesh, section.count, std::ssize(section.connectivity));
    for (Index i = 0; i < section.count; ++i) {
      const auto numbers = section.element_nodes(i);
      nodes.clear();
      if (section.dimension(i) < dimension_) {
        if (!is_inner)
          for (const Index number : numbers) boundary.push_back(node_of(zone, number));
        continue;
      }
      CellType type = numbers.size() == 3 ? Triangle : numbers.size() == 4 ? Quad : Polygon;
      if (section.type(i) == kNgon) {
        for (const Index number : numbers) nodes.push_back(node_of(zone, number));
      } else {
        const Element& kind = *element(section.type(i));
        type = kind.type;
        if (kind.order.empty())
          for (const Index number : numbers) nodes.push_back(node_of(zone, number));
        else
          for (const int position : kind.order)
            nodes.push_back(node_of(zone, numbers[std::size_t(position)]));
      }
      add(type, nodes);
    }
    if (!boundary.empty())
      sections_.push_back(
          {.name = section.node->name, .kind = "section", .nodes = std::move(boundary)});
  }

  static bool has_inner_face(const Section& section, const FaceUses& uses) {
    const auto found = uses.find(&section);
    return found != uses.end() && std::ranges::find(found->second, 2) != found->second.end();
  }

  void add(CellType type, std::span<const Index> nodes) {
    add_cell(result_.mesh, type, nodes);
    result_.mesh.regions.push_back(zone_number_);
  }

  void add_polyhedra(const Zone& zone, const Section& section, FaceUses& uses) {
    std::vector<std::vector<Index>> faces;
    for (Index i = 0; i < section.count; ++i) {
      const auto numbers = section.element_nodes(i);
      faces.resize(numbers.size());
      for (std::size_t f = 0; f < numbers.size(); ++f) {
        const Index number = std::abs(numbers[f]);
        const Section* of_face = section_of(zone, number);
        if (!of_face || of_face->number != kNgon)
          tree_.fail(*section.node, "polyhedron " + std::to_string(section.first + i) +
                                        " has face " + std::to_string(numbers[f]) +
                                        ", which is in no section of NGON_n");
        std::vector<std::uint8_t>& counts = uses[of_face];
        counts.resize(std::size_t(of_face->count), 0);
        std::uint8_t& count = counts[std::size_t(number - of_face->first)];
        count = std::uint8_t(std::min(2, count + 1));
        faces[f].clear();
        for (const Index node : of_face->element_nodes(number - of_face->first))
          faces[f].push_back(node_of(zone, node));
        if (numbers[f] < 0) std::ranges::reverse(faces[f]);
      }
      add_polyhedron(result_.mesh, faces);
      result_.mesh.regions.push_back(zone_number_);
    }
  }

  void add_structured_cells(const Zone& zone) {
    if (zone.dimensions < dimension_ || zone.dimensions < 2) {
      remark("zone '" + zone.node->name + "' has no cells of the mesh's dimension");
      return;
    }
    const auto node = [&](Index i, Index j, Index k) {
      return nodes_[std::size_t(zone.vertex({i, j, k}))];
    };
    const CgnsNode* family = zone.node->with_label("FamilyName_t");
    result_.mesh.zone_of_block[zone_number_] =
        zones_of_families_
            .try_emplace(family ? tree_.text(*family) : "", int(zones_of_families_.size()))
            .first->second;
    if (zone.dimensions == 2) {
      for (Index j = 0; j + 1 < zone.size[1]; ++j)
        for (Index i = 0; i + 1 < zone.size[0]; ++i)
          add(Quad, std::array{node(i, j, 0), node(i + 1, j, 0), node(i + 1, j + 1, 0),
                               node(i, j + 1, 0)});
      return;
    }
    for (Index k = 0; k + 1 < zone.size[2]; ++k)
      for (Index j = 0; j + 1 < zone.size[1]; ++j)
        for (Index i = 0; i + 1 < zone.size[0]; ++i)
          add(Hexahedron, std::array{node(i, j, k), node(i + 1, j, k), node(i + 1, j + 1, k),
                                     node(i, j + 1, k), node(i, j, k + 1), node(i + 1, j, k + 1),
                                     node(i + 1, j + 1, k + 1), node(i, j + 1, k + 1)});
  }

  // ---- boundary conditions

  void add_conditions(const Zone& zone) {
    for (const CgnsNode& list : zone.node->children) {
      if (list.label != "ZoneBC_t") continue;
      for (const CgnsNode& node : list.children)
        if (node.label == "BC_t") add_condition(zone, node);
    }
  }

  void add_condition(const Zone& zone, const CgnsNode& node) {
    NodeGroup group{.name = node.name, .kind = "boundary condition", .nodes = {}};
    for (const Index point : condition_points(zone, node))
      group.nodes.push_back(nodes_[std::size_t(point)]);
    if (node.with_name("InwardNormalList"))
      remark("the normals of boundary condition '" + node.name + "' are those of the base");
    if (const CgnsNode* family = node.with_label("FamilyName_t")) {
      const std::string name = tree_.text(*family);
      if (name != node.name)
        families_.push_back({.name = name, .kind = "family", .nodes = group.nodes});
    }
    add_group(std::move(group));
  }

  std::vector<Index> condition_points(const Zone& zone, const CgnsNode& node) {
    const std::string location = location_of(node);
    const CgnsNode* elements = node.with_name("ElementList");
    const CgnsNode* list = node.with_name("PointList");
    std::vector<Index> points;
    const auto append = [&](const std::vector<std::vector<Index>>& parts) {
      for (const std::vector<Index>& part : parts)
        points.insert(points.end(), part.begin(), part.end());
    };
    const auto add_range = [&](const Range& range) {
      for (Index number = range.begin[0]; number <= range.end[0]; ++number)
        add_element_points(zone, node, number + 1, points);
    };
    if (elements) {
      append(faces(zone, *elements));
    } else if (node.with_name("ElementRange")) {
      add_range(read_range(zone, node, "ElementRange"));
    } else if (list && location == "Vertex") {
      append(vertices(zone, *list));
    } else if (list && zone.is_structured) {
      remark("boundary condition '" + node.name +
             "' is a list of faces of a structured zone, which is not read");
    } else if (list) {
      append(faces(zone, *list));
    } else if (node.with_name("PointRange")) {
      const Range range = read_range(zone, node, "PointRange");
      if (zone.is_structured)
        add_structured_range(zone, range, location, points);
      else if (location != "Vertex")
        add_range(range);
      else
        for_each(range, [&](const std::array<Index, 3>& at) {
          if (at[0] >= zone.count)
            tree_.fail(node, "there is no vertex " + std::to_string(at[0] + 1));
          points.push_back(zone.vertex(at));
        });
    }
    return points;
  }

  /// Vertices of a range, or the corners of its faces.
  static void add_structured_range(const Zone& zone, Range range, const std::string& location,
                                   std::vector<Index>& points) {
    if (location != "Vertex") {
      constexpr const char* kNormals[] = {"IFaceCenter", "JFaceCenter", "KFaceCenter"};
      std::size_t normal = std::size_t(std::ranges::find(kNormals, location) - kNormals);
      for (std::size_t d = 0; normal == 3 && d < std::size_t(zone.dimensions); ++d)
        if (range.begin[d] == range.end[d] && zone.size[d] > 2) normal = d;
      for (std::size_t d = 0; d < std::size_t(zone.dimensions); ++d) {
        if (d == normal) continue;
        if (range.end[d] < range.begin[d]) std::swap(range.begin[d], range.end[d]);
        range.end[d] = std::min(range.end[d] + 1, zone.size[d] - 1);
      }
    }
    for_each(range, [&](const std::array<Index, 3>& at) { points.push_back(zone.vertex(at)); });
  }

  /// Groups of one name, as those of several zones, are one.
  void add_group(NodeGroup group) {
    auto& groups = result_.mesh.groups;
    const auto [found, is_new] = group_of_.emplace(group.name, groups.size());
    if (is_new) {
      groups.push_back(std::move(group));
      return;
    }
    auto& nodes = groups[found->second].nodes;
    nodes.insert(nodes.end(), group.nodes.begin(), group.nodes.end());
  }

  void finish() {
    for (NodeGroup& group : families_) add_group(std::move(group));
    Mesh& mesh = result_.mesh;
    if (zones_.size() > 1) {
      mesh.region_array = "zone";
    } else {
      mesh.regions.clear();
      mesh.zone_of_block.clear();
    }
    tidy_groups(mesh);
    if (mesh.types.empty()) tree_.fail(*base_, "it has no cells");
  }

  const CgnsTree& tree_;
  ReadMesh result_;
  const CgnsNode* base_ = nullptr;
  std::vector<Zone> zones_;
  std::vector<CgnsRun> runs_;
  Index points_count_ = 0;
  Points points_;             ///< of all zones
  std::vector<Index> nodes_;  ///< of each point
  std::vector<NodeGroup> sections_, families_;
  std::map<std::string, std::size_t> group_of_;
  mutable double size_ = 0;
  int dimension_ = 0;
  int zone_number_ = 0;
  std::map<std::string, int> zones_of_families_;  ///< of structured zones
};

Recognition recognise(const FileStart& start) {
  return is_adf(start) ? Recognition::Sure
                       : recognise_hdf5(start, "/CGNSLibraryVersion", "HDF5 MotherNode");
}

ReadMesh read(const fs::path& path) {
  const std::unique_ptr<const CgnsTree> tree = read_cgns_tree(path);
  return Reader(*tree).run();
}

}  // namespace

const MeshFormat& cgns_format() {
  static const MeshFormat format{
      .name = "CGNS", .extensions = {".cgns", ".adf"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
