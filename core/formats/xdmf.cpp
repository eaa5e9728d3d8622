#include <algorithm>
#include <cctype>
#include <map>
#include <pugixml.hpp>
#include <string>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5_coordinates.h"
#include "core/formats/source_file.h"
#include "core/formats/text_scanner.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

/// Topologies whose elements have their number of nodes before them where types are mixed.
constexpr Index kPolyvertex = 1, kPolyline = 2, kPolygon = 3;

struct Topology {
  std::string_view name;
  Index number;  ///< where types are mixed
  CellType type;
};

const Topology* topology(Index number) {
  static constexpr Topology kTopologies[] = {
      {"triangle", 4, Triangle},
      {"quadrilateral", 5, Quad},
      {"tetrahedron", 6, Tetra},
      {"pyramid", 7, Pyramid},
      {"wedge", 8, Wedge},
      {"hexahedron", 9, Hexahedron},
      {"edge_3", 34, QuadraticEdge},
      {"quadrilateral_9", 35, BiquadraticQuad},
      {"triangle_6", 36, QuadraticTriangle},
      {"quadrilateral_8", 37, QuadraticQuad},
      {"tetrahedron_10", 38, QuadraticTetra},
      {"pyramid_13", 39, QuadraticPyramid},
      {"wedge_15", 40, QuadraticWedge},
      {"wedge_18", 41, BiquadraticQuadraticWedge},
      {"hexahedron_20", 48, QuadraticHexahedron},
      {"hexahedron_24", 49, BiquadraticQuadraticHexahedron},
      {"hexahedron_27", 50, TriquadraticHexahedron},
  };
  const auto found = std::ranges::find(kTopologies, number, &Topology::number);
  return found == std::end(kTopologies) ? nullptr : found;
}

/// The number of a topology by its name, long or short ("Tet_10"); 0 for none.
Index topology_number(std::string name) {
  constexpr std::pair<std::string_view, std::string_view> kShort[] = {{"tri_", "triangle_"},
                                                                      {"quad_", "quadrilateral_"},
                                                                      {"tet_", "tetrahedron_"},
                                                                      {"hex_", "hexahedron_"}};
  for (const auto& [from, to] : kShort)
    if (name.starts_with(from)) name.replace(0, from.size(), to);
  if (name == "polyvertex") return kPolyvertex;
  if (name == "polyline") return kPolyline;
  if (name == "polygon") return kPolygon;
  for (Index number = 4; number <= 50; ++number)
    if (const Topology* found = topology(number); found && found->name == name) return number;
  return 0;
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return text;
}

bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }

/// The text of an item: "mesh.h5:/points".
struct Reference {
  std::string file, dataset;
  std::uint64_t place = 0;  ///< of the file's name in the XML
};

/// Writes the XML and the HDF5 files that it names.
class XdmfCopier : public MeshCopier {
 public:
  SourceFile xml;
  std::vector<Reference> references;
  std::map<std::string, SourceFile> others;  ///< files without the coordinates
  std::string heavy;                         ///< the file with them; empty: the XML has them
  std::unique_ptr<const MeshCopier> copier;  ///< of the file with the coordinates

  /// A copy of another name has an HDF5 file of its own, called as the copy: several may lie in a
  /// folder, beside the original, too.
  void write(const fs::path& target, const Points& before, const Points& after) const override {
    check_target(target);
    for (const auto& [name, source] : others)
      if (const fs::path path = target.parent_path() / name; !are_one_file(path, source.path))
        write_unchanged(source, path);
    if (heavy.empty()) return copier->write(target, before, after);
    const std::string name = heavy_of(target);
    copier->write(target.parent_path() / name, before, after);
    if (name == heavy) return write_unchanged(xml, target);
    const FileBytes file = read_again(xml);
    const std::string_view bytes = file;
    std::string text;
    std::size_t at = 0;
    for (const Reference& reference : references) {
      if (reference.file != heavy) continue;
      text.append(bytes, at, reference.place - at);
      text += name;
      at = reference.place + heavy.size();
    }
    text.append(bytes, at);
    write_pieces(target, {text}, is_copy_compressed(xml, target));
  }

  Points readable(const Points& before, const Points& after) const override {
    return copier->readable(before, after);
  }

  void check_target(const fs::path& target) const override {
    for (const auto& [name, source] : others) {
      const fs::path path = target.parent_path() / name;
      if (fs::exists(path) && !are_one_file(path, source.path) &&
          (!fs::is_regular_file(path) || read_source(path).source.hash != source.hash))
        refuse(target, path);
    }
    if (heavy.empty() || fs::exists(target)) return;
    if (const fs::path path = target.parent_path() / heavy_of(target); fs::exists(path))
      refuse(target, path);
  }

 private:
  [[noreturn]] static void refuse(const fs::path& target, const fs::path& other) {
    throw InvalidInputError(target.string() +
                            " would need a file that is there already and not of it: " +
                            other.string() + "; remove that, or write to another name");
  }

  /// The HDF5 file with the coordinates of a copy.
  std::string heavy_of(const fs::path& target) const {
    if (target.filename() == xml.path.filename()) return heavy;
    std::string name = target.stem().string() + fs::path(heavy).extension().string();
    if (name == heavy || others.contains(name)) name = target.filename().string() + ".h5";
    return name;
  }
};

class Reader {
 public:
  explicit Reader(const fs::path& path) : path_(path), file_(read_source(path)) {
    const pugi::xml_parse_result parsed = xml_.load_buffer(
        file_.bytes.data(), text_.size(), pugi::parse_default, pugi::encoding_utf8);
    if (!parsed)
      fail_at(std::size_t(std::max<std::ptrdiff_t>(parsed.offset, 0)),
              std::string("the XML is damaged: ") + parsed.description());
  }

  ReadMesh run() {
    const pugi::xml_node grid = find_grid();
    collect_references(xml_);
    copier_ = std::make_unique<XdmfCopier>();
    read_geometry(child(grid, "Geometry"));
    read_topology(child(grid, "Topology"));
    copier_->xml = file_.source;
    copier_->references = references_;
    for (const Reference& reference : references_)
      if (reference.file != copier_->heavy && !copier_->others.contains(reference.file) &&
          !fs::path(reference.file).is_absolute())
        copier_->others[reference.file] = read_source(file_named(reference.file)).source;
    result_.copier = std::move(copier_);
    return std::move(result_);
  }

 private:
  [[noreturn]] void fail_at(std::size_t place, const std::string& why) const {
    TextScanner(text_, path_).fail_at(std::min(place, text_.size()), why);
  }
  [[noreturn]] void fail(const pugi::xml_node& node, const std::string& why) const {
    fail_at(std::size_t(std::max<std::ptrdiff_t>(node.offset_debug(), 0)), why);
  }

  pugi::xml_node child(const pugi::xml_node& parent, const char* name) const {
    const pugi::xml_node found = parent.child(name);
    if (!found) fail(parent, std::string(parent.name()) + " has no " + name);
    return found;
  }

  static std::string attribute(const pugi::xml_node& node,
                               std::initializer_list<const char*> names) {
    for (const char* name : names)
      if (const pugi::xml_attribute found = node.attribute(name)) return lower(found.value());
    return "";
  }

  pugi::xml_node find_grid() const {
    pugi::xml_node node = xml_.child("Xdmf").child("Domain");
    if (!node) fail(xml_, "there is no Xdmf with a Domain");
    do {
      Index count = 0;
      pugi::xml_node grid;
      for (const pugi::xml_node& each : node.children("Grid")) {
        if (count++ == 0) grid = each;
      }
      if (count != 1)
        fail(node, "expected one Grid, found " + std::to_string(count) +
                       "; write one part and one time step to a file of its own");
      node = grid;
    } while (attribute(node, {"GridType"}) == "collection" ||
             attribute(node, {"GridType"}) == "tree");
    return node;
  }

  // ---- items

  std::size_t text_place(const pugi::xml_node& item) const {
    const pugi::xml_node text = item.first_child();
    if (text.type() != pugi::node_pcdata || text.offset_debug() < 0)
      fail(item, "expected the text of a DataItem");
    return std::size_t(text.offset_debug());
  }

  static bool is_heavy(const pugi::xml_node& item) { return attribute(item, {"Format"}) == "hdf"; }

  Reference reference_of(const pugi::xml_node& item) const {
    std::size_t begin = text_place(item);
    while (begin < text_.size() && is_space(text_[begin])) ++begin;
    std::size_t end = std::min(text_.find('<', begin), text_.size());
    while (end > begin && is_space(text_[end - 1])) --end;
    const std::string_view text = text_.substr(begin, end - begin);
    const std::size_t colon = text.find(":/");
    if (colon == std::string::npos || colon == 0)
      fail_at(begin, "expected FILE:/DATASET, found '" + std::string(text) + "'");
    return {.file = std::string(text.substr(0, colon)),
            .dataset = std::string(text.substr(colon + 1)),
            .place = begin};
  }

  void collect_references(const pugi::xml_node& node) {
    for (const pugi::xml_node& each : node.children()) {
      if (std::string_view(each.name()) == "DataItem" && is_heavy(each))
        references_.push_back(reference_of(each));
      collect_references(each);
    }
  }

  fs::path file_named(const std::string& name) const { return path_.parent_path() / name; }

  const Hdf5File& heavy_file(const std::string& name) {
    const auto found = files_.find(name);
    return found != files_.end() ? found->second
                                 : files_.emplace(name, Hdf5File(file_named(name))).first->second;
  }

  /// The only item of a Topology or Geometry.
  pugi::xml_node item_of(const pugi::xml_node& node) const {
    const pugi::xml_node item = child(node, "DataItem");
    const std::string kind = attribute(item, {"ItemType"}), format = attribute(item, {"Format"});
    if (item.next_sibling("DataItem"))
      fail(node, "several DataItems are not read; write the values as one");
    if ((!kind.empty() && kind != "uniform") || item.attribute("Reference"))
      fail(item, "a DataItem that is computed or refers to another is not read");
    if (!format.empty() && format != "xml" && format != "hdf")
      fail(item, "a DataItem of format " + format + " is not read; write it as HDF or XML");
    return item;
  }

  TextScanner scanner_at(const pugi::xml_node& item) const {
    const std::size_t begin = text_place(item);
    const std::size_t end = std::min(text_.find('<', begin), text_.size());
    TextScanner scanner(text_.substr(0, end), path_);
    scanner.go_to(begin);
    return scanner;
  }

  std::vector<Index> integers(const pugi::xml_node& item) {
    if (is_heavy(item)) {
      const Reference reference = reference_of(item);
      return heavy_file(reference.file).integers(reference.dataset);
    }
    TextScanner in = scanner_at(item);
    std::vector<Index> values;
    while (in.skip_space()) values.push_back(in.integer("the number of a node"));
    return values;
  }

  // ---- geometry

  void read_geometry(const pugi::xml_node& geometry) {
    const std::string type = attribute(geometry, {"GeometryType", "Type"});
    if (!type.empty() && type != "xyz" && type != "xy")
      fail(geometry, "a geometry of type " + type + " is not read; write it as XYZ");
    components_ = type == "xy" ? 2 : 3;
    const pugi::xml_node item = item_of(geometry);
    if (is_heavy(item))
      read_heavy_points(item);
    else
      read_points(item);
  }

  void read_heavy_points(const pugi::xml_node& item) {
    const Reference reference = reference_of(item);
    if (fs::path(reference.file).has_parent_path())
      fail_at(reference.place, "the HDF5 file '" + reference.file +
                                   "' with the coordinates is in another folder; put it beside");
    const Hdf5File& file = heavy_file(reference.file);
    Index total = 1;
    for (const Index size : file.shape(reference.dataset)) total *= size;
    if (total % components_ != 0)
      file.fail(reference.dataset, std::to_string(total) + " numbers are no points of " +
                                       std::to_string(components_) + " coordinates");
    std::vector<Hdf5Run> runs;
    for (int c = 0; c < components_; ++c)
      runs.push_back({.dataset = reference.dataset,
                      .first = c,
                      .step = components_,
                      .count = total / components_,
                      .component = c});
    result_.mesh.points = Points::Zero(total / components_, 3);
    copier_->copier = read_hdf5_coordinates(file, runs, result_.mesh.points);
    copier_->heavy = reference.file;
  }

  void read_points(const pugi::xml_node& item) {
    TextScanner in = scanner_at(item);
    TextPlaces places{.components = components_, .tokens = {}};
    std::vector<double> values;
    while (in.skip_space())
      places.tokens.push_back(in.number("a coordinate", values.emplace_back()));
    if (std::ssize(values) % components_ != 0)
      fail(item, std::to_string(values.size()) + " numbers are no points of " +
                     std::to_string(components_) + " coordinates");
    const Index nodes = std::ssize(values) / components_;
    result_.mesh.points = Points::Zero(nodes, 3);
    for (Index n = 0; n < nodes; ++n)
      for (int c = 0; c < components_; ++c)
        result_.mesh.points(n, c) = values[std::size_t(n * components_ + c)];
    copier_->copier = make_copier(file_.source, std::move(places));
  }

  // ---- topology

  void read_topology(const pugi::xml_node& node) {
    const std::string type = attribute(node, {"TopologyType", "Type"});
    const std::string base = attribute(node, {"BaseOffset"});
    if (node.attribute("Order") || (!base.empty() && base != "0"))
      fail(node, "a topology with Order or BaseOffset is not read");
    const std::vector<Index> values = integers(item_of(node));
    if (type == "mixed") return read_mixed(node, values);
    const Index number = topology_number(type);
    if (number == 0) fail(node, "a topology of type '" + type + "' is not known");
    Index size = number > kPolygon ? cell_node_count(topology(number)->type)
                                   : node.attribute("NodesPerElement").as_llong(0);
    if (number == kPolyvertex && size == 0) size = 1;
    if (size < 1 || std::ssize(values) % size != 0)
      fail(node, std::to_string(values.size()) + " node numbers are no elements of " +
                     std::to_string(size) + " nodes");
    reserve_cells(result_.mesh, std::ssize(values) / size, std::ssize(values));
    for (std::size_t at = 0; at < values.size(); at += std::size_t(size))
      add_element(node, number, std::span(values).subspan(at, std::size_t(size)));
  }

  void read_mixed(const pugi::xml_node& node, const std::vector<Index>& values) {
    for (std::size_t at = 0; at < values.size();) {
      const std::size_t begin = at;
      const Index number = values[at++];
      Index size = 0;
      if (number >= kPolyvertex && number <= kPolygon)
        size = at < values.size() ? values[at++] : -1;
      else if (const Topology* found = topology(number))
        size = cell_node_count(found->type);
      else
        fail(node, "element type " + std::to_string(number) + " at position " +
                       std::to_string(begin) + " of the topology is not known");
      if (size < 1 || size > std::ssize(values) - std::ssize(std::span(values).first(at)))
        fail(node, "the element at position " + std::to_string(begin) +
                       " of the topology has more nodes than follow");
      add_element(node, number, std::span(values).subspan(at, std::size_t(size)));
      at += std::size_t(size);
    }
  }

  void add_element(const pugi::xml_node& node, Index number, std::span<const Index> nodes) {
    for (const Index n : nodes)
      if (n < 0 || n >= result_.mesh.node_count())
        fail(node, "node " + std::to_string(n) + " is used, but there are " +
                       std::to_string(result_.mesh.node_count()) + " points");
    CellType type = Polygon;
    if (number == kPolyvertex)
      type = nodes.size() == 1 ? Vertex : PolyVertex;
    else if (number == kPolyline)
      type = nodes.size() == 2 ? Line : PolyLine;
    else if (number != kPolygon)
      type = topology(number)->type;
    add_cell(result_.mesh, type, nodes);
  }

  fs::path path_;
  SourceBytes file_;
  std::string_view text_ = file_.bytes;
  pugi::xml_document xml_;
  ReadMesh result_;
  std::unique_ptr<XdmfCopier> copier_;
  std::vector<Reference> references_;
  std::map<std::string, Hdf5File> files_;
  int components_ = 3;
};

Recognition recognise(const FileStart& start) {
  return start.bytes.substr(0, 4096).find("<Xdmf") != std::string::npos ? Recognition::Sure
                                                                        : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  try {
    return Reader(path).run();
  } catch (const IoError& error) {
    const std::string text = error.what();
    if (text.find(path.string()) != std::string::npos) throw;
    fail_reading(path, text);  // of an HDF5 file that it names
  }
}

}  // namespace

const MeshFormat& xdmf_format() {
  static const MeshFormat format{
      .name = "XDMF", .extensions = {".xdmf", ".xmf"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
