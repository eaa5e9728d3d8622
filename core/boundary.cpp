#include "core/boundary.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <span>
#include <string>
#include <utility>

#include "core/cell_faces.h"
#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/quality.h"

namespace cadmorph {
namespace {

constexpr Index kGrain = 1 << 14;  // cells a task

/// A face to keep, with the cell on its other side (-1: none).
struct Kept {
  Index cell, local, neighbour;
};

std::string joined(const std::vector<Index>& ids) {
  std::string text;
  for (Index id : ids) text.append(" ").append(std::to_string(id));
  return text;
}

void check_overlap(const Mesh& mesh, const CellNeighbours& neighbours) {
  if (neighbours.overlapping.empty()) return;
  const std::vector<Facet> facets = cell_facets(mesh, neighbours.overlapping.front());
  const Facet& facet = facets[neighbours.overlapping_face];
  std::vector<Index> corners(facet.nodes);
  corners.resize(corner_count(facet.type, std::ssize(facet.nodes)));
  throw InvalidInputError("more than two cells share the face of nodes" + joined(corners) +
                          ": cells" + joined(neighbours.overlapping) +
                          "; remove duplicate or overlapping cells from the mesh");
}

/// Whether a face of a cell lies on parts inside of the mesh.
bool is_on_part(const Mesh& mesh, Index cell, Index local, const std::vector<char>& parts) {
  const Facet facet = cell_facets(mesh, cell)[static_cast<std::size_t>(local)];
  const auto corners =
      std::span(facet.nodes)
          .first(static_cast<std::size_t>(corner_count(facet.type, std::ssize(facet.nodes))));
  return std::ranges::all_of(corners, [&](Index node) { return parts[node] != 0; });
}

/// The shell cells of a mesh with solids.
class Shells {
 public:
  explicit Shells(const Mesh& mesh) : mesh_(mesh) {
    for (Index c = 0; c < mesh.cell_count(); ++c)
      if (dimension(mesh.types[c]) == 2) cells_.push_back(c);
    if (cells_.empty()) return;
    is_of_solid_.assign(static_cast<std::size_t>(mesh.node_count()), 0);
    for (Index c = 0; c < mesh.cell_count(); ++c)
      if (dimension(mesh.types[c]) == 3)
        for (const Index node : mesh.cell(c)) is_of_solid_[node] = 1;
    for (const Index c : cells_)
      if (is_on_solids(c)) on_solids_.push_back(key_of(mesh.types[c], mesh.cell(c)));
    std::ranges::sort(on_solids_);
  }

  /// Those that stand apart from the solids, or touch them along edges alone.
  std::vector<Index> sheets() const {
    std::vector<Index> result;
    for (const Index c : cells_)
      if (!is_on_solids(c)) result.push_back(c);
    return result;
  }

  /// The faces between two cells of a region that one lies on. `outer`: those on the outside.
  std::vector<Kept> inner_faces(const CellNeighbours& neighbours, const std::vector<Kept>& outer) {
    drop(outer);
    std::vector<Kept> result;
    if (on_solids_.empty()) return result;
    for (Index c = 0; c < mesh_.cell_count(); ++c) {
      const auto is_of_shell = [&](Index node) { return is_of_shell_[node] != 0; };
      if (dimension(mesh_.types[c]) < 3 || std::ranges::count_if(mesh_.cell(c), is_of_shell) < 3)
        continue;
      const std::vector<Facet> facets = cell_facets(mesh_, c);
      for (Index f = 0; f < std::ssize(facets); ++f) {
        const Index other = neighbours.neighbour[neighbours.offsets[c] + f];
        if (c < other && mesh_.region(c) == mesh_.region(other) &&
            std::ranges::binary_search(on_solids_, key_of(facets[f].type, facets[f].nodes)))
          result.push_back({c, f, other});
      }
    }
    return result;
  }

 private:
  // The least four corners, ascending, and -1 where there are three: they tell a face from all
  // others.
  using Key = std::array<Index, 4>;

  static std::span<const Index> corners_of(CellType type, std::span<const Index> nodes) {
    return nodes.first(static_cast<std::size_t>(corner_count(type, std::ssize(nodes))));
  }

  static Key key_of(CellType type, std::span<const Index> nodes) {
    Key key;
    key.fill(-1);
    std::ranges::partial_sort_copy(corners_of(type, nodes), key);
    return key;
  }

  bool is_on_solids(Index shell) const {
    return std::ranges::all_of(corners_of(mesh_.types[shell], mesh_.cell(shell)),
                               [&](Index node) { return is_of_solid_[node] != 0; });
  }

  // Leaves those that do not lie on outer faces.
  void drop(const std::vector<Kept>& outer) {
    if (on_solids_.empty()) return;
    std::vector<char> is_outer(on_solids_.size(), 0);
    parallel_for(std::ssize(outer), kGrain / 16, [&](Index begin, Index end) {
      for (const Kept& face :
           std::span(outer).subspan(std::size_t(begin), std::size_t(end - begin))) {
        if (face.neighbour >= 0) continue;
        const Facet facet = cell_facets(mesh_, face.cell)[static_cast<std::size_t>(face.local)];
        for (const Key& same :
             std::ranges::equal_range(on_solids_, key_of(facet.type, facet.nodes)))
          std::atomic_ref<char>{is_outer[static_cast<std::size_t>(&same - on_solids_.data())]} = 1;
      }
    });
    std::vector<Key> inside;
    for (std::size_t i = 0; i < on_solids_.size(); ++i)
      if (!is_outer[i]) inside.push_back(on_solids_[i]);
    on_solids_ = std::move(inside);
    if (on_solids_.empty()) return;
    is_of_shell_.assign(static_cast<std::size_t>(mesh_.node_count()), 0);
    for (const Key& key : on_solids_)
      for (const Index node : key)
        if (node >= 0) is_of_shell_[node] = 1;
  }

  const Mesh& mesh_;
  std::vector<Index> cells_;                     ///< ascending
  std::vector<char> is_of_solid_, is_of_shell_;  ///< of all nodes
  std::vector<Key> on_solids_;                   ///< of those with all corners on solids, in order
};

/// Faces used by one cell, those between regions, those on parts inside and those that a shell cell
/// lies on, in the order of their cells.
std::vector<Kept> select_faces(const Mesh& mesh, const CellNeighbours& neighbours,
                               const std::vector<char>& parts, const std::vector<InnerFace>& named,
                               Shells& shells) {
  const Index cells = mesh.cell_count();
  std::vector<std::vector<Kept>> found((cells + kGrain - 1) / kGrain);
  parallel_for(cells, kGrain, [&](Index begin, Index end) {
    std::vector<Kept>& some = found[begin / kGrain];
    for (Index c = begin; c < end; ++c)
      for (Index f = neighbours.offsets[c]; f < neighbours.offsets[c + 1]; ++f) {
        const Index other = neighbours.neighbour[f], local = f - neighbours.offsets[c];
        const bool is_part = !parts.empty() && c < other && mesh.region(c) == mesh.region(other) &&
                             is_on_part(mesh, c, local, parts);
        if (other < 0 || is_part || mesh.region(c) < mesh.region(other))
          some.push_back({c, local, other});
      }
  });
  std::vector<Kept> kept;
  for (const auto& some : found) kept.insert(kept.end(), some.begin(), some.end());
  std::vector<Kept> inner = shells.inner_faces(neighbours, kept);
  for (const auto& [cell, local] : named)
    inner.push_back({cell, local, neighbours.of(cell)[static_cast<std::size_t>(local)]});
  if (inner.empty()) return kept;
  kept.insert(kept.end(), inner.begin(), inner.end());
  const auto place = [](const Kept& face) { return std::pair(face.cell, face.local); };
  std::ranges::sort(kept, {}, place);
  kept.erase(std::ranges::unique(kept, {}, place).begin(), kept.end());
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

/// A shell cell as a facet.
Facet shell_facet(const Mesh& mesh, Index c) {
  Facet facet{mesh.types[c], {mesh.cell(c).begin(), mesh.cell(c).end()}};
  if (facet.type == CellType::Pixel) {
    facet.type = CellType::Quad;
    std::swap(facet.nodes[2], facet.nodes[3]);
  }
  return facet;
}

void append(Boundary& boundary, const Facet& facet, Index cell, Index neighbour) {
  boundary.types.push_back(facet.type);
  boundary.connectivity.insert(boundary.connectivity.end(), facet.nodes.begin(), facet.nodes.end());
  boundary.offsets.push_back(static_cast<Index>(boundary.connectivity.size()));
  boundary.cell.push_back(cell);
  boundary.neighbour.push_back(neighbour);
}

Boundary solid_boundary(const Mesh& mesh, const CellNeighbours& neighbours,
                        const std::vector<char>& parts, const std::vector<InnerFace>& inner) {
  check_overlap(mesh, neighbours);
  Boundary boundary;
  boundary.offsets = {0};
  const Orientation orientation = detect_orientation(mesh);
  Index cell = -1;
  std::vector<Facet> facets;
  Shells shells(mesh);
  for (const Kept& kept : select_faces(mesh, neighbours, parts, inner, shells)) {
    if (kept.cell != cell) {
      cell = kept.cell;
      facets = cell_facets(mesh, cell);
    }
    Facet& facet = facets[kept.local];
    if (orientation[static_cast<std::size_t>(mesh.types[cell])] < 0) reverse(facet);
    drop_repeated_corner(facet);
    append(boundary, facet, cell, kept.neighbour);
  }
  // As inner faces are: nodes that lie on no CAD face follow the solids.
  for (const Index c : shells.sheets()) append(boundary, shell_facet(mesh, c), c, c);
  return boundary;
}

Boundary shell_boundary(const Mesh& mesh) {
  Boundary boundary;
  boundary.offsets = {0};
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 2) continue;
    append(boundary, shell_facet(mesh, c), c, -1);
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
  return extract_boundary(mesh,
                          dimension(mesh) == 3 ? find_cell_neighbours(mesh) : CellNeighbours());
}

Boundary extract_boundary(const Mesh& mesh, const CellNeighbours& neighbours,
                          const std::vector<char>& parts, const std::vector<InnerFace>& inner) {
  const int highest = dimension(mesh);
  if (highest < 2)
    throw InvalidInputError(
        "the mesh has neither solid nor shell cells, so it has no surface to morph");
  Boundary boundary =
      highest == 3 ? solid_boundary(mesh, neighbours, parts, inner) : shell_boundary(mesh);
  boundary.nodes = used_nodes(boundary, mesh.node_count());
  return boundary;
}

Boundary corners_alone(const Boundary& boundary) {
  Boundary result = boundary;
  keep_corners(result.types, result.offsets, result.connectivity);
  return result;
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
