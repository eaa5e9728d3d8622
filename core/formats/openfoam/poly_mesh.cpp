#include "core/formats/openfoam/poly_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/formats/mesh_format.h"
#include "core/formats/openfoam/foam_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

fs::path need_file(const fs::path& folder, const std::string& name) {
  const fs::path path = find_foam_file(folder, name);
  if (path.empty()) fail_reading(folder, "the file '" + name + "' is missing in it");
  return path;
}

Index highest(const std::vector<Index>& values) {
  return values.empty() ? -1 : *std::ranges::max_element(values);
}

void read_faces(PolyMesh& mesh) {
  mesh.faces = FoamFile(need_file(mesh.folder, "faces")).faces(mesh.points.rows());
  const Index faces = mesh.faces.count();
  const Index most_cells = 2 * faces;
  FoamFile owner(need_file(mesh.folder, "owner"));
  mesh.faces.owner = owner.labels("owner cells", faces, 0, most_cells);
  if (std::ssize(mesh.faces.owner) != faces)
    owner.fail("there are " + std::to_string(mesh.faces.owner.size()) + " owner cells for " +
               std::to_string(faces) + " faces");
  FoamFile neighbour(need_file(mesh.folder, "neighbour"));
  mesh.faces.neighbour = neighbour.labels("neighbour cells", faces, -1, most_cells);
  mesh.faces.neighbour.resize(std::size_t(faces), -1);
  mesh.cell_count = 1 + std::max(highest(mesh.faces.owner), highest(mesh.faces.neighbour));
}

void read_boundary(PolyMesh& mesh) {
  const Index faces = mesh.faces.count();
  FoamFile file(need_file(mesh.folder, "boundary"));
  const Index count = file.label("the number of patches", 0, faces + 1'000'000);
  file.expect('(', "the number of patches");
  for (Index i = 0; i < count; ++i) {
    FoamPatch patch{.name = file.word("the name of a patch"), .type = "patch", .faces = {}};
    file.expect('{', "the name of a patch");
    Index start = -1, size = -1;
    while (!file.take('}')) {
      const std::string key = file.word("an entry of patch '" + patch.name + "', or '}'");
      if (key == "type")
        patch.type = file.word("the type of patch '" + patch.name + "'");
      else if (key == "nFaces")
        size = file.label("nFaces", 0, faces + 1);
      else if (key == "startFace")
        start = file.label("startFace", 0, faces + 1);
      else if (key == "myProcNo")
        patch.processor = file.label("myProcNo", 0, std::numeric_limits<int>::max());
      else if (key == "neighbProcNo")
        patch.other_processor = file.label("neighbProcNo", 0, std::numeric_limits<int>::max());
      else if (key == "referPatch")
        patch.refers_to = file.word("referPatch");
      else if (key == "neighbourPatch")
        patch.partner = file.word("neighbourPatch");
      file.skip_value();
    }
    if (start < 0 || size < 0 || start + size > faces)
      file.fail("patch '" + patch.name + "' needs startFace and nFaces within the " +
                std::to_string(faces) + " faces");
    for (Index f = start; f < start + size; ++f) patch.faces.push_back(f);
    mesh.patches.push_back(std::move(patch));
  }
  file.expect(')', std::to_string(count) + " patches");
}

void read_zones(PolyMesh& mesh, const std::string& kind, const std::string& members_key,
                Index most) {
  const fs::path path = find_foam_file(mesh.folder, kind + "s");
  if (path.empty()) return;
  FoamFile file(path);
  const Index count = file.label("the number of zones", 0, std::numeric_limits<int>::max());
  if (count == 0) return;
  file.expect('(', "the number of zones");
  for (Index i = 0; i < count; ++i) {
    FoamZone zone{.name = file.word("the name of a zone"), .kind = kind, .members = {}};
    file.expect('{', "the name of a zone");
    while (!file.take('}')) {
      const std::string key = file.word("an entry of zone '" + zone.name + "', or '}'");
      if (key == members_key) zone.members = file.labels(members_key, most, 0, most);
      file.skip_value();
    }
    mesh.zones.push_back(std::move(zone));
  }
  file.expect(')', std::to_string(count) + " zones");
}

constexpr Index kMostItems = Index{1} << 48;  // no limit but a damaged file's: 2 PB of numbers

/// Addressing left over from another mesh has another size: it is not taken.
std::vector<Index> read_addressing(const PolyMesh& mesh, const std::string& name, Index count,
                                   Index first) {
  const fs::path path = find_foam_file(mesh.folder, name);
  if (path.empty()) return {};
  FoamFile file(path);
  std::vector<Index> values = file.labels("items of the whole mesh", kMostItems, first, kMostItems);
  if (first < 0 && std::ranges::find(values, 0) != values.end())
    file.fail("face 0, but faces are counted from 1 here");
  if (std::ssize(values) != count) values.clear();
  return values;
}

void read_points(PolyMesh& mesh) {
  FoamFile file(need_file(mesh.folder, "points"));
  mesh.points = file.points(mesh.file.places);
  mesh.file.source = file.source();
  mesh.addressing.points = read_addressing(mesh, "pointProcAddressing", mesh.points.rows(), 0);
}

fs::path processor_folder(const PolyMesh& piece) {
  return piece.folder.parent_path().parent_path();
}

std::string name_of(const PolyMesh& piece) { return processor_folder(piece).filename().string(); }

std::string text_of(double length) {
  std::string text;
  write_shortest(float(length), {}, text);
  return text;
}

/// Pieces written as text have six digits unless asked for more.
constexpr double kWritingRounding = 1e-5;  // of the mesh's size

double size_of(const Points& points) {
  return points.rows() == 0 ? 0
                            : (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
}

/// Places in which the pieces' items end.
template <class Count>
std::vector<Index> first_items(const std::vector<PolyMesh>& pieces, Count count) {
  std::vector<Index> first = {0};
  for (const PolyMesh& piece : pieces) first.push_back(first.back() + count(piece));
  return first;
}

bool has_addressing(const PolyMesh& piece) {
  const FoamAddressing& to = piece.addressing;
  return std::ssize(to.points) == piece.points.rows() &&
         std::ssize(to.faces) == piece.faces.count() && std::ssize(to.cells) == piece.cell_count;
}

/// Joins pieces whose items are known in the whole mesh.
class AddressedPieces {
 public:
  explicit AddressedPieces(const std::vector<PolyMesh>& pieces)
      : pieces_(pieces), case_(processor_folder(pieces[0]).parent_path()) {}

  PolyMesh run() {
    join_points();
    join_faces();
    mesh_.folder = case_;
    return std::move(mesh_);
  }

 private:
  Index count_of(const char* what, std::vector<Index> FoamAddressing::*items, Index most) const {
    Index last = -1;
    for (const PolyMesh& piece : pieces_)
      for (const Index item : piece.addressing.*items) last = std::max(last, std::abs(item));
    if (last >= most)
      fail_reading(case_,
                   "its addressing and that of the other processor folders "
                   "names " +
                       std::string(what) + " " + std::to_string(last) + ", but they have only " +
                       std::to_string(most) + " in all: a folder is missing, or of another mesh");
    return last + 1;
  }

  [[noreturn]] void fail_missing(const std::string& what, Index item) const {
    fail_reading(case_, what + " " + std::to_string(item) +
                            " of the whole mesh is in none of the processor folders: "
                            "a folder is missing, or of another mesh");
  }

  void join_points() {
    const Index most =
        first_items(pieces_, [](const PolyMesh& piece) { return piece.points.rows(); }).back();
    const Index count = count_of("point", &FoamAddressing::points, most);
    mesh_.points.resize(count, 3);
    std::vector<bool> is_there(std::size_t(count), false);
    double largest = 0;
    Index where = -1;
    for (const PolyMesh& piece : pieces_)
      for (Index i = 0; i < piece.points.rows(); ++i) {
        const Index node = piece.addressing.points[i];
        if (!is_there[node]) {
          mesh_.points.row(node) = piece.points.row(i);
          is_there[node] = true;
          continue;
        }
        const double distance = (piece.points.row(i) - mesh_.points.row(node)).norm();
        if (distance > largest) {
          largest = distance;
          where = node;
        }
      }
    const auto missing = std::ranges::find(is_there, false);
    if (missing != is_there.end()) fail_missing("point", missing - is_there.begin());
    if (largest > kWritingRounding * size_of(mesh_.points))
      fail_reading(case_, "the processor folders disagree about point " + std::to_string(where) +
                              " of the whole mesh by " + text_of(largest) +
                              ": they are not of one mesh; decompose it anew");
  }

  void join_faces() {
    const Index most_cells =
        first_items(pieces_, [](const PolyMesh& piece) { return piece.cell_count; }).back();
    mesh_.cell_count = count_of("cell", &FoamAddressing::cells, most_cells);
    const Index most_faces =
        first_items(pieces_, [](const PolyMesh& piece) { return piece.faces.count(); }).back();
    const Index count = count_of("face", &FoamAddressing::faces, most_faces + 1) - 1;
    // Of each face the piece and face that have it as it was, and the one that has it turned.
    struct Side {
      Index piece = -1, face = -1;
    };
    std::vector<Side> straight(count), turned(count);
    for (Index p = 0; p < std::ssize(pieces_); ++p)
      for (Index f = 0; f < pieces_[p].faces.count(); ++f) {
        const Index item = pieces_[p].addressing.faces[f];
        (item > 0 ? straight : turned)[std::abs(item) - 1] = {p, f};
      }
    std::vector<Index> nodes;
    for (Index f = 0; f < count; ++f) {
      const Side side = straight[f];
      if (side.piece < 0) fail_missing("face", f);
      const PolyMesh& piece = pieces_[side.piece];
      nodes.clear();
      for (const Index node : piece.faces.face(side.face))
        nodes.push_back(piece.addressing.points[node]);
      mesh_.faces.add_face(nodes);
      const auto cell_of = [&](Index p, Index cell) {
        return cell < 0 ? Index{-1} : pieces_[p].addressing.cells[cell];
      };
      mesh_.faces.owner.push_back(cell_of(side.piece, piece.faces.owner[side.face]));
      const Side other = turned[f];
      mesh_.faces.neighbour.push_back(
          other.piece < 0 ? cell_of(side.piece, piece.faces.neighbour[side.face])
                          : cell_of(other.piece, pieces_[other.piece].faces.owner[other.face]));
    }
  }

  const std::vector<PolyMesh>& pieces_;
  const fs::path case_;
  PolyMesh mesh_;
};

/// Joins pieces at their processor patches.
class PatchedPieces {
 public:
  explicit PatchedPieces(const std::vector<PolyMesh>& pieces)
      : pieces_(pieces),
        first_point_(
            first_items(pieces, [](const PolyMesh& piece) { return piece.points.rows(); })),
        first_cell_(first_items(pieces, [](const PolyMesh& piece) { return piece.cell_count; })) {
    for (Index i = 0; i < first_point_.back(); ++i) same_.push_back(i);
    for (const PolyMesh& piece : pieces) faces_.emplace_back(piece.faces.count(), -1);
  }

  /// Fills the addressing, by which AddressedPieces joins them.
  std::vector<FoamAddressing> run() {
    for (Index p = 0; p < std::ssize(pieces_); ++p)
      for (const FoamPatch& patch : pieces_[p].patches)
        if (patch.type == "processor") pair(p, patch);
    std::vector<FoamAddressing> addressing(pieces_.size());
    std::vector<Index> numbers(same_.size(), -1);
    Index nodes = 0, faces = 0;
    for (Index p = 0; p < std::ssize(pieces_); ++p) {
      FoamAddressing& to = addressing[p];
      for (Index i = 0; i < pieces_[p].points.rows(); ++i) {
        Index& number = numbers[root(first_point_[p] + i)];
        if (number < 0) number = nodes++;
        to.points.push_back(number);
      }
      for (Index f = 0; f < pieces_[p].faces.count(); ++f) {
        Index& number = faces_[p][f];
        to.faces.push_back(number < 0 ? ++faces : -number);
        if (const auto at = twins_.find({p, f}); at != twins_.end())
          faces_[at->second.first][at->second.second] = faces;
      }
      for (Index c = 0; c < pieces_[p].cell_count; ++c) to.cells.push_back(first_cell_[p] + c);
    }
    return addressing;
  }

 private:
  using PieceFace = std::pair<Index, Index>;

  Index root(Index i) {
    while (same_[i] != i) i = same_[i] = same_[same_[i]];
    return i;
  }
  void unite(Index a, Index b) {
    a = root(a);
    b = root(b);
    same_[std::max(a, b)] = std::min(a, b);
  }

  const FoamPatch& other_side(Index p, const FoamPatch& patch) const {
    const Index other = patch.other_processor;
    if (other >= 0 && other < std::ssize(pieces_))
      for (const FoamPatch& candidate : pieces_[other].patches)
        if (candidate.type == "processor" && candidate.other_processor == p &&
            candidate.faces.size() == patch.faces.size())
          return candidate;
    fail_reading(pieces_[p].folder,
                 "patch '" + patch.name + "' of " + std::to_string(patch.faces.size()) +
                     " faces has no other side of as many in processor" + std::to_string(other));
  }

  void pair(Index p, const FoamPatch& patch) {
    const Index other = patch.other_processor;
    const FoamPatch& other_patch = other_side(p, patch);
    if (other < p) return;  // done from there
    for (std::size_t i = 0; i < patch.faces.size(); ++i) {
      pair_nodes(p, patch, patch.faces[i], other, other_patch.faces[i]);
      twins_[{p, patch.faces[i]}] = {other, other_patch.faces[i]};
    }
  }

  /// The nodes of the other side run the other way, from the same first one.
  void pair_nodes(Index p, const FoamPatch& patch, Index f, Index other, Index other_f) {
    const auto face = pieces_[p].faces.face(f), twin = pieces_[other].faces.face(other_f);
    const auto n = face.size();
    double distance = 0, size = 0;
    if (n == twin.size())
      for (std::size_t i = 0; i < n; ++i) {
        const auto point = pieces_[p].points.row(face[i]);
        distance =
            std::max(distance, (point - pieces_[other].points.row(twin[(n - i) % n])).norm());
        size = std::max(size, (point - pieces_[p].points.row(face[(i + 1) % n])).norm());
      }
    constexpr double kMatchTolerance = 1e-3;  // of the face; files of six digits have 1e-6 of all
    if (n != twin.size() ||
        distance > kMatchTolerance * size + kWritingRounding * size_of(pieces_[p].points))
      fail_reading(pieces_[p].folder, "face " + std::to_string(f) + " of patch '" + patch.name +
                                          "' does not lie on its other side in processor" +
                                          std::to_string(other));
    for (std::size_t i = 0; i < n; ++i)
      unite(first_point_[p] + face[i], first_point_[other] + twin[(n - i) % n]);
  }

  const std::vector<PolyMesh>& pieces_;
  std::vector<Index> first_point_, first_cell_;
  std::vector<Index> same_;                ///< of each point one that is the same node
  std::map<PieceFace, PieceFace> twins_;   ///< other sides of processor faces
  std::vector<std::vector<Index>> faces_;  ///< 1-based number of a face that its twin got
};

/// Patches and zones of the pieces, by name.
void join_names(const std::vector<PolyMesh>& pieces, PolyMesh& mesh) {
  std::map<std::string, std::size_t> patches;
  std::map<std::pair<std::string, std::string>, std::size_t> zones;
  for (const PolyMesh& piece : pieces) {
    const FoamAddressing& to = piece.addressing;
    for (const FoamPatch& patch : piece.patches) {
      if (patch.type == "processor") continue;
      const std::string& name = patch.refers_to.empty() ? patch.name : patch.refers_to;
      const auto [at, is_new] = patches.emplace(name, mesh.patches.size());
      if (is_new) mesh.patches.push_back({.name = name, .type = patch.type, .faces = {}});
      FoamPatch& joined = mesh.patches[at->second];
      if (patch.refers_to.empty()) {
        joined.type = patch.type;
        joined.partner = patch.partner;
      }
      for (const Index f : patch.faces) joined.faces.push_back(std::abs(to.faces[f]) - 1);
    }
    for (const FoamZone& zone : piece.zones) {
      const auto [at, is_new] = zones.emplace(std::pair(zone.kind, zone.name), mesh.zones.size());
      if (is_new) mesh.zones.push_back({.name = zone.name, .kind = zone.kind, .members = {}});
      for (const Index item : zone.members)
        mesh.zones[at->second].members.push_back(zone.kind == "cellZone" ? to.cells[item]
                                                 : zone.kind == "faceZone"
                                                     ? std::abs(to.faces[item]) - 1
                                                     : to.points[item]);
    }
  }
}

/// Makes regions of cell zones that hold each cell once.
void add_regions(const PolyMesh& poly_mesh, Mesh& mesh) {
  std::vector<int> regions(std::size_t(poly_mesh.cell_count), 0);
  Index members = 0;
  int region = 0;
  for (const FoamZone& zone : poly_mesh.zones) {
    if (zone.kind != "cellZone") continue;
    ++region;
    members += std::ssize(zone.members);
    for (const Index cell : zone.members) regions[cell] = region;
  }
  const bool is_covered = std::ranges::find(regions, 0) == regions.end();
  if (!is_covered || members != poly_mesh.cell_count) return;
  mesh.regions = std::move(regions);
  mesh.region_array = "cellZone";
}

void add_groups(const PolyMesh& poly_mesh, Mesh& mesh) {
  const auto add_face = [&](std::vector<Index>& nodes, Index f) {
    const auto face = poly_mesh.faces.face(f);
    nodes.insert(nodes.end(), face.begin(), face.end());
  };
  for (const FoamPatch& patch : poly_mesh.patches) {
    NodeGroup& group = mesh.groups.emplace_back();
    group.name = patch.name;
    group.kind = patch.type == "patch" ? "patch" : "patch (" + patch.type + ")";
    // Other coupled patches, as cyclicAMI, need no nodes that match.
    if (patch.type == "cyclic") group.partner = patch.partner;
    for (const Index f : patch.faces) add_face(group.nodes, f);
  }
  for (const FoamZone& zone : poly_mesh.zones) {
    NodeGroup& group = mesh.groups.emplace_back();
    group.name = zone.name;
    group.kind = zone.kind;
    for (const Index item : zone.members)
      if (zone.kind == "cellZone") {
        const auto cell = mesh.cell(item);
        group.nodes.insert(group.nodes.end(), cell.begin(), cell.end());
      } else if (zone.kind == "faceZone") {
        add_face(group.nodes, item);
      } else {
        group.nodes.push_back(item);
      }
  }
  tidy_groups(mesh);
}

}  // namespace

fs::path find_foam_file(const fs::path& folder, const std::string& name) {
  std::error_code error;
  for (const fs::path& path : {folder / name, folder / (name + ".gz")})
    if (fs::is_regular_file(path, error)) return path;
  return {};
}

PolyMesh read_poly_mesh(const fs::path& folder) {
  PolyMesh mesh = read_poly_mesh_points(folder);
  read_faces(mesh);
  read_boundary(mesh);
  read_zones(mesh, "cellZone", "cellLabels", mesh.cell_count);
  read_zones(mesh, "faceZone", "faceLabels", mesh.faces.count());
  read_zones(mesh, "pointZone", "pointLabels", mesh.points.rows());
  mesh.addressing.faces =
      read_addressing(mesh, "faceProcAddressing", mesh.faces.count(), -kMostItems);
  mesh.addressing.cells = read_addressing(mesh, "cellProcAddressing", mesh.cell_count, 0);
  return mesh;
}

PolyMesh read_poly_mesh_points(const fs::path& folder) {
  PolyMesh mesh;
  mesh.folder = folder;
  read_points(mesh);
  return mesh;
}

JoinedPieces join_pieces(std::vector<PolyMesh> pieces) {
  JoinedPieces result;
  const auto lacking = std::ranges::find_if_not(pieces, has_addressing);
  if (lacking != pieces.end()) {
    result.remarks.push_back(
        name_of(*lacking) +
        " does not tell what of the whole mesh it is (pointProcAddressing and its kin are missing "
        "or of another mesh): the pieces are joined at their processor patches");
    std::vector<FoamAddressing> addressing = PatchedPieces(pieces).run();
    for (std::size_t p = 0; p < pieces.size(); ++p) pieces[p].addressing = std::move(addressing[p]);
  }
  result.mesh = AddressedPieces(pieces).run();
  join_names(pieces, result.mesh);
  for (PolyMesh& piece : pieces) result.nodes.push_back(std::move(piece.addressing.points));
  return result;
}

std::vector<Index> nodes_of_piece(const PolyMesh& whole, const PolyMesh& piece,
                                  std::vector<std::string>& remarks) {
  const auto refuse = [&](const std::string& why) {
    fail_reading(piece.folder, why + " the whole mesh, " + whole.folder.string() +
                                   ", so it can't be told which is meant: decompose the case anew, "
                                   "or move away the mesh that is of no use");
  };
  const std::vector<Index>& nodes = piece.addressing.points;
  if (nodes.empty()) refuse("there is no pointProcAddressing of its points to those of");
  double largest = 0;
  for (Index i = 0; i < piece.points.rows(); ++i) {
    if (nodes[i] >= whole.points.rows())
      refuse("its point " + std::to_string(i) + " is point " + std::to_string(nodes[i]) +
             ", which is not in");
    largest = std::max(largest, (piece.points.row(i) - whole.points.row(nodes[i])).norm());
  }
  if (!(largest <= kWritingRounding * size_of(whole.points)))
    refuse("its points are up to " + text_of(largest) + " away from those of");
  if (largest > 0)
    remarks.push_back(
        "the points of " + name_of(piece) + " are up to " + text_of(largest) +
        " away from those of the whole mesh: it gets the whole one's where they move");
  return nodes;
}

Mesh to_mesh(PolyMesh&& poly_mesh) {
  Mesh mesh;
  mesh.points = std::move(poly_mesh.points);
  add_solid_cells(mesh, poly_mesh.faces, poly_mesh.cell_count, poly_mesh.folder);
  add_regions(poly_mesh, mesh);
  add_groups(poly_mesh, mesh);
  return mesh;
}

}  // namespace cadmorph
