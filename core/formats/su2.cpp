#include <array>
#include <cctype>
#include <utility>

#include "core/cell_topology.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/formats.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr Index kMostNodes = Index{1} << 40;  // keeps sums from overflowing

/// The elements that SU2 knows; their numbers and node orders are VTK's.
bool is_element(Index number) {
  using enum CellType;
  const CellType type = CellType(number);
  return number > 0 && number < 256 &&
         (type == Vertex || type == Line || type == Triangle || type == Quad || type == Tetra ||
          type == Hexahedron || type == Wedge || type == Pyramid);
}

/// Reads the zones of a file one after the other into one mesh.
class Reader {
 public:
  Reader(std::string_view text, const fs::path& path) : in_(text, path, '%') {}

  ReadMesh run(SourceFile source) {
    while (in_.skip_space()) read_entry();
    check_nodes();
    if (points_.empty()) in_.fail("there are no points (NPOIN=)");
    Mesh& mesh = result_.mesh;
    mesh.points = Eigen::Map<const Points>(points_.data(), std::ssize(points_) / 3, 3);
    if (zones_ > 1)
      mesh.region_array = "zone";
    else
      mesh.regions.clear();
    tidy_groups(mesh);
    if (has_ffd_)
      result_.remarks.push_back(
          "the FFD boxes in the file are those of the base: set them up anew for the new shape");
    if (has_periodic_)
      result_.remarks.push_back("the periodic transformations in the file are those of the base");
    result_.copier = make_copier(std::move(source), std::move(places_));
    return std::move(result_);
  }

 private:
  Index node_count() const { return std::ssize(points_) / 3; }

  void read_entry() {
    const std::size_t place = in_.place();
    const std::string_view line = in_.line();
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) return;  // of a section that is not read
    std::string_view key = line.substr(0, equals);
    while (key.ends_with(' ') || key.ends_with('\t')) key.remove_suffix(1);
    in_.go_to(place + equals + 1);
    if (key == "NZONE")
      zones_ = in_.count("the number of zones");
    else if (key == "IZONE")
      begin_zone();
    else if (key == "NDIME")
      read_dimension();
    else if (key == "NELEM")
      read_elements();
    else if (key == "NPOIN")
      read_points();
    else if (key == "NMARK")
      in_.count("the number of markers", 0);
    else if (key == "MARKER_TAG")
      read_marker();
    else if (key == "MARKER_ELEMS")
      read_marker_elements();
    else if (key == "NPERIODIC")
      has_periodic_ = in_.count("the number of periodic transformations", 0) > 1;
    else if (key.starts_with("FFD_"))
      has_ffd_ = true;
    in_.skip_line();
  }

  void begin_zone() {
    check_nodes();
    zone_ = int(in_.integer("the number of the zone"));
    first_node_ = node_count();
    first_group_ = result_.mesh.groups.size();
  }

  void read_dimension() {
    const Index dimension = in_.index("the dimension", 2, 4);
    if (!points_.empty() && dimension != places_.components)
      in_.fail("its zones are of different dimensions");
    places_.components = int(dimension);
    has_dimension_ = true;
  }

  /// Reads the type and the nodes of an element; the nodes by their numbers in the zone.
  CellType read_element() {
    in_.skip_space();
    const std::size_t place = in_.place();
    const Index number = in_.integer("an element type");
    if (!is_element(number))
      in_.fail_at(place, "element type " + std::to_string(number) + " is none of SU2's");
    const CellType type = CellType(number);
    nodes_.resize(std::size_t(cell_node_count(type)));
    for (Index& node : nodes_) {
      node = first_node_ + in_.index("node", 0, kMostNodes);
      if (node > highest_node_) {
        highest_node_ = node;
        highest_place_ = place;
      }
    }
    in_.skip_line();
    return type;
  }

  void read_elements() {
    const Index count = in_.count("the number of elements (NELEM)", 4);
    for (Index i = 0; i < count; ++i) {
      const CellType type = read_element();
      if (i == 0) reserve_cells(result_.mesh, count, count * std::ssize(nodes_));
      add_cell(result_.mesh, type, nodes_);
      result_.mesh.regions.push_back(zone_);
    }
    step_back();
  }

  void read_points() {
    if (!has_dimension_) in_.fail("NDIME= is missing before the points");
    const int components = places_.components;
    const Index count = in_.count("the number of points (NPOIN)", 4);
    in_.skip_line();
    points_.reserve(points_.size() + 3 * std::size_t(count));
    places_.tokens.reserve(places_.tokens.size() + std::size_t(components * count));
    for (Index i = 0; i < count; ++i) {
      std::array<double, 3> point{};
      for (int c = 0; c < components; ++c)
        places_.tokens.push_back(in_.number("a coordinate", point[std::size_t(c)]));
      points_.insert(points_.end(), point.begin(), point.end());
      in_.skip_line();
    }
    step_back();
  }

  void read_marker() {
    std::string name(in_.word("the name of a marker"));
    if (zones_ > 1) name += " (zone " + std::to_string(zone_) + ")";
    result_.mesh.groups.push_back({.name = std::move(name), .kind = "marker", .nodes = {}});
  }

  void read_marker_elements() {
    if (result_.mesh.groups.size() == first_group_) in_.fail("MARKER_TAG= is missing before");
    std::vector<Index>& nodes = result_.mesh.groups.back().nodes;
    const Index count = in_.count("the number of elements of a marker (MARKER_ELEMS)", 4);
    // Markers of partitions (SEND_RECEIVE) tell the partition in a line of their own: SEND_RECV=,
    // SEND_TO=, ...
    if (count > 0 && in_.skip_space()) {
      const std::string_view rest = in_.text().substr(in_.place());
      if (std::isalpha(static_cast<unsigned char>(rest.front())) && !rest.starts_with("MARKER_"))
        in_.skip_line();
    }
    for (Index i = 0; i < count; ++i) {
      read_element();
      nodes.insert(nodes.end(), nodes_.begin(), nodes_.end());
    }
    step_back();
  }

  /// To the end of the line read last: read_entry skips it.
  void step_back() {
    if (in_.place() > 0) in_.go_to(in_.place() - 1);
  }

  /// Elements may stand before the points of their zone.
  void check_nodes() const {
    if (highest_node_ >= node_count())
      in_.fail_at(highest_place_, "node " + std::to_string(highest_node_ - first_node_) +
                                      " is used, but there are only " +
                                      std::to_string(node_count() - first_node_) + " points");
  }

  TextScanner in_;
  ReadMesh result_;
  TextPlaces places_;
  std::vector<double> points_;
  std::vector<Index> nodes_;  ///< of the element read last
  Index zones_ = 1;
  int zone_ = 1;
  Index first_node_ = 0;
  std::size_t first_group_ = 0;
  Index highest_node_ = -1;
  std::size_t highest_place_ = 0;
  bool has_dimension_ = false, has_ffd_ = false, has_periodic_ = false;
};

Recognition recognise(const FileStart& start) {
  TextScanner in(start.bytes, start.path, '%');
  if (!in.skip_space()) return Recognition::No;
  const std::string_view line = in.line();
  if (line.starts_with("NDIME") || line.starts_with("NZONE") || line.starts_with("IZONE"))
    return Recognition::Sure;
  return line.find('=') != std::string_view::npos ? Recognition::Possible : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  SourceBytes file = read_source(path);
  return Reader(file.bytes, path).run(std::move(file.source));
}

}  // namespace

const MeshFormat& su2_format() {
  static const MeshFormat format{
      .name = "SU2", .extensions = {".su2"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
