#include "core/formats/face_cells.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "core/cell_topology.h"
#include "core/finite_volumes.h"
#include "core/formats/mesh_format.h"
#include "core/parallel.h"
#include "core/quality.h"
#include "core/validity.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using Face = std::vector<Index>;

constexpr Index kBlock = 1 << 12;  // cells that a thread makes at once: some hundred microseconds

/// The faces of each cell, in ascending order.
struct CellFaces {
  std::vector<Index> offsets;  ///< cells + 1 positions in `faces`
  std::vector<Index> faces;

  std::span<const Index> of(Index c) const {
    return {faces.data() + offsets[c], std::size_t(offsets[c + 1] - offsets[c])};
  }
};

CellFaces faces_of_cells(const FaceList& list, Index cells) {
  CellFaces result;
  result.offsets.assign(std::size_t(cells) + 1, 0);
  const auto for_each_side = [&](auto&& visit) {
    for (Index f = 0; f < list.count(); ++f) {
      if (list.owner[f] >= 0) visit(list.owner[f], f);
      if (list.neighbour[f] >= 0) visit(list.neighbour[f], f);
    }
  };
  for_each_side([&](Index cell, Index) { ++result.offsets[cell + 1]; });
  for (Index c = 0; c < cells; ++c) result.offsets[c + 1] += result.offsets[c];
  result.faces.resize(std::size_t(result.offsets.back()));
  std::vector<Index> next(result.offsets.begin(), result.offsets.end() - 1);
  for_each_side([&](Index cell, Index f) { result.faces[next[cell]++] = f; });
  return result;
}

/// Copies a face with its normal out of the cell.
void orient(const FaceList& list, Index f, Index cell, Face& face) {
  const auto nodes = list.face(f);
  face.assign(nodes.begin(), nodes.end());
  if (list.owner[f] != cell) std::reverse(face.begin() + 1, face.end());
}

bool has_node(std::span<const Index> face, Index node) {
  return std::ranges::find(face, node) != face.end();
}

/// The node at the other end of the edge that leaves the first face at `node`; -1 when there is
/// none.
Index node_above(std::span<const Face> faces, Index node) {
  for (const Face& face : faces.subspan(1)) {
    const auto at = std::ranges::find(face, node);
    if (at == face.end()) continue;
    const Index next = at + 1 == face.end() ? face.front() : at[1];
    if (!has_node(faces[0], next)) return next;
    const Index previous = at == face.begin() ? face.back() : at[-1];
    if (!has_node(faces[0], previous)) return previous;
  }
  return -1;
}

bool is_rotation(std::span<const Index> a, std::span<const Index> b) {
  if (a.size() != b.size()) return false;
  const auto start = std::ranges::find(b, a[0]);
  if (start == b.end()) return false;
  const std::size_t shift = std::size_t(start - b.begin());
  for (std::size_t i = 1; i < a.size(); ++i)
    if (a[i] != b[(i + shift) % b.size()]) return false;
  return true;
}

bool has_faces(std::span<const Face> faces, CellType type, std::span<const Index> nodes) {
  std::array<Index, 4> wanted{};
  return std::ranges::all_of(local_faces(type), [&](const LocalFace& local) {
    for (int i = 0; i < local.count; ++i) wanted[std::size_t(i)] = nodes[local.nodes[i]];
    return std::ranges::any_of(faces, [&](const Face& face) {
      return is_rotation(std::span(wanted).first(std::size_t(local.count)), face);
    });
  });
}

/// A type by its numbers of triangles and quadrilaterals.
struct Shape {
  CellType type;
  std::size_t triangles, quads;
  std::size_t base_size;  ///< nodes of the face that is named first
  bool has_apex;
};

constexpr Shape kShapes[] = {{CellType::Hexahedron, 0, 6, 4, false},
                             {CellType::Tetra, 4, 0, 3, true},
                             {CellType::Wedge, 2, 3, 3, false},
                             {CellType::Pyramid, 4, 1, 4, true}};

/// Puts a face that is to be the base first. Finds the nodes in VTK's order, in which the base of
/// all but the wedge has its normal inwards; false when the faces are those of another shape.
bool find_nodes(const Shape& shape, std::span<Face> faces, std::vector<Index>& nodes) {
  const auto base =
      std::ranges::find_if(faces, [&](const Face& face) { return face.size() == shape.base_size; });
  std::iter_swap(faces.begin(), base);
  nodes.assign(faces[0].begin(), faces[0].end());
  if (shape.type != CellType::Wedge) std::reverse(nodes.begin() + 1, nodes.end());
  for (std::size_t i = 0; i < (shape.has_apex ? 1 : shape.base_size); ++i) {
    nodes.push_back(node_above(faces, nodes[i]));
    if (nodes.back() < 0) return false;
  }
  return has_faces(faces, shape.type, nodes);
}

/// Makes some cells, in buffers of its own.
class SolidCells {
 public:
  const Mesh& cells() const { return cells_; }

  void clear() {
    cells_.types.clear();
    cells_.offsets.clear();
    cells_.connectivity.clear();
    cells_.polyhedron_offsets.clear();
    cells_.polyhedron_faces.clear();
  }

  void add(const FaceList& list, std::span<const Index> cell_faces, Index cell, bool is_element) {
    if (faces_.size() < cell_faces.size()) faces_.resize(cell_faces.size());
    for (std::size_t i = 0; i < cell_faces.size(); ++i)
      orient(list, cell_faces[i], cell, faces_[i]);
    const auto faces = std::span(faces_).first(cell_faces.size());
    const auto count = [&](std::size_t size) {
      return std::size_t(
          std::ranges::count_if(faces, [&](const Face& face) { return face.size() == size; }));
    };
    const std::size_t triangles = count(3), quads = count(4);
    for (const Shape& shape : kShapes) {
      if (!is_element || faces.size() != shape.triangles + shape.quads ||
          triangles != shape.triangles || quads != shape.quads)
        continue;
      if (find_nodes(shape, faces, nodes_)) return add_cell(cells_, shape.type, nodes_);
      for (std::size_t i = 0; i < faces.size(); ++i) orient(list, cell_faces[i], cell, faces[i]);
    }
    add_polyhedron(cells_, faces);
  }

 private:
  Mesh cells_;
  std::vector<Face> faces_;
  std::vector<Index> nodes_;
};

/// Ids of the cells whose element has no valid map, though its faces enclose a sound volume; none
/// where points are not finite. What is turned inside out is no sound polyhedron either.
std::vector<Index> volumes_without_map(const Mesh& mesh) {
  if (!mesh.points.allFinite()) return {};
  const Orientation orientation = detect_orientation(mesh);
  std::vector<Index> cells = check_validity(mesh, mesh.points, orientation).invalid_cells;
  // A polynomial that is positive in the whole cell is so at the corners.
  if (std::ranges::find(mesh.types, CellType::Pyramid) != mesh.types.end()) {
    const auto corners = measure_quality(mesh, mesh.points, orientation).inverted_cells;
    cells.insert(cells.end(), corners.begin(), corners.end());
  }
  std::erase_if(cells, [&](Index c) {
    const CellType type = mesh.types[c];
    const int sign = orientation[static_cast<std::size_t>(type)];
    return type == CellType::Tetra || !finite_volume::is_sound(mesh, mesh.points, c, sign);
  });
  return cells;
}

/// The nodes of directed edges that form a ring; false when they don't.
bool chain(std::vector<std::array<Index, 2>>& edges, std::vector<Index>& nodes) {
  nodes.clear();
  for (std::size_t i = 0; i < edges.size(); ++i) {
    nodes.push_back(edges[i][0]);
    const bool is_last = i + 1 == edges.size();
    if (is_last) return edges[i][1] == nodes[0];
    const auto next = std::find_if(edges.begin() + std::ptrdiff_t(i) + 1, edges.end(),
                                   [&](const auto& edge) { return edge[0] == edges[i][1]; });
    if (next == edges.end()) return false;
    std::swap(edges[i + 1], *next);
  }
  return false;
}

}  // namespace

void add_solid_cells(Mesh& mesh, const FaceList& faces, Index cells, const fs::path& path) {
  const CellFaces of_cells = faces_of_cells(faces, cells);
  for (Index c = 0; c < cells; ++c)
    if (const auto count = of_cells.of(c).size(); count < 4)
      fail_reading(path, "cell " + std::to_string(c) + " has " + std::to_string(count) +
                             " faces; a cell needs four at least");
  const auto with_cells = [&](const std::vector<char>& is_element) {
    Mesh result;
    result.points = mesh.points;
    constexpr Index kUsual = 8;  // nodes of a cell, by which memory is reserved; not a limit
    reserve_cells(result, cells, kUsual * cells);
    struct Block {
      Index begin = 0;
      SolidCells made = {};
    };
    std::vector<Block> blocks(std::size_t(2 * thread_count() + 2));
    Index next = 0;
    const auto begin = [&](Index slot) {
      blocks[slot].begin = std::exchange(next, next + kBlock);
      return blocks[slot].begin < cells;
    };
    const auto make = [&](Index slot) {
      Block& block = blocks[slot];
      block.made.clear();
      for (Index c = block.begin; c < std::min(block.begin + kBlock, cells); ++c)
        block.made.add(faces, of_cells.of(c), c, is_element[c] != 0);
    };
    const auto append = [&](Index slot) { append_cells(result, blocks[slot].made.cells()); };
    parallel_pipeline(std::ssize(blocks), begin, make, append);
    return result;
  };
  std::vector<char> is_element(std::size_t(cells), 1);
  Mesh result = with_cells(is_element);
  const std::vector<Index> others = volumes_without_map(result);
  for (const Index c : others) is_element[std::size_t(c)] = 0;
  mesh = others.empty() ? std::move(result) : with_cells(is_element);
}

void add_plane_cells(Mesh& mesh, const FaceList& edges, Index cells, const fs::path& path) {
  const CellFaces of_cells = faces_of_cells(edges, cells);
  std::vector<std::array<Index, 2>> ring;
  std::vector<Index> nodes;
  for (Index c = 0; c < cells; ++c) {
    ring.clear();
    for (const Index f : of_cells.of(c)) {
      const auto edge = edges.face(f);
      ring.push_back({edge[0], edge[1]});
      if (edges.owner[f] != c) std::swap(ring.back()[0], ring.back()[1]);
    }
    if (ring.size() < 3 || !chain(ring, nodes))
      fail_reading(path, "the " + std::to_string(ring.size()) + " edges of cell " +
                             std::to_string(c) + " form no ring");
    add_cell(mesh,
             nodes.size() == 3   ? CellType::Triangle
             : nodes.size() == 4 ? CellType::Quad
                                 : CellType::Polygon,
             nodes);
  }
}

}  // namespace cadmorph
