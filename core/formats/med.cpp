#include <algorithm>
#include <map>
#include <numeric>
#include <optional>

#include "core/cell_topology.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5_coordinates.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

/// An element type of MED.
struct Element {
  std::string_view name;
  CellType type;
  /// Position in the file of each of VTK's nodes; empty: the same order.
  std::vector<int> order = {};
};

const Element* element(std::string_view name) {
  static const std::vector<Element> elements = {
      {"PO1", Vertex},
      {"SE2", Line},
      {"SE3", QuadraticEdge},
      {"TR3", Triangle},
      {"TR6", QuadraticTriangle},
      {"TR7", BiquadraticTriangle},
      {"QU4", Quad},
      {"QU8", QuadraticQuad},
      {"QU9", BiquadraticQuad},
      {"TE4", Tetra},
      {"T10", QuadraticTetra},
      {"PY5", Pyramid},
      {"P13", QuadraticPyramid},
      {"PE6", Wedge},
      {"P15", QuadraticWedge},
      {"P18", BiquadraticQuadraticWedge},
      {"HE8", Hexahedron},
      {"H20", QuadraticHexahedron},
      {"H27", TriquadraticHexahedron, {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13,
                                       14, 15, 16, 17, 18, 19, 24, 22, 21, 23, 20, 25, 26}},
  };
  const auto found = std::ranges::find(elements, name, &Element::name);
  return found == elements.end() ? nullptr : &*found;
}

class Reader {
 public:
  explicit Reader(const Hdf5File& file) : file_(file) {}

  ReadMesh run() {
    const std::string mesh = the_only("/ENS_MAA", "mesh");
    check_kind(mesh);
    const std::string step =
        file_.has(mesh + "/NOE") ? mesh : the_only(mesh, "time step of the mesh");
    read_families("/FAS" + mesh.substr(std::string("/ENS_MAA").size()));
    read_points(mesh, step + "/NOE");
    if (!file_.has(step + "/MAI")) file_.fail(step, "it has no elements (MAI)");
    for (const std::string& name : file_.children(step + "/MAI"))
      read_elements(step + "/MAI/" + name, name);
    finish();
    return std::move(result_);
  }

 private:
  /// The path of a group's only member; a file with several is refused.
  std::string the_only(const std::string& group, const std::string& what) const {
    const std::vector<std::string> names = file_.children(group);
    if (names.size() == 1) return group + "/" + names[0];
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
    file_.fail(group, names.empty() ? "there is no " + what
                                    : "there is more than one " + what + " (" + list +
                                          "); leave one of them in a copy of the file");
  }

  Index attribute(const std::string& object, const std::string& name, Index otherwise) const {
    if (!file_.has_attribute(object, name)) return otherwise;
    const std::vector<Index> values = file_.integer_attribute(object, name);
    return values.empty() ? otherwise : values[0];
  }

  void check_kind(const std::string& mesh) const {
    if (attribute(mesh, "TYP", 0) != 0)
      file_.fail(mesh, "it is a structured mesh, which is not read; write it as unstructured");
    if (attribute(mesh, "REP", 0) != 0)
      file_.fail(mesh, "its coordinates are not Cartesian; write it with Cartesian ones");
  }

  void read_points(const std::string& mesh, const std::string& group) {
    const std::string data = group + "/COO";
    const std::vector<Index> shape = file_.shape(data);
    const Index total =
        std::accumulate(shape.begin(), shape.end(), Index{1}, std::multiplies<Index>());
    const Index dimensions = attribute(mesh, "ESP", attribute(mesh, "DIM", 3));
    if (dimensions < 1 || dimensions > 3 || total % dimensions != 0)
      file_.fail(data, std::to_string(total) + " numbers are no coordinates of " +
                           std::to_string(dimensions) + " dimensions");
    const Index nodes = total / dimensions;
    std::vector<Hdf5Run> runs;
    for (int c = 0; c < dimensions; ++c)
      runs.push_back({.dataset = data, .first = nodes * c, .count = nodes, .component = c});
    result_.mesh.points = Points::Zero(nodes, 3);
    result_.copier = read_hdf5_coordinates(file_, runs, result_.mesh.points);
    const std::vector<Index> families = families_in(group, nodes);
    for (Index n = 0; n < nodes; ++n)
      if (families[std::size_t(n)] != 0) add_to_groups(families[std::size_t(n)], {&n, 1});
  }

  /// The family of each of `count` nodes or elements.
  std::vector<Index> families_in(const std::string& group, Index count) const {
    if (!file_.has(group + "/FAM")) return std::vector<Index>(std::size_t(count), 0);
    std::vector<Index> families = file_.integers(group + "/FAM");
    if (std::ssize(families) != count)
      file_.fail(group + "/FAM", "it has " + std::to_string(families.size()) + " families for " +
                                     std::to_string(count) + " entries");
    return families;
  }

  void read_families(const std::string& mesh) {
    for (const auto& [part, kind] :
         {std::pair("/NOEUD", "node group"), {"/ELEME", "element group"}}) {
      const std::string group = mesh + part;
      if (!file_.has(group)) continue;
      for (const std::string& name : file_.children(group)) {
        const std::string family = group + "/" + name;
        const Index number = attribute(family, "NUM", 0);
        if (!file_.has(family + "/GRO/NOM")) continue;
        for (const std::string& text : file_.texts(family + "/GRO/NOM"))
          groups_of_[number].push_back(group_named(text, kind));
      }
    }
  }

  std::size_t group_named(const std::string& name, const std::string& kind) {
    auto& groups = result_.mesh.groups;
    const auto found = std::ranges::find_if(
        groups, [&](const NodeGroup& group) { return group.name == name && group.kind == kind; });
    if (found != groups.end()) return std::size_t(found - groups.begin());
    groups.push_back({.name = name, .kind = kind, .nodes = {}});
    return groups.size() - 1;
  }

  void add_to_groups(Index family, std::span<const Index> nodes) {
    const auto found = groups_of_.find(family);
    if (found == groups_of_.end()) return;
    for (const std::size_t group : found->second) {
      std::vector<Index>& all = result_.mesh.groups[group].nodes;
      all.insert(all.end(), nodes.begin(), nodes.end());
    }
  }

  std::vector<Index> read_nodes(const std::string& group) const {
    std::vector<Index> nodes = file_.integers(group + "/NOD");
    for (Index& node : nodes) {
      if (node < 1 || node > result_.mesh.node_count())
        file_.fail(group + "/NOD", "node " + std::to_string(node) + " is used, but there are " +
                                       std::to_string(result_.mesh.node_count()) + " nodes");
      --node;
    }
    return nodes;
  }

  void read_elements(const std::string& group, const std::string& name) {
    if (name == "POG") return read_polygons(group);
    if (name == "POE") return read_polyhedra(group);
    const Element* kind = element(name);
    if (!kind) file_.fail(group, "elements of type " + name + " are not known");
    const std::vector<Index> nodes = read_nodes(group);
    const Index size = cell_node_count(kind->type);
    if (std::ssize(nodes) % size != 0)
      file_.fail(group + "/NOD", std::to_string(nodes.size()) + " nodes are no elements of " +
                                     std::to_string(size));
    const Index count = std::ssize(nodes) / size;
    const std::vector<Index> families = families_in(group, count);
    std::vector<Index> cells(nodes.size());  // the file has all first nodes, all second ones ...
    for (Index i = 0; i < size; ++i) {
      const Index position = kind->order.empty() ? i : kind->order[std::size_t(i)];
      for (Index e = 0; e < count; ++e)
        cells[std::size_t(e * size + i)] = nodes[std::size_t(position * count + e)];
    }
    Mesh& mesh = result_.mesh;
    const Index first = mesh.cell_count();
    add_cells(mesh, kind->type, std::move(cells));
    mesh.regions.insert(mesh.regions.end(), families.begin(), families.end());
    if (groups_of_.empty()) return;
    for (Index e = 0; e < count; ++e) add_to_groups(families[std::size_t(e)], mesh.cell(first + e));
  }

  void end_cell(Index family) {
    Mesh& mesh = result_.mesh;
    mesh.regions.push_back(int(family));
    add_to_groups(family, mesh.cell(mesh.cell_count() - 1));
  }

  /// Positions from 1 that ascend to `end`, made to begin at 0.
  std::vector<Index> read_index(const std::string& dataset, Index end) const {
    std::vector<Index> index = file_.integers(dataset);
    for (Index& position : index) --position;
    if (index.empty() || index.front() != 0 || index.back() != end ||
        !std::ranges::is_sorted(index))
      file_.fail(dataset, "the positions do not ascend from 1 to " + std::to_string(end + 1));
    return index;
  }

  void read_polygons(const std::string& group) {
    const std::vector<Index> nodes = read_nodes(group);
    const std::vector<Index> index = read_index(group + "/INN", std::ssize(nodes));
    const std::vector<Index> families = families_in(group, std::ssize(index) - 1);
    for (std::size_t e = 0; e + 1 < index.size(); ++e) {
      add_cell(
          result_.mesh, Polygon,
          std::span(nodes).subspan(std::size_t(index[e]), std::size_t(index[e + 1] - index[e])));
      end_cell(families[e]);
    }
  }

  void read_polyhedra(const std::string& group) {
    const std::vector<Index> nodes = read_nodes(group);
    const std::vector<Index> of_faces = read_index(group + "/IFN", std::ssize(nodes));
    const std::vector<Index> of_cells = read_index(group + "/INN", std::ssize(of_faces) - 1);
    const std::vector<Index> families = families_in(group, std::ssize(of_cells) - 1);
    std::vector<std::vector<Index>> faces;
    for (std::size_t e = 0; e + 1 < of_cells.size(); ++e) {
      faces.clear();
      for (Index f = of_cells[e]; f < of_cells[e + 1]; ++f)
        faces.emplace_back(nodes.begin() + of_faces[std::size_t(f)],
                           nodes.begin() + of_faces[std::size_t(f) + 1]);
      add_polyhedron(result_.mesh, faces);
      end_cell(families[e]);
    }
  }

  void finish() {
    Mesh& mesh = result_.mesh;
    mesh.region_array = "family";
    if (std::ranges::adjacent_find(mesh.regions, std::not_equal_to<>()) == mesh.regions.end()) {
      mesh.regions.clear();
      mesh.region_array.clear();
    }
    tidy_groups(mesh);
  }

  const Hdf5File& file_;
  ReadMesh result_;
  std::map<Index, std::vector<std::size_t>> groups_of_;  ///< of each family
};

Recognition recognise(const FileStart& start) {
  return recognise_hdf5(start, "/ENS_MAA", "ENS_MAA");
}

ReadMesh read(const fs::path& path) { return Reader(Hdf5File(path)).run(); }

}  // namespace

const MeshFormat& med_format() {
  static const MeshFormat format{
      .name = "MED", .extensions = {".med"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
