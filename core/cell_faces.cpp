#include "core/cell_faces.h"

#include <algorithm>
#include <atomic>
#include <string>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

constexpr Index kGrain = 1 << 14;  // cells or nodes a task: about a millisecond

// A face in the bucket of its smallest node id.
struct Record {
  std::uint64_t hash;  ///< of its corner ids
  CellFace face;
  auto operator<=>(const Record&) const = default;
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

// Sorts node ids and drops repeated ones: a collapsed quad then equals the triangle it meets.
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

// Calls visit(face, corners) for the faces of solid cell `c` that have an area; `corners` are
// ascending node ids, in `scratch`.
template <class Visit>
void for_each_face(const Mesh& mesh, Index c, std::vector<Index>& scratch, Visit&& visit) {
  Index local = 0;
  const auto take = [&] {
    normalise(scratch);
    if (local >= CellFace::kLimit)
      throw InvalidInputError("polyhedron cell " + std::to_string(c) + " has more than " +
                              std::to_string(CellFace::kLimit) + " faces");
    if (scratch.size() >= 3) visit(CellFace(c, local), scratch);
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

// The faces of all solid cells, bucket by bucket of their smallest node id.
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
  for_all_faces(mesh, [&](CellFace, const std::vector<Index>& corners) {
    next[corners.front()].fetch_add(1, std::memory_order_relaxed);
  });
  Buckets buckets{std::vector<Index>(nodes + 1, 0), {}};
  for (Index n = 0; n < nodes; ++n) {
    buckets.offsets[n + 1] = buckets.offsets[n] + next[n];
    next[n] = buckets.offsets[n];
  }
  buckets.records.resize(buckets.offsets.back());
  for_all_faces(mesh, [&](CellFace face, const std::vector<Index>& corners) {
    const Index at = next[corners.front()].fetch_add(1, std::memory_order_relaxed);
    buckets.records[at] = {hash_of(corners), face};
  });
  return buckets;
}

// Sorted corners of one face.
void find_corners(const Mesh& mesh, CellFace wanted, std::vector<Index>& corners) {
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

using Visit = std::function<void(std::span<const CellFace>)>;

// Goes through buckets of faces; its memory is reused from one to the next.
class Scanner {
 public:
  Scanner(const Mesh& mesh, const Visit& visit) : mesh_(mesh), visit_(visit) {}

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
  // Splits records of equal hash, should different corners collide, and visits each part.
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
      faces_.clear();
      for (auto record = group.begin(); record != end; ++record) faces_.push_back(record->face);
      visit_(faces_);
      group = {end, group.end()};
    }
  }

  const Mesh& mesh_;
  const Visit& visit_;
  std::vector<CellFace> faces_;
  std::vector<Index> corners_, other_corners_;
};

}  // namespace

void for_each_shared_face(const Mesh& mesh, const Visit& visit) {
  Buckets buckets = make_buckets(mesh);
  parallel_for(mesh.node_count(), kGrain, [&](Index begin, Index end) {
    Scanner scanner(mesh, visit);
    const auto records = buckets.records.begin();
    for (Index n = begin; n < end; ++n)
      scanner.scan({records + buckets.offsets[n], records + buckets.offsets[n + 1]});
  });
}

}  // namespace cadmorph
