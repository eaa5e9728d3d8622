#include "core/cell_faces.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <memory>
#include <mutex>
#include <string>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

constexpr Index kGrain = 1 << 14;  // cells or nodes a task: about a millisecond

// Cell id and number of the face in it, in one integer that sorts by both.
class CellFace {
 public:
  CellFace() = default;
  CellFace(Index cell, Index local) : id_(cell << kBits | local) {}
  Index cell() const { return id_ >> kBits; }
  Index local() const { return id_ & (kLimit - 1); }
  auto operator<=>(const CellFace&) const = default;

  // A million faces of a cell, and 2^43 cells.
  static constexpr int kBits = 20;
  static constexpr Index kLimit = Index{1} << kBits;

 private:
  Index id_;
};

// A face in the bucket of its smallest node id. The key has the other two corners of a triangle
// whose ids take 31 bits, and of all other faces a hash, marked by its top bit.
struct Record {
  std::uint64_t key;
  CellFace face;
  auto operator<=>(const Record&) const = default;
};

constexpr std::uint64_t kHashed = std::uint64_t{1} << 63;

std::uint64_t triangle_key(Index second, Index third) {
  return static_cast<std::uint64_t>(second) << 32 | static_cast<std::uint64_t>(third);
}

// Sorted corners of a face, the first being that of its bucket.
std::uint64_t key_of(std::span<const Index> corners) {
  constexpr Index kLargest = (Index{1} << 31) - 1;
  if (corners.size() == 3 && corners[2] <= kLargest) return triangle_key(corners[1], corners[2]);
  std::uint64_t h = corners.size();
  for (const Index node : corners) {  // the finaliser of splitmix64
    h ^= static_cast<std::uint64_t>(node) + 0x9e3779b97f4a7c15u;
    h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9u;
    h = (h ^ (h >> 27)) * 0x94d049bb133111ebu;
    h ^= h >> 31;
  }
  return h | kHashed;
}

void order(Index& a, Index& b) {
  const Index low = std::min(a, b), high = std::max(a, b);
  a = low;
  b = high;
}

// Sorts node ids and drops repeated ones: a collapsed quad then equals the triangle it meets.
std::span<const Index> normalise(std::span<Index> corners) {
  if (corners.size() == 3) {
    order(corners[0], corners[1]);
    order(corners[1], corners[2]);
    order(corners[0], corners[1]);
  } else if (corners.size() == 4) {
    order(corners[0], corners[1]);
    order(corners[2], corners[3]);
    order(corners[0], corners[2]);
    order(corners[1], corners[3]);
    order(corners[1], corners[2]);
  } else {
    std::ranges::sort(corners);
  }
  const auto repeated = std::ranges::unique(corners);
  return corners.first(corners.size() - repeated.size());
}

// Goes through faces cell by cell; its memory is reused from one to the next.
class FaceReader {
 public:
  explicit FaceReader(const Mesh& mesh) : mesh_(mesh) {}

  // Calls visit(local_face, corners) for the faces of solid cell `c`; `corners` are ascending.
  template <class Visit>
  void for_each_face(Index c, Visit&& visit) {
    Index local = 0;
    if (mesh_.types[c] == CellType::Polyhedron) {
      for_each_polyhedron_face(mesh_, c, [&](std::span<const Index> nodes) {
        corners_.assign(nodes.begin(), nodes.end());
        visit(local++, normalise(corners_));
      });
      return;
    }
    const auto cell = mesh_.cell(c);
    std::array<Index, 4> corners;
    for (const LocalFace& face : local_faces(mesh_.types[c])) {
      const int count = corner_count(face.type, face.count);
      for (int i = 0; i < count; ++i) corners[i] = cell[face.nodes[i]];
      visit(local++, normalise({corners.data(), static_cast<std::size_t>(count)}));
    }
  }

  // Ascending corners of one face, in `corners`.
  void take_corners(CellFace wanted, std::vector<Index>& corners) {
    const Index c = wanted.cell();
    if (mesh_.types[c] == CellType::Polyhedron) {
      for_each_face(c, [&](Index local, std::span<const Index> found) {
        if (local == wanted.local()) corners.assign(found.begin(), found.end());
      });
      return;
    }
    const LocalFace& face = local_faces(mesh_.types[c])[wanted.local()];
    corners.resize(corner_count(face.type, face.count));
    for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = mesh_.cell(c)[face.nodes[i]];
    corners.resize(normalise(corners).size());
  }

  bool have_same_corners(CellFace a, CellFace b) {
    take_corners(a, of_a_);
    take_corners(b, of_b_);
    return of_a_ == of_b_;
  }

 private:
  const Mesh& mesh_;
  std::vector<Index> corners_, of_a_, of_b_;
};

// The nodes of a tetrahedron in ascending order, each with the face opposite to it.
struct SortedTetra {
  std::array<Index, 4> node;
  std::array<Index, 4> opposite;

  explicit SortedTetra(std::span<const Index> cell) {
    constexpr std::array<Index, 4> kOpposite = {1, 2, 0, 3};  // of local_faces
    std::array<Index, 4> both;
    for (int i = 0; i < 4; ++i) both[i] = cell[i] << 2 | kOpposite[i];
    order(both[0], both[1]);
    order(both[2], both[3]);
    order(both[0], both[2]);
    order(both[1], both[3]);
    order(both[1], both[2]);
    for (int i = 0; i < 4; ++i) {
      node[i] = both[i] >> 2;
      opposite[i] = both[i] & 3;
    }
  }

  bool is_proper() const { return node[0] < node[1] && node[1] < node[2] && node[2] < node[3]; }
};

// Matches the faces of all solid cells, bucket by bucket of their smallest node id.
class Matcher {
 public:
  explicit Matcher(const Mesh& mesh)
      : mesh_(mesh),
        has_short_ids_(mesh.node_count() <= Index{1} << 31),
        next_(mesh.node_count()),
        begin_(mesh.node_count() + 1, 0) {}

  CellNeighbours match() {
    count_faces();
    fill_buckets();
    parallel_for(mesh_.node_count(), kGrain, [&](Index begin, Index end) {
      FaceReader reader(mesh_);
      for (Index n = begin; n < end; ++n)
        match_bucket({records_.get() + begin_[n], records_.get() + begin_[n + 1]}, reader);
    });
    report_overlap();
    return std::move(result_);
  }

 private:
  bool is_simple(Index c) const { return has_short_ids_ && mesh_.types[c] == CellType::Tetra; }

  Index take(Index node, Index count) {
    return next_[node].fetch_add(count, std::memory_order_relaxed);
  }

  Index face_count(Index c) const {
    if (mesh_.types[c] != CellType::Polyhedron)
      return static_cast<Index>(local_faces(mesh_.types[c]).size());
    Index faces = 0;
    for_each_polyhedron_face(mesh_, c, [&](std::span<const Index>) { ++faces; });
    if (faces > CellFace::kLimit)
      throw InvalidInputError("polyhedron cell " + std::to_string(c) + " has more than " +
                              std::to_string(CellFace::kLimit) + " faces");
    return faces;
  }

  void count_faces() {
    const Index cells = mesh_.cell_count();
    result_.offsets.resize(cells + 1);
    result_.offsets[0] = 0;
    parallel_for(cells, kGrain, [&](Index begin, Index end) {
      FaceReader reader(mesh_);
      for (Index c = begin; c < end; ++c) {
        result_.offsets[c + 1] = face_count(c);
        if (is_simple(c))
          if (const SortedTetra tetra(mesh_.cell(c)); tetra.is_proper()) {
            take(tetra.node[0], 3);
            take(tetra.node[1], 1);
            continue;
          }
        reader.for_each_face(c, [&](Index, std::span<const Index> corners) {
          if (corners.size() >= 3) take(corners[0], 1);
        });
      }
    });
    for (Index c = 0; c < cells; ++c) result_.offsets[c + 1] += result_.offsets[c];
    result_.neighbour.resize(result_.offsets.back());
    for (Index n = 0; n < mesh_.node_count(); ++n) {
      begin_[n + 1] = begin_[n] + next_[n];
      next_[n] = begin_[n];
    }
  }

  void fill_buckets() {
    records_ = std::make_unique_for_overwrite<Record[]>(begin_.back());
    parallel_for(mesh_.cell_count(), kGrain, [&](Index begin, Index end) {
      FaceReader reader(mesh_);
      for (Index c = begin; c < end; ++c) {
        if (is_simple(c))
          if (const SortedTetra tetra(mesh_.cell(c)); tetra.is_proper()) {
            add(c, tetra);
            continue;
          }
        reader.for_each_face(c, [&](Index local, std::span<const Index> corners) {
          if (corners.size() < 3)
            neighbour(CellFace(c, local)) = static_cast<std::int32_t>(c);
          else
            records_[take(corners[0], 1)] = {key_of(corners), CellFace(c, local)};
        });
      }
    });
  }

  void add(Index c, const SortedTetra& tetra) {
    const auto& [n, opposite] = tetra;
    Record* records = &records_[take(n[0], 3)];
    records[0] = {triangle_key(n[1], n[2]), CellFace(c, opposite[3])};
    records[1] = {triangle_key(n[1], n[3]), CellFace(c, opposite[2])};
    records[2] = {triangle_key(n[2], n[3]), CellFace(c, opposite[1])};
    records_[take(n[1], 1)] = {triangle_key(n[2], n[3]), CellFace(c, opposite[0])};
  }

  void match_bucket(std::span<Record> bucket, FaceReader& reader) {
    std::sort(bucket.begin(), bucket.end());
    for (auto begin = bucket.begin(); begin != bucket.end();) {
      auto end = begin + 1;
      while (end != bucket.end() && end->key == begin->key) ++end;
      const bool is_exact = !(begin->key & kHashed) || end - begin == 1;
      is_exact ? pair({begin, end}) : split({begin, end}, reader);
      begin = end;
    }
  }

  // Splits records of equal hash, should different corners collide, and pairs each part.
  void split(std::span<Record> group, FaceReader& reader) {
    while (!group.empty()) {
      const CellFace first = group[0].face;
      const auto end = std::stable_partition(
          group.begin() + 1, group.end(),
          [&](const Record& other) { return reader.have_same_corners(first, other.face); });
      pair({group.begin(), end});
      group = {end, group.end()};
    }
  }

  // Takes in the faces, ascending, that have the same corners.
  void pair(std::span<const Record> faces) {
    if (faces.size() == 1) {
      neighbour(faces[0].face) = -1;
      return;
    }
    neighbour(faces[0].face) = static_cast<std::int32_t>(faces[1].face.cell());
    neighbour(faces[1].face) = static_cast<std::int32_t>(faces[0].face.cell());
    if (faces.size() == 2) return;
    for (const Record& other : faces.subspan(2)) neighbour(other.face) = -1;
    const std::lock_guard lock(overlap_mutex_);
    if (!overlap_.empty() && overlap_.front() < faces[0].face) return;
    overlap_.clear();
    for (const Record& record : faces) overlap_.push_back(record.face);
  }

  std::int32_t& neighbour(CellFace face) {
    return result_.neighbour[result_.offsets[face.cell()] + face.local()];
  }

  void report_overlap() {
    for (const CellFace face : overlap_) result_.overlapping.push_back(face.cell());
    if (!overlap_.empty()) result_.overlapping_face = overlap_.front().local();
  }

  const Mesh& mesh_;
  bool has_short_ids_;
  std::vector<std::atomic<Index>> next_;  // first the faces of each bucket, then where one goes
  std::vector<Index> begin_;              // of each bucket, nodes + 1
  std::unique_ptr<Record[]> records_;
  CellNeighbours result_;
  std::mutex overlap_mutex_;
  std::vector<CellFace> overlap_;
};

}  // namespace

CellNeighbours find_cell_neighbours(const Mesh& mesh) {
  if (mesh.cell_count() > std::numeric_limits<std::int32_t>::max())
    throw InvalidInputError("a mesh of " + std::to_string(mesh.cell_count()) +
                            " cells; at most 2^31 - 1 can be morphed at once");
  return Matcher(mesh).match();
}

}  // namespace cadmorph
