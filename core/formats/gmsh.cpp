#include <algorithm>
#include <array>
#include <map>
#include <span>
#include <utility>

#include "core/errors.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/formats.h"
#include "core/formats/gmsh_elements.h"
#include "core/formats/number_input.h"
#include "core/formats/number_table.h"
#include "core/formats/periodic_links.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

// Bytes of int and size_t in binary files, those of 64-bit systems.
constexpr int kIntSize = 4, kSizeSize = 8;
constexpr Index kUsual = 4;  // nodes of a cell: most are tetrahedra

/// What the elements are whose numbers are known but that can't be read.
std::string other_kind(Index number) {
  struct Range {
    Index first, last;
    const char* name;
  };
  constexpr Range kOthers[] = {
      {20, 25, "a triangle of order 3 to 5"},
      {26, 28, "a line of order 3 to 5"},
      {29, 31, "a tetrahedron of order 3 to 5"},
      {32, 33, "a tetrahedron of order 4 or 5 without all its nodes"},
      {34, 34, "a polygon"},
      {35, 35, "a polyhedron"},
      {36, 41, "a quadrangle of order 3 or more"},
      {42, 46, "a triangle of order 6 or more"},
      {47, 51, "a quadrangle of order 6 or more"},
      {52, 56, "a triangle of order 6 or more"},
      {62, 66, "a line of order 6 or more"},
      {71, 75, "a tetrahedron of order 6 or more"},
      {90, 91, "a prism of order 3 or 4"},
      {92, 98, "a hexahedron of order 3 or more"},
      {106, 110, "a prism of order 5 or more"},
      {118, 124, "a pyramid of order 3 or more"},
  };
  for (const Range& range : kOthers)
    if (number >= range.first && number <= range.last) return range.name;
  return "of a kind that is not known";
}

/// The numbers of a file that is text or, between the words that begin and end its sections,
/// binary.
class Input : public NumberInput {
 public:
  using NumberInput::NumberInput;

  /// From the word that begins a section to its numbers.
  void begin_numbers() {
    text().skip_line();
    bytes().go_to(text().place());
  }
  void end_numbers() {
    if (is_binary()) text().go_to(bytes().place());
  }

  using NumberInput::integer;
  Index integer(std::string_view what) { return integer(what, kIntSize); }
  Index size(std::string_view what) { return integer(what, kSizeSize); }
  void skip_doubles(int count) {
    if (is_binary()) return bytes().skip("a coordinate", std::uint64_t(count) * sizeof(double));
    for (int i = 0; i < count; ++i) text().number("a coordinate");
  }
};

using EntityKey = std::pair<int, Index>;  ///< dimension, tag

struct Entity {
  Index region = 0;
  std::vector<Index> physical;  ///< tags of its physical groups
};

class Reader {
 public:
  Reader(std::string_view bytes, const fs::path& path) : path_(path), in_(bytes, path) {}

  ReadMesh run(SourceFile source) {
    read_format();
    TextScanner& text = in_.text();
    while (text.skip_space()) {
      const std::size_t place = text.place();
      const std::string_view name = text.word("a section");
      if (!name.starts_with('$')) {
        text.go_to(place);
        text.fail_expected("a section ($...)");
      }
      read_section(name.substr(1), place);
    }
    if (!has_nodes_) text.fail("there are no nodes ($Nodes)");
    if (!has_elements_) text.fail("there are no elements ($Elements)");
    finish();
    result_.copier = make_copier(std::move(source), places());
    return std::move(result_);
  }

 private:
  bool is_version_4() const { return version_ >= 4; }

  void read_format() {
    TextScanner& text = in_.text();
    while (true) {
      if (!text.skip_space()) text.fail_expected("$MeshFormat");
      const std::size_t place = text.place();
      const std::string_view word = text.word("$MeshFormat");
      if (word == "$MeshFormat") break;
      if (word == "$NOD")
        text.fail_at(
            place, "it is of gmsh's format 1; save it anew: gmsh FILE -save -format msh41 -o NEW");
      skip_section(word.substr(1), place);
    }
    text.skip_space();
    const std::size_t place = text.place();
    version_ = text.number("the version of the format");
    const Index type = text.index("the file type", 0, 2);
    const Index data_size = text.integer("the size of the numbers");
    const bool is_known = (version_ >= 2 && version_ < 2.3) || version_ == 4.1;
    if (!is_known)
      text.fail_at(place,
                   "its format is not one of 2.0 to 2.2 and 4.1; save it anew: gmsh FILE "
                   "-save -format msh41 -o NEW");
    if (data_size != 8) text.fail_at(place, "the size of its numbers is not 8 bytes");
    if (type == 1) {
      in_.begin_numbers();
      in_.set_binary();
      ByteScanner& bytes = in_.bytes();
      const std::size_t one_place = bytes.place();
      bytes.set_big_endian(false);
      if (bytes.int32("the number one") != 1) {
        bytes.go_to(one_place);
        bytes.set_big_endian(true);
        if (bytes.int32("the number one") != 1)
          bytes.fail_at(one_place, "expected the number one, which tells the order of bytes");
      }
      in_.end_numbers();
    }
    end_section("MeshFormat");
  }

  void end_section(const std::string& name) {
    in_.end_numbers();
    TextScanner& text = in_.text();
    const bool is_there = text.skip_space();
    const std::size_t place = text.place();
    if (is_there && text.word("") == "$End" + name) return;
    text.go_to(place);
    text.fail_expected("$End" + name);
  }

  void skip_section(std::string_view name, std::size_t begin) {
    TextScanner& text = in_.text();
    const std::string end = "$End" + std::string(name);
    const std::size_t place = text.text().find(end, text.place());
    if (place == std::string_view::npos)
      text.fail_at(begin, "the section $" + std::string(name.substr(0, 40)) + " has no " +
                              end.substr(0, 44) + ": the file is cut off");
    text.go_to(place + end.size());
  }

  void read_section(std::string_view name, std::size_t place) {
    if (name == "PhysicalNames") return read_physical_names();
    const bool is_nodes = name == "Nodes" || (name == "ParametricNodes" && !is_version_4());
    if (is_nodes || name == "Elements") {
      bool& has_section = is_nodes ? has_nodes_ : has_elements_;
      if (has_section) in_.text().fail_at(place, "there is a second section $" + std::string(name));
      has_section = true;
      in_.begin_numbers();
      if (is_nodes)
        is_version_4() ? read_node_blocks() : read_nodes(name == "ParametricNodes");
      else
        read_elements();
      return end_section(std::string(name));
    }
    if (is_version_4() && (name == "Entities" || name == "PartitionedEntities")) {
      in_.begin_numbers();
      read_entities(name == "PartitionedEntities");
      return end_section(std::string(name));
    }
    if (name == "Periodic") return read_periodic(place);
    if (name == "Parametrizations") has_parametrizations_ = true;
    skip_section(name, place);
  }

  void read_physical_names() {
    TextScanner& text = in_.text();
    const Index count = text.count("the number of physical names", 5);
    for (Index i = 0; i < count; ++i) {
      const int dimension = int(text.index("the dimension of a physical group", 0, 4));
      const Index tag = text.integer("the tag of a physical group");
      text.skip_space();
      const std::string_view line = text.line();
      const std::size_t first = line.find('"'), last = line.rfind('"');
      if (first == std::string_view::npos || last == first)
        text.fail("expected the name of a physical group in quotes");
      groups_[{dimension, tag}].name = line.substr(first + 1, last - first - 1);
      group_order_.push_back({dimension, tag});
      named_volumes_ += dimension == 3;
    }
    text.skip_space();
    const std::size_t place = text.place();
    if (text.word("$EndPhysicalNames") != "$EndPhysicalNames") {
      text.go_to(place);
      text.fail_expected("$EndPhysicalNames");
    }
  }

  void read_entities(bool is_partitioned) {
    if (is_partitioned) {
      in_.size("the number of partitions");
      const Index ghosts = in_.count("the number of ghost entities", kSizeSize, 8, 2);
      for (Index i = 0; i < ghosts; ++i) {
        in_.integer("the tag of a ghost entity");
        in_.integer("the partition of a ghost entity");
      }
    }
    std::array<Index, 4> counts{};
    for (Index& count : counts) count = in_.count("a number of entities", kSizeSize, 4, 2);
    for (int dimension = 0; dimension < 4; ++dimension)
      for (Index i = 0; i < counts[std::size_t(dimension)]; ++i)
        read_entity(dimension, is_partitioned);
  }

  void read_entity(int dimension, bool is_partitioned) {
    const Index tag = in_.integer("the tag of an entity");
    Entity entity{.region = tag, .physical = {}};
    bool has_parent = true;
    if (is_partitioned) {
      const Index parent_dimension = in_.integer("the dimension of an entity's parent");
      const Index parent = in_.integer("the tag of an entity's parent");
      // No regions or groups of partitions: there is no face of the CAD between them.
      has_parent = parent_dimension == dimension;
      if (has_parent) entity.region = parent;
      skip_integers("partitions of an entity");
    }
    in_.skip_doubles(dimension == 0 ? 3 : 6);
    const Index count = in_.count("the number of an entity's physical groups", kSizeSize, 4, 2);
    for (Index i = 0; i < count; ++i)
      entity.physical.push_back(std::abs(in_.integer("the tag of a physical group")));
    if (!has_parent) entity.physical.clear();
    if (dimension > 0) skip_integers("entities that bound an entity");
    entities_[{dimension, tag}] = std::move(entity);
  }

  /// Which curve or surface is the image of which other, and their nodes. What other programs write
  /// otherwise is passed over.
  void read_periodic(std::size_t place) {
    has_periodic_ = true;
    const std::size_t begin = in_.text().place();
    try {
      // Files of version 2 have text here, whatever the rest is.
      NumberInput text(in_.text().text(), path_);
      text.text().go_to(begin);
      if (is_version_4()) in_.begin_numbers();
      NumberInput& in = is_version_4() ? in_ : text;
      const int size = is_version_4() ? kSizeSize : kIntSize;
      std::vector<std::pair<Index, PeriodicLink>> links;
      const Index count = in.count("the number of periodic entities", size, 24, 8);
      for (Index i = 0; i < count; ++i) {
        const Index dimension = in.integer("the dimension of a periodic entity", kIntSize);
        in.integer("the tag of a periodic entity", kIntSize);
        in.integer("the tag of the entity that it is the image of", kIntSize);
        skip_affine_map(in);
        links.emplace_back(dimension, read_link(in, size));
      }
      links_ = std::move(links);
      in_.text().go_to(in.position());
    } catch (const IoError&) {
      in_.text().go_to(begin);
    }
    skip_section("Periodic", place);
  }

  void skip_affine_map(NumberInput& in) {
    if (is_version_4()) {
      const Index count = in.count("the size of an affine map", kSizeSize, 8, 2);
      for (Index i = 0; i < count; ++i)
        in.is_binary() ? in.bytes().skip("an affine map", sizeof(double))
                       : void(in.text().number("an affine map"));
      return;
    }
    const std::size_t place = in.place();
    if (in.text().word("an affine map") == "Affine")
      in.text().skip_line();
    else
      in.text().go_to(place);
  }

  PeriodicLink read_link(NumberInput& in, int size) {
    PeriodicLink link;
    const Index count = in.count("the number of a periodic entity's nodes", size, 16, 4);
    for (Index i = 0; i < count; ++i) {
      const Index node = node_numbers_.find(in.integer("the number of a node", size));
      const Index image = node_numbers_.find(in.integer("the number of a node", size));
      if (node < 0 || image < 0) in.fail("a periodic node is not among the nodes");
      link.emplace_back(node, image);
    }
    return link;
  }

  void skip_integers(const std::string& what) {
    const Index count = in_.count("the number of " + what, kSizeSize, 4, 2);
    for (Index i = 0; i < count; ++i) in_.integer(what);
  }

  void read_nodes(bool is_parametric) {
    const Index count = in_.text().count("the number of nodes", 8);
    in_.begin_numbers();
    reserve_nodes(count);
    if (!in_.is_binary() || is_parametric) {
      for (Index i = 0; i < count; ++i) {
        numbers_.push_back(in_.integer("the number of a node"));
        read_point();
        if (!is_parametric) continue;
        const Index dimension = in_.integer("the dimension of a node's entity");
        in_.integer("the tag of a node's entity");
        if (dimension == 1 || dimension == 2) in_.skip_doubles(int(dimension));
        has_parameters_ = true;
      }
    } else if (count > 0) {
      constexpr int kStride = kIntSize + 3 * sizeof(double);  // a node: its tag, coordinates
      add_runs(in_.bytes().place() + kIntSize, kStride, count);
      for (Index i = 0; i < count; ++i) {
        numbers_.push_back(in_.integer("the number of a node"));
        in_.skip_doubles(3);
      }
    }
    end_nodes();
  }

  void read_node_blocks() {
    const Index blocks = in_.count("the number of blocks of nodes", kSizeSize, 20, 8);
    const std::size_t place = in_.place();
    const Index total = in_.count("the number of nodes", kSizeSize, 32, 8);
    in_.size("the least number of a node");
    in_.size("the largest number of a node");
    reserve_nodes(total);
    for (Index block = 0; block < blocks; ++block) {
      const Index dimension = in_.integer("the dimension of an entity");
      in_.integer("the tag of an entity");
      const bool is_parametric = in_.integer("the flag of parametric nodes") != 0;
      const int parameters = is_parametric && dimension > 0 && dimension < 4 ? int(dimension) : 0;
      const Index count = in_.count("the number of nodes of a block", kSizeSize, 32, 8);
      if (parameters > 0) has_parameters_ = true;
      for (Index i = 0; i < count; ++i) numbers_.push_back(in_.size("the number of a node"));
      if (in_.is_binary() && count > 0) {
        const int stride = (3 + parameters) * int(sizeof(double));
        add_runs(in_.bytes().place(), stride, count);
        in_.bytes().skip("coordinates", std::uint64_t(count) * std::uint64_t(stride));
      } else {
        for (Index i = 0; i < count; ++i) {
          read_point();
          in_.skip_doubles(parameters);
        }
      }
    }
    if (std::ssize(numbers_) != total)
      in_.fail_at(place, "the number of nodes is " + std::to_string(total) + ", but there are " +
                             std::to_string(numbers_.size()));
    end_nodes();
  }

  void reserve_nodes(Index count) {
    numbers_.reserve(std::size_t(count));
    if (in_.is_binary()) return;
    points_.reserve(3 * std::size_t(count));
    text_places_.tokens.reserve(3 * std::size_t(count));
  }

  /// A node's coordinates in a text (or, number by number, among others in a binary file).
  void read_point() {
    if (in_.is_binary()) {
      add_runs(in_.bytes().place(), 3 * sizeof(double), 1);
      return in_.skip_doubles(3);
    }
    for (int c = 0; c < 3; ++c) {
      double value = 0;
      text_places_.tokens.push_back(in_.text().number("a coordinate", value));
      points_.push_back(value);
    }
  }

  /// The coordinates of `count` nodes, the next in order.
  void add_runs(std::size_t place, int stride, Index count) {
    for (int c = 0; c < 3; ++c)
      binary_places_.runs.push_back({.place = place + std::size_t(c) * sizeof(double),
                                     .stride = std::uint64_t(stride),
                                     .count = count,
                                     .component = c,
                                     .is_big_endian = in_.bytes().is_big_endian(),
                                     .first_node = run_nodes_});
    run_nodes_ += count;
  }

  void end_nodes() {
    node_numbers_ = NumberTable(numbers_);
    if (const Index row = node_numbers_.double_item(); row >= 0)
      in_.fail("there are two nodes with the number " + std::to_string(numbers_[std::size_t(row)]));
  }

  void read_elements() {
    if (!has_nodes_) in_.fail("there are elements before the nodes");
    if (is_version_4())
      read_element_blocks();
    else
      read_old_elements();
  }

  const GmshElement& kind_of(Index number, std::size_t place) const {
    if (number < 1 || number > std::ssize(kGmshElements))
      in_.fail_at(place, "an element of type " + std::to_string(number) + " is " +
                             other_kind(number) +
                             "; only those of first and second order are read: set "
                             "Mesh.ElementOrder to 1 or 2 and mesh again");
    return kGmshElements[number - 1];
  }

  void read_element_nodes(const GmshElement& kind, int size) {
    for (int i = 0; i < kind.nodes; ++i) {
      const std::size_t place = in_.place();
      const Index number = in_.integer("the number of a node", size);
      const Index row = node_numbers_.find(number);
      if (row < 0)
        in_.fail_at(place, "an element has the node " + std::to_string(number) +
                               ", which is not among the nodes");
      file_nodes_[std::size_t(i)] = row;
    }
  }

  /// Adds the element read last as a cell; false when it repeats the one before: a file of version
  /// 2 lists an element of several physical groups once for each of them.
  bool add_element(Index number, const GmshElement& kind, Index entity) {
    const auto end = file_nodes_.begin() + kind.nodes;
    if (last_kind_ == &kind && last_entity_ == entity &&
        std::equal(file_nodes_.begin(), end, last_nodes_.begin())) {
      ++repeated_;
      return false;
    }
    last_kind_ = &kind;
    last_entity_ = entity;
    std::copy(file_nodes_.begin(), end, last_nodes_.begin());
    for (int i = 0; i < kind.nodes; ++i)
      nodes_[std::size_t(i)] = file_nodes_[kind.order[std::size_t(i)]];
    add_cell(result_.mesh, kind.type, std::span(nodes_).first(std::size_t(kind.nodes)));
    result_.mesh.regions.push_back(int(entity));
    result_.mesh.cell_numbers.push_back(number);
    return true;
  }

  void add_to_group(int dimension, Index tag, const GmshElement& kind) {
    if (tag == 0) return;
    if (dimension == 3) return add_to_zone(tag, kind);
    if (!last_group_ || last_key_ != EntityKey{dimension, tag}) {
      last_key_ = {dimension, tag};
      const auto [entry, is_new] = groups_.try_emplace(last_key_);
      last_group_ = &entry->second;
      if (is_new) group_order_.push_back(last_key_);
    }
    last_group_->nodes.insert(last_group_->nodes.end(), file_nodes_.begin(),
                              file_nodes_.begin() + kind.nodes);
  }

  // Volumes are regions; where several have names they are named parts, too.
  void add_to_zone(Index tag, const GmshElement& kind) {
    if (named_volumes_ < 2) return;
    Group& zone = groups_[{3, tag}];
    if (zone.name.empty()) return;
    zone.is_in.resize(numbers_.size(), 0);
    for (const Index node : std::span(file_nodes_).first(std::size_t(kind.nodes)))
      zone.is_in[std::size_t(node)] = 1;
  }

  void read_element_blocks() {
    const Index blocks = in_.count("the number of blocks of elements", kSizeSize, 20, 8);
    const std::size_t place = in_.place();
    const Index total = in_.count("the number of elements", kSizeSize, 16, 4);
    in_.size("the least number of an element");
    in_.size("the largest number of an element");
    reserve_cells(result_.mesh, total, kUsual * total);
    Index read = 0;
    for (Index block = 0; block < blocks; ++block) {
      const int dimension = int(in_.integer("the dimension of an entity"));
      const Index tag = in_.integer("the tag of an entity");
      const std::size_t type_place = in_.place();
      const GmshElement& kind = kind_of(in_.integer("an element type"), type_place);
      const Index count = in_.count("the number of elements of a block", kSizeSize, 16, 4);
      const auto found = entities_.find({dimension, tag});
      const Entity entity =
          found != entities_.end() ? found->second : Entity{.region = tag, .physical = {}};
      for (Index i = 0; i < count; ++i) {
        const Index number = in_.size("the number of an element");
        read_element_nodes(kind, kSizeSize);
        add_element(number, kind, entity.region);
        for (const Index physical : entity.physical) add_to_group(dimension, physical, kind);
      }
      read += count;
    }
    if (read != total)
      in_.fail_at(place, "the number of elements is " + std::to_string(total) + ", but there are " +
                             std::to_string(read));
  }

  void read_old_elements() {
    const Index count = in_.text().count("the number of elements", 8);
    in_.begin_numbers();
    reserve_cells(result_.mesh, count, kUsual * count);
    if (!in_.is_binary()) {
      for (Index i = 0; i < count; ++i) {
        const Index number = in_.integer("the number of an element");
        const std::size_t place = in_.place();
        const GmshElement& kind = kind_of(in_.integer("an element type"), place);
        read_old_element(number, kind, in_.text().count("the number of an element's tags"));
      }
      return;
    }
    for (Index read = 0; read < count;) {
      const std::size_t place = in_.place();
      const GmshElement& kind = kind_of(in_.integer("an element type"), place);
      const Index follow = in_.count("the number of elements that follow", kIntSize, 8, 1);
      const Index tags = in_.count("the number of an element's tags", kIntSize, 4, 1);
      if (follow < 1 || follow > count - read)
        in_.fail_at(place, "expected a number of elements from 1 to " +
                               std::to_string(count - read) + ", found " + std::to_string(follow));
      for (Index i = 0; i < follow; ++i) {
        const Index number = in_.integer("the number of an element");
        read_old_element(number, kind, tags);
      }
      read += follow;
    }
  }

  void read_old_element(Index number, const GmshElement& kind, Index tags) {
    Index physical = 0, elementary = 0;
    for (Index i = 0; i < tags; ++i) {
      const Index tag = in_.integer("a tag of an element");
      if (i == 0) physical = std::abs(tag);
      if (i == 1) elementary = tag;
    }
    read_element_nodes(kind, kIntSize);
    if (add_element(number, kind, elementary)) physical_.push_back(physical);
    add_to_group(dimension(kind.type), physical, kind);
  }

  void finish() {
    Mesh& mesh = result_.mesh;
    if (in_.is_binary()) {
      mesh.points.resize(run_nodes_, 3);
      read_runs(in_.text().text(), binary_places_, path_, mesh.points);
    } else {
      mesh.points = Eigen::Map<const Points>(points_.data(), std::ssize(points_) / 3, 3);
    }
    for (const Index number : numbers_) mesh.node_numbers.push_back(number);
    set_regions();
    set_groups();
    add_remarks();
  }

  /// Regions are the elementary entities; where files of other programs have them all alike, the
  /// physical groups.
  void set_regions() {
    Mesh& mesh = result_.mesh;
    mesh.region_array = "elementary entity";
    const int highest = dimension(mesh);
    std::map<std::vector<Index>, int> zones;
    for (const auto& [key, entity] : entities_)
      if (key.first == highest)
        mesh.zone_of_block[int(entity.region)] =
            zones.try_emplace(entity.physical, int(zones.size())).first->second;
    std::map<int, Index> physical_of;
    for (std::size_t c = 0; c < physical_.size(); ++c) {
      if (dimension(mesh.types[c]) != highest) continue;
      const auto [entry, is_new] = physical_of.try_emplace(mesh.regions[c], physical_[c]);
      mesh.zone_of_block[mesh.regions[c]] = int(physical_[c]);
      if (is_new || entry->second == physical_[c]) continue;
      mesh.region_array = "physical group";
      mesh.zone_of_block.clear();
      mesh.regions.assign(physical_.begin(), physical_.end());
      return;
    }
  }

  void set_groups() {
    constexpr const char* kDimensions[] = {"point", "curve", "surface", "volume"};
    Mesh& mesh = result_.mesh;
    const int highest = dimension(mesh);
    for (const EntityKey& key : group_order_) {
      Group& group = groups_[key];
      const auto [group_dimension, tag] = key;
      for (Index n = 0; n < std::ssize(group.is_in); ++n)
        if (group.is_in[std::size_t(n)]) group.nodes.push_back(n);
      group.is_in.clear();
      if (group_dimension > highest || group.nodes.empty()) continue;
      if (group.name.empty())
        group.name =
            "physical " + std::string(kDimensions[group_dimension]) + " " + std::to_string(tag);
      mesh.groups.push_back({.name = std::move(group.name),
                             .kind = "physical group",
                             .nodes = std::move(group.nodes)});
      group.nodes.clear();
    }
    tidy_groups(mesh);
    std::vector<PeriodicLink> sides;
    for (auto& [link_dimension, link] : links_)
      if (link_dimension == highest - 1) sides.push_back(std::move(link));
    set_partners(sides, mesh);
  }

  void add_remarks() {
    const auto remark = [&](const std::string& text) { result_.remarks.push_back(text); };
    if (has_parameters_)
      remark("the parametric coordinates (u, v) of nodes in $Nodes are those of the base");
    if (!entities_.empty())
      result_.notes.push_back(
          "the points and boxes of entities in $Entities are those of the base");
    if (has_parametrizations_) remark("$Parametrizations are those of the base");
    const bool has_pairs = std::ranges::any_of(
        result_.mesh.groups, [](const NodeGroup& group) { return !group.partner.empty(); });
    if (has_periodic_ && has_pairs)
      result_.notes.push_back("the affine maps in $Periodic are those of the base");
    else if (has_periodic_)
      remark(
          "the periodic maps in $Periodic are those of the base: check that periodic faces still "
          "match");
    if (repeated_ > 0)
      remark(std::to_string(repeated_) +
             " elements that the file repeats, for further physical groups, were taken once");
  }

  CoordinatePlaces places() {
    if (in_.is_binary()) return std::move(binary_places_);
    return std::move(text_places_);
  }

  struct Group {
    std::string name;
    std::vector<Index> nodes;
    std::vector<char> is_in = {};  ///< of a volume: marks its nodes
  };

  const fs::path& path_;
  Input in_;
  ReadMesh result_;
  double version_ = 0;
  bool has_nodes_ = false, has_elements_ = false;

  std::vector<Index> numbers_;  ///< of the nodes
  NumberTable node_numbers_;
  std::vector<double> points_;  ///< of a text
  TextPlaces text_places_;
  BinaryPlaces binary_places_;
  Index run_nodes_ = 0;

  std::map<EntityKey, Entity> entities_;
  std::map<EntityKey, Group> groups_;
  std::vector<EntityKey> group_order_;
  std::vector<std::pair<Index, PeriodicLink>> links_;  ///< with their dimensions
  int named_volumes_ = 0;
  Group* last_group_ = nullptr;
  EntityKey last_key_;

  std::array<Index, 27> file_nodes_{}, nodes_{};  ///< of an element, in gmsh's and VTK's order
  const GmshElement* last_kind_ = nullptr;        ///< of the cell added last
  Index last_entity_ = 0;
  std::array<Index, 27> last_nodes_{};
  std::vector<Index> physical_;  ///< of each cell, in files of version 2

  bool has_parameters_ = false, has_periodic_ = false, has_parametrizations_ = false;
  Index repeated_ = 0;
};

Recognition recognise(const FileStart& start) {
  const std::size_t first = start.bytes.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return Recognition::No;
  const std::string_view text = std::string_view(start.bytes).substr(first);
  const bool is_gmsh =
      text.starts_with("$MeshFormat") || text.starts_with("$NOD") ||
      (text.starts_with("$Comments") && text.find("$MeshFormat") != std::string_view::npos);
  return is_gmsh ? Recognition::Sure : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  SourceBytes file = read_source(path);
  return Reader(file.bytes, path).run(std::move(file.source));
}

}  // namespace

const MeshFormat& gmsh_format() {
  static const MeshFormat format{
      .name = "gmsh", .extensions = {".msh"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
