#include "core/boundary.h"

#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <string>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/quality.h"

namespace cadmorph {
namespace {

constexpr Index kGrain = 1 << 14;  // cells or nodes a task: about a millisecond

/// A face of a cell: cell id and number of the face in it, in one integer that sorts by both.
class FaceId {
 public:
  FaceId() = default;
  FaceId(Index cell, Index local) : id_(cell << kBits | local) {}
  Index cell() const { return id_ >> kBits; }
  Index local() const { return id_ & (kLimit - 1); }
  auto operator<=>(const FaceId&) const = default;

  static constexpr int kBits = 20;
  static constexpr Index kLimit = Index{1} << kBits;

 private:
  Index id_ = 0;
};

/// A face in the bucket of its smallest node id.
struct Record {
  std::uint64_t hash;  ///< of its corner ids
  FaceId face;
  auto operator<=>(const Record&) const = default;
};

/// A face to keep, with the cell on its other side (-1: none).
struct Kept {
  FaceId face;
  Index neighbour;
  bool operator<(const Kept& other) const { return face < other.face; }
};

std::uint64_t hash_of(const std::vector<Index>& corners) {
  std::uint64_t h = corners.size();
  for (Index node : corners) {  // the finaliser of splitmix64
    h ^= static_cast<std::uint64_t>(node) + 0x9e3779b97f4a7c15u;
    h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9u;
    h = (h ^ (h >> 27)) * 0x94d049bb133111ebu;
    h ^= h >> 31;
  }
  return h;
}

/// Sorts node ids and drops repeated ones: a collapsed quad then equals the triangle it meets.
void normalise(std::vector<Index>& corners) {
  if (corners.size() == 3) {
    if (corners[0] > corners[1]) std::swap(corners[0], corners[1]);
    if (corners[1] > corners[2]) std::swap(corners[1], corners[2]);
    if (corners[0] > corners[1]) std::swap(corners[0], corners[1]);
  } else {
    std::ranges::sort(corners);
  }
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
}

void take_corners(std::span<const Index> cell, const LocalFace& face, std::vector<Index>& corners) {
  corners.resize(corner_count(face.type, face.count));
  for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = cell[face.nodes[i]];
}

/// Calls visit(face, corners) for the faces of solid cell `c` that have an area; `corners` are
/// ascending node ids, in `scratch`.
template <class Visit>
void for_each_face(const Mesh& mesh, Index c, std::vector<Index>& scratch, Visit&& visit) {
  Index local = 0;
  const auto take = [&] {
    normalise(scratch);
    if (local >= FaceId::kLimit)
      throw InvalidInputError("polyhedron cell " + std::to_string(c) + " has more than " +
                              std::to_string(FaceId::kLimit) + " faces");
    if (scratch.size() >= 3) visit(FaceId(c, local), scratch);
    ++local;
  };
  if (mesh.types[c] == CellType::Polyhedron) {
    for_each_polyhedron_face(mesh, c, [&](std::span<const Index> nodes) {
      scratch.assign(nodes.begin(), nodes.end());
      take();
    });
    return;
  }
  const auto cell = mesh.cell(c);
  for (const LocalFace& face : local_faces(mesh.types[c])) {
    take_corners(cell, face, scratch);
    take();
  }
}

/// The faces of all solid cells, bucket by bucket of their smallest node id.
struct Buckets {
  std::vector<Index> offsets;  ///< nodes + 1
  std::vector<Record> records;
};

template <class Visit>
void for_all_faces(const Mesh& mesh, Visit&& visit) {
  parallel_for(mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    std::vector<Index> scratch;
    for (Index c = begin; c < end; ++c) for_each_face(mesh, c, scratch, visit);
  });
}

Buckets make_buckets(const Mesh& mesh) {
  const Index nodes = mesh.node_count();
  std::vector<std::atomic<Index>> next(nodes);
  for_all_faces(mesh, [&](FaceId, const std::vector<Index>& corners) {
    next[corners.front()].fetch_add(1, std::memory_order_relaxed);
  });
  Buckets buckets{std::vector<Index>(nodes + 1, 0), {}};
  for (Index n = 0; n < nodes; ++n) {
    buckets.offsets[n + 1] = buckets.offsets[n] + next[n];
    next[n] = buckets.offsets[n];
  }
  buckets.records.resize(buckets.offsets.back());
  for_all_faces(mesh, [&](FaceId face, const std::vector<Index>& corners) {
    const Index at = next[corners.front()].fetch_add(1, std::memory_order_relaxed);
    buckets.records[at] = {hash_of(corners), face};
  });
  return buckets;
}

/// Sorted corners of one face.
void find_corners(const Mesh& mesh, FaceId wanted, std::vector<Index>& corners) {
  if (mesh.types[wanted.cell()] == CellType::Polyhedron) {
    Index local = 0;
    for_each_polyhedron_face(mesh, wanted.cell(), [&](std::span<const Index> nodes) {
      if (local++ == wanted.local()) corners.assign(nodes.begin(), nodes.end());
    });
  } else {
    take_corners(mesh.cell(wanted.cell()), local_faces(mesh.types[wanted.cell()])[wanted.local()],
                 corners);
  }
  normalise(corners);
}

std::string joined(const std::vector<Index>& ids) {
  std::string text;
  for (Index id : ids) text.append(" ").append(std::to_string(id));
  return text;
}

[[noreturn]] void fail_shared(const Mesh& mesh, std::span<const Record> group) {
  std::vector<Index> cells, corners;
  find_corners(mesh, group[0].face, corners);
  for (const Record& record : group) cells.push_back(record.face.cell());
  throw InvalidInputError("more than two cells share the face of nodes" + joined(corners) +
                          ": cells" + joined(cells) +
                          "; remove duplicate or overlapping cells from the mesh");
}

/// Decides on the face that `group`, all records with the same corners, stands for.
void keep_face(const Mesh& mesh, std::span<const Record> group, std::vector<Kept>& kept) {
  if (group.size() > 2) fail_shared(mesh, group);
  FaceId a = group[0].face;
  if (group.size() == 1) {
    kept.push_back({a, -1});
    return;
  }
  FaceId b = group[1].face;
  if (mesh.region(a.cell()) == mesh.region(b.cell())) return;
  if (mesh.region(b.cell()) < mesh.region(a.cell())) std::swap(a, b);
  kept.push_back({a, b.cell()});
}

/// Goes through buckets of faces; its memory is reused from one to the next.
class Scanner {
 public:
  Scanner(const Mesh& mesh, std::vector<Kept>& kept) : mesh_(mesh), kept_(kept) {}

  /// Decides on all faces of one bucket.
  void scan(std::span<Record> bucket) {
    std::sort(bucket.begin(), bucket.end());
    for (auto begin = bucket.begin(); begin != bucket.end();) {
      auto end = begin + 1;
      while (end != bucket.end() && end->hash == begin->hash) ++end;
      split({begin, end});
      begin = end;
    }
  }

 private:
  /// Splits records of equal hash, should different corners collide, and decides on each part.
  void split(std::span<Record> group) {
    while (!group.empty()) {
      auto end = group.begin() + 1;
      if (group.size() > 1) {
        find_corners(mesh_, group[0].face, corners_);
        end = std::partition(end, group.end(), [&](const Record& other) {
          find_corners(mesh_, other.face, other_corners_);
          return other_corners_ == corners_;
        });
      }
      keep_face(mesh_, {group.begin(), end}, kept_);
      group = {end, group.end()};
    }
  }

  const Mesh& mesh_;
  std::vector<Kept>& kept_;
  std::vector<Index> corners_, other_corners_;
};

/// Faces used by one cell, and those between regions, in the order of their cells.
std::vector<Kept> select_faces(const Mesh& mesh) {
  Buckets buckets = make_buckets(mesh);
  std::vector<std::vector<Kept>> parts((mesh.node_count() + kGrain - 1) / kGrain);
  parallel_for(mesh.node_count(), kGrain, [&](Index begin, Index end) {
    Scanner scanner(mesh, parts[begin / kGrain]);
    const auto records = buckets.records.begin();
    for (Index n = begin; n < end; ++n)
      scanner.scan({records + buckets.offsets[n], records + buckets.offsets[n + 1]});
  });
  std::vector<Kept> kept;
  for (const auto& part : parts) kept.insert(kept.end(), part.begin(), part.end());
  tbb::parallel_sort(kept.begin(), kept.end());
  return kept;
}

/// Turns a facet's normal round.
void reverse(Facet& facet) {
  if (facet.type == CellType::QuadraticLinearQuad) {  // its curved edges must stay first and third
    std::swap(facet.nodes[0], facet.nodes[1]);
    std::swap(facet.nodes[2], facet.nodes[3]);
    return;
  }
  const auto nodes = facet.nodes.begin();
  const int corners = corner_count(facet.type, std::ssize(facet.nodes));
  std::reverse(nodes + 1, nodes + corners);
  if (std::ssize(facet.nodes) > corners) std::reverse(nodes + corners, nodes + 2 * corners);
}

/// Makes a quad with two equal corners the triangle that it is.
void drop_repeated_corner(Facet& facet) {
  if (facet.type != CellType::Quad) return;
  for (int i = 0; i < 4; ++i) {
    if (facet.nodes[i] != facet.nodes[(i + 1) % 4]) continue;
    facet.nodes.erase(facet.nodes.begin() + i);
    facet.type = CellType::Triangle;
    return;
  }
}

void append(Boundary& boundary, const Facet& facet, Index cell, Index neighbour) {
  boundary.types.push_back(facet.type);
  boundary.connectivity.insert(boundary.connectivity.end(), facet.nodes.begin(), facet.nodes.end());
  boundary.offsets.push_back(static_cast<Index>(boundary.connectivity.size()));
  boundary.cell.push_back(cell);
  boundary.neighbour.push_back(neighbour);
}

Boundary solid_boundary(const Mesh& mesh) {
  Boundary boundary;
  boundary.offsets = {0};
  const Orientation orientation = detect_orientation(mesh);
  Index cell = -1;
  std::vector<Facet> facets;
  for (const Kept& kept : select_faces(mesh)) {
    if (kept.face.cell() != cell) {
      cell = kept.face.cell();
      facets = cell_facets(mesh, cell);
    }
    Facet& facet = facets[kept.face.local()];
    if (orientation[static_cast<std::size_t>(mesh.types[cell])] < 0) reverse(facet);
    drop_repeated_corner(facet);
    append(boundary, facet, cell, kept.neighbour);
  }
  return boundary;
}

Boundary shell_boundary(const Mesh& mesh) {
  Boundary boundary;
  boundary.offsets = {0};
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 2) continue;
    Facet facet{mesh.types[c], {mesh.cell(c).begin(), mesh.cell(c).end()}};
    if (facet.type == CellType::Pixel) {
      facet.type = CellType::Quad;
      std::swap(facet.nodes[2], facet.nodes[3]);
    }
    append(boundary, facet, c, -1);
  }
  return boundary;
}

std::vector<Index> used_nodes(const Boundary& boundary, Index node_count) {
  std::vector<char> is_used(node_count, 0);
  for (Index node : boundary.connectivity) is_used[node] = 1;
  std::vector<Index> nodes;
  for (Index n = 0; n < node_count; ++n)
    if (is_used[n]) nodes.push_back(n);
  return nodes;
}

}  // namespace

Boundary extract_boundary(const Mesh& mesh) {
  const int highest = dimension(mesh);
  if (highest < 2)
    throw InvalidInputError(
        "the mesh has neither solid nor shell cells, so it has no surface to morph");
  Boundary boundary = highest == 3 ? solid_boundary(mesh) : shell_boundary(mesh);
  boundary.nodes = used_nodes(boundary, mesh.node_count());
  return boundary;
}

Incidence node_facets(const Boundary& boundary, Index node_count) {
  Incidence incidence{std::vector<Index>(node_count + 1, 0), {}};
  for (Index node : boundary.connectivity) ++incidence.offsets[node + 1];
  for (Index n = 0; n < node_count; ++n) incidence.offsets[n + 1] += incidence.offsets[n];
  incidence.facets.resize(boundary.connectivity.size());
  std::vector<Index> next(incidence.offsets.begin(), incidence.offsets.end() - 1);
  for (Index f = 0; f < boundary.facet_count(); ++f)
    for (Index node : boundary.facet(f)) incidence.facets[next[node]++] = f;
  return incidence;
}

}  // namespace cadmorph
