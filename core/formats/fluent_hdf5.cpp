#include <algorithm>
#include <limits>
#include <optional>
#include <sstream>

#include "core/formats/fluent/fluent_mesh.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5_coordinates.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

const std::string kMesh = "/meshes/1";

/// A part of the faces or nodes: "/meshes/1/faces/c0/1", with its first and last number.
struct Section {
  std::string object;
  Index first = 0, count = 0;
};

class Reader {
 public:
  explicit Reader(const fs::path& path) : file_(path) {}

  ReadMesh run() {
    mesh_.dimension = int(number(kMesh, "dimension"));
    if (mesh_.dimension != 2 && mesh_.dimension != 3)
      file_.fail(kMesh, "its dimension is " + std::to_string(mesh_.dimension) + ", not 2 or 3");
    ReadMesh result;
    result.copier = read_nodes();
    read_faces();
    mesh_.face_zones = read_zones("faces", "zoneType", mesh_.faces.count());
    mesh_.cell_zones = read_zones("cells", "zoneType", number(kMesh, "cellCount"));
    result.mesh = to_mesh(std::move(mesh_), file_.path());
    return result;
  }

 private:
  Index number(const std::string& object, const std::string& attribute) const {
    const std::vector<Index> values = file_.integer_attribute(object, attribute);
    if (values.size() != 1) file_.fail(object, "its attribute '" + attribute + "' is no number");
    return values[0];
  }

  std::vector<Section> sections(const std::string& group) const {
    std::vector<Section> result;
    for (const std::string& name : file_.children(group)) {
      const std::string object = group + "/" + name;
      if (!file_.has_attribute(object, "minId")) continue;  // no part of it
      const Index first = number(object, "minId"), last = number(object, "maxId");
      constexpr Index kMost = Index{1} << 40;  // keeps sums from overflowing
      if (first < 1 || last < first - 1 || last > kMost)
        file_.fail(object, "minId and maxId, " + std::to_string(first) + " and " +
                               std::to_string(last) + ", make no range");
      result.push_back({object, first, last - first + 1});
    }
    std::ranges::sort(result, {}, &Section::first);
    return result;
  }

  /// Throws unless the sections hold each number from 1 once; returns how many they are.
  Index check_complete(const std::vector<Section>& parts, const std::string& group) const {
    Index next = 1;
    for (const Section& part : parts) {
      if (part.first != next)
        file_.fail(group, "expected a section that begins at " + std::to_string(next) +
                              ", found one at " + std::to_string(part.first));
      next += part.count;
    }
    return next - 1;
  }

  void check_size(const std::string& object, Index found, Index wanted) const {
    if (found != wanted)
      file_.fail(object,
                 "it has " + std::to_string(found) + " numbers, not " + std::to_string(wanted));
  }

  std::unique_ptr<const MeshCopier> read_nodes() {
    const std::string group = kMesh + "/nodes/coords";
    const std::vector<Section> parts = sections(group);
    const Index count = check_complete(parts, group);
    std::vector<Hdf5Run> runs;
    Index listed = 0;
    for (const Section& part : parts) {
      Index numbers = 1;
      for (const Index size : file_.shape(part.object)) numbers *= size;
      check_size(part.object, numbers, part.count * mesh_.dimension);
      listed += numbers / mesh_.dimension;
      for (int c = 0; c < mesh_.dimension; ++c)
        runs.push_back({.dataset = part.object,
                        .first = c,
                        .step = mesh_.dimension,
                        .count = part.count,
                        .component = c,
                        .first_node = part.first - 1});
    }
    if (listed != count) file_.fail(group, "it does not hold all nodes");
    mesh_.points = Points::Zero(count, 3);
    return read_hdf5_coordinates(file_, runs, mesh_.points);
  }

  /// The cells on one side of the faces; those of the last faces, without one, may be missing.
  std::vector<Index> read_side(const std::string& name, Index faces) const {
    const std::string group = kMesh + "/faces/" + name;
    std::vector<Index> cells(std::size_t(faces), 0);
    for (const Section& part : sections(group)) {
      const std::vector<Index> values = file_.integers(part.object);
      check_size(part.object, std::ssize(values), part.count);
      if (part.first - 1 + part.count > faces)
        file_.fail(part.object, "it reaches beyond the " + std::to_string(faces) + " faces");
      if (std::ranges::any_of(values, [](Index cell) { return cell < 0; }))
        file_.fail(part.object, "it has a negative number of a cell");
      std::ranges::copy(values, cells.begin() + (part.first - 1));
    }
    return cells;
  }

  void read_faces() {
    const std::string group = kMesh + "/faces/nodes";
    const std::vector<Section> parts = sections(group);
    std::vector<std::vector<Index>> sizes, nodes;
    for (const Section& part : parts) {
      sizes.push_back(file_.integers(part.object + "/nnodes"));
      nodes.push_back(file_.integers(part.object + "/nodes"));
      check_size(part.object + "/nnodes", std::ssize(sizes.back()), part.count);
    }
    const Index count = check_complete(parts, group);
    const std::vector<Index> c0 = read_side("c0", count), c1 = read_side("c1", count);
    Index f = 0;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      for (Index& node : nodes[p]) --node;
      auto rest = std::span<const Index>(nodes[p]);
      for (const Index size : sizes[p]) {
        if (size < mesh_.dimension || size > std::ssize(rest))
          file_.fail(parts[p].object, "face " + std::to_string(f + 1) + " has " +
                                          std::to_string(size) + " nodes; " +
                                          std::to_string(rest.size()) + " are left");
        mesh_.add_face(rest.first(std::size_t(size)), c0[f], c1[f]);
        rest = rest.subspan(std::size_t(size));
        ++f;
      }
      check_size(parts[p].object + "/nodes", std::ssize(nodes[p]),
                 std::ssize(nodes[p]) - std::ssize(rest));
    }
  }

  std::vector<FluentZone> read_zones(const std::string& what, const std::string& type,
                                     Index count) const {
    const std::string group = kMesh + "/" + what + "/zoneTopology";
    const auto list = [&](const std::string& name) { return file_.integers(group + "/" + name); };
    if (!file_.has(group)) return {};
    const std::vector<Index> ids = list("id"), first = list("minId"), last = list("maxId");
    const std::vector<Index> types =
        file_.has(group + "/" + type) ? list(type) : std::vector<Index>(ids.size(), 0);
    if (first.size() != ids.size() || last.size() != ids.size() || types.size() != ids.size())
      file_.fail(group, "its lists are of different lengths");
    const std::vector<std::string> names = read_names(group + "/name");
    std::vector<FluentZone> zones;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (last[i] < first[i]) continue;  // without members
      if (first[i] < 1 || last[i] > count || ids[i] < 0 || ids[i] > std::numeric_limits<int>::max())
        file_.fail(group, "zone " + std::to_string(ids[i]) + " is of " + what + " " +
                              std::to_string(first[i]) + " to " + std::to_string(last[i]) +
                              ", but there are " + std::to_string(count));
      zones.push_back({.id = ids[i],
                       .first = first[i] - 1,
                       .end = last[i],
                       .type = types[i],
                       .name = i < names.size() ? names[i] : ""});
    }
    return zones;
  }

  /// All names in one text, with ';' between.
  std::vector<std::string> read_names(const std::string& dataset) const {
    std::vector<std::string> names;
    if (!file_.has(dataset)) return names;
    for (const std::string& text : file_.texts(dataset)) {
      std::istringstream stream(text);
      for (std::string name; std::getline(stream, name, ';');) names.push_back(name);
    }
    return names;
  }

  Hdf5File file_;
  FluentMesh mesh_;
};

Recognition recognise(const FileStart& start) {
  return recognise_hdf5(start, kMesh + "/faces/nodes", "zoneTopology");
}

ReadMesh read(const fs::path& path) { return Reader(path).run(); }

}  // namespace

const MeshFormat& fluent_hdf5_format() {
  static const MeshFormat format{.name = "Fluent HDF5",
                                 .extensions = {".msh.h5", ".cas.h5"},
                                 .recognise = recognise,
                                 .read = read,
                                 .is_of_finite_volumes = true};
  return format;
}

}  // namespace cadmorph
