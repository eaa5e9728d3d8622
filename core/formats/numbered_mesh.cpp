#include "core/formats/numbered_mesh.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>

#include "core/cell_topology.h"
#include "core/formats/mid_node_order.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

// Of an element's longest edge: coordinates of the two sides may be rounded differently.
constexpr double kNoThickness = 1e-6;

/// The node of each row: rows of one number are one node.
std::vector<Index> nodes_of_rows(const NumberedMesh& part, const NumberTable& table,
                                 Index first_node, const DeckSources& sources) {
  const auto place_of = [&](Index row) {
    for (const NodeRecords& block : part.records) {
      const auto found = std::ranges::lower_bound(block.nodes, row);
      if (found != block.nodes.end() && *found == row)
        return DeckPlace{block.file, block.places[std::size_t(found - block.nodes.begin())].place};
    }
    return DeckPlace{};
  };
  std::vector<Index> nodes(part.node_numbers.size());
  if (table.double_item() < 0) {
    std::iota(nodes.begin(), nodes.end(), first_node);
    return nodes;
  }
  Index next = first_node;
  for (std::size_t row = 0; row < nodes.size(); ++row) {
    const auto first = std::size_t(table.find(part.node_numbers[row]));
    if (first == row) {
      nodes[row] = next++;
      continue;
    }
    nodes[row] = nodes[first];
    for (std::size_t c = 0; c < 3; ++c)
      if (part.coordinates[3 * row + c] != part.coordinates[3 * first + c])
        sources.fail(place_of(Index(row)),
                     "node " + std::to_string(part.node_numbers[row]) +
                         " is defined before, at another place: leave one of the "
                         "two definitions out");
  }
  return nodes;
}

void append_points(const NumberedMesh& part, const std::vector<NodeFrame>& frames,
                   const std::vector<Index>& nodes, std::vector<double>& points,
                   Numbering& numbers) {
  Index next = std::ssize(points) / 3;
  points.reserve(points.size() + part.coordinates.size());
  for (std::size_t row = 0; row < nodes.size(); ++row) {
    if (nodes[row] != next) continue;
    Eigen::RowVector3d point = Eigen::RowVector3d::Map(part.coordinates.data() + 3 * row);
    for (const NodeFrame& frame : frames) point = frame.to_mesh(point);
    points.insert(points.end(), point.data(), point.data() + 3);
    numbers.push_back(part.node_numbers[row]);
    ++next;
  }
}

/// Appends values, or takes them all where there are none before.
template <class Value>
void append(std::vector<Value> more, std::vector<Value>& values) {
  if (values.empty())
    values = std::move(more);
  else
    values.insert(values.end(), more.begin(), more.end());
}

/// Turns the numbers of the nodes of cells into nodes, from a place in the connectivity on; returns
/// the first place that has a number of no node, or the end.
Index number_nodes(const NumberTable& table, const std::vector<Index>& nodes, Index from,
                   std::vector<Index>& connectivity) {
  std::atomic<Index> wrong = std::ssize(connectivity);
  parallel_for(wrong - from, 1 << 16, [&](Index begin, Index end) {
    for (Index i = from + begin; i < from + end; ++i) {
      Index& node = connectivity[std::size_t(i)];
      const Index row = table.find(node);
      if (row >= 0) {
        node = nodes[std::size_t(row)];
        continue;
      }
      for (Index known = wrong; i < known && !wrong.compare_exchange_weak(known, i);) continue;
      return;
    }
  });
  return wrong;
}

void append_cells(NumberedMesh& part, const NumberTable& table, const std::vector<Index>& nodes,
                  const DeckSources& sources, Mesh& mesh) {
  const Index first_cell = mesh.cell_count(), first = std::ssize(mesh.connectivity);
  for (const Index number : part.element_numbers) mesh.cell_numbers.push_back(number);
  append(std::move(part.types), mesh.types);
  append(std::move(part.regions), mesh.regions);
  append(std::move(part.connectivity), mesh.connectivity);
  if (first_cell > 0) {
    for (Index& offset : part.offsets) offset += first;
    mesh.offsets.pop_back();
  } else {
    mesh.offsets.clear();
  }
  append(std::move(part.offsets), mesh.offsets);
  const Index wrong = number_nodes(table, nodes, first, mesh.connectivity);
  if (wrong == std::ssize(mesh.connectivity)) return;
  const auto end = std::upper_bound(mesh.offsets.begin() + first_cell, mesh.offsets.end(), wrong);
  const auto element = std::size_t(end - mesh.offsets.begin() - first_cell - 1);
  sources.fail(part.places[element], "element " + std::to_string(part.element_numbers[element]) +
                                         " uses node " +
                                         std::to_string(mesh.connectivity[std::size_t(wrong)]) +
                                         ", which is not defined");
}

/// Numbers that nothing has are left out, as the solvers do.
void append_sets(const NumberedMesh& part, const MeshAssembly::Placed& placed, Mesh& mesh) {
  const bool has_elements =
      std::ranges::any_of(part.sets, [](const NumberedSet& set) { return set.is_of_elements; });
  const NumberTable elements = has_elements ? NumberTable(part.element_numbers) : NumberTable();
  GroupNodes nodes(placed.nodes.empty() ? 0 : std::ranges::max(placed.nodes) + 1);
  for (const NumberedSet& set : part.sets) {
    const auto add_row = [&](Index row) {
      if (row < 0) return;
      if (set.is_of_elements)
        nodes.add(mesh.cell(placed.first_cell + row));
      else
        nodes.add(placed.nodes[std::size_t(row)]);
    };
    for (const Index number : set.numbers)
      add_row(set.is_of_elements ? elements.find(number) : placed.rows.find(number));
    for (const Index row : set.rows) add_row(row);
    NodeGroup group{.name = set.name, .kind = set.kind, .nodes = nodes.take()};
    if (!group.nodes.empty()) mesh.groups.push_back(std::move(group));
  }
}

/// Numbers that no node has are left out here, too.
void append_ties(const NumberedMesh& part, const MeshAssembly::Placed& placed, Mesh& mesh) {
  const auto node_of = [&](Index number) {
    const Index row = placed.rows.find(number);
    return row < 0 ? -1 : placed.nodes[std::size_t(row)];
  };
  for (const NumberedTie& numbered : part.ties) {
    Tie tie{.node = node_of(numbered.node), .others = {}};
    for (const Index number : numbered.others)
      if (const Index node = node_of(number); node >= 0) tie.others.push_back(node);
    if (tie.node >= 0 && !tie.others.empty()) mesh.ties.push_back(std::move(tie));
  }
}

// Cohesive elements as decks have them: two opposite faces of a hexahedron or a wedge lie on each
// other, the nodes of the one on those of the other.
bool has_no_thickness(const Mesh& mesh, Index cell) {
  const CellInfo& info = info_of(mesh.types[cell]);
  if (info.shape != Shape::Cube && info.shape != Shape::Prism) return false;
  const auto nodes = mesh.cell(cell);
  const auto half = std::size_t(info.corners) / 2;
  double longest = 0, thickness = 0;
  for (std::size_t i = 0; i < half; ++i) {
    const auto at = mesh.points.row(nodes[i]);
    longest = std::max(longest, (at - mesh.points.row(nodes[(i + 1) % half])).norm());
    thickness = std::max(thickness, (at - mesh.points.row(nodes[i + half])).norm());
  }
  return thickness <= kNoThickness * longest;
}

// They have no volume that a morph could keep: the two sides stay together without them.
std::vector<std::string> take_out_cells_without_thickness(Mesh& mesh) {
  std::vector<char> is_flat(mesh.types.size());
  parallel_for(mesh.cell_count(), 4096, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) is_flat[std::size_t(c)] = has_no_thickness(mesh, c);
  });
  const auto count = std::ranges::count(is_flat, 1);
  if (count == 0 || count == mesh.cell_count()) return {};
  Mesh kept;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (is_flat[std::size_t(c)]) continue;
    add_cell(kept, mesh.types[c], mesh.cell(c));
    if (!mesh.regions.empty()) kept.regions.push_back(mesh.regions[c]);
    kept.cell_numbers.push_back(mesh.cell_numbers[c]);
  }
  mesh.types = std::move(kept.types);
  mesh.offsets = std::move(kept.offsets);
  mesh.connectivity = std::move(kept.connectivity);
  mesh.regions = std::move(kept.regions);
  mesh.cell_numbers = std::move(kept.cell_numbers);
  return {std::to_string(count) +
          " elements of no thickness (cohesive ones) are no cells of the mesh; their nodes follow "
          "the others"};
}

}  // namespace

void NumberedMesh::add_node(Index number, const Eigen::RowVector3d& point) {
  node_numbers.push_back(number);
  coordinates.insert(coordinates.end(), point.data(), point.data() + 3);
}

void NumberedMesh::add_element(Index number, CellType type, std::span<const Index> nodes,
                               int region, DeckPlace place) {
  element_numbers.push_back(number);
  types.push_back(type);
  connectivity.insert(connectivity.end(), nodes.begin(), nodes.end());
  offsets.push_back(std::ssize(connectivity));
  regions.push_back(region);
  places.push_back(place);
}

void NumberedMesh::append_elements(const NumberedMesh& piece, Index first, Index last) {
  const auto append = [](const auto& from, Index begin, Index end, auto& to) {
    to.insert(to.end(), from.begin() + begin, from.begin() + end);
  };
  append(piece.element_numbers, first, last, element_numbers);
  append(piece.types, first, last, types);
  append(piece.regions, first, last, regions);
  append(piece.places, first, last, places);
  const Index first_node = piece.offsets[std::size_t(first)];
  const Index shift = std::ssize(connectivity) - first_node;
  append(piece.connectivity, first_node, piece.offsets[std::size_t(last)], connectivity);
  for (Index e = first; e < last; ++e) offsets.push_back(piece.offsets[std::size_t(e) + 1] + shift);
}

void NumberedMesh::reserve_elements(const NumberedMesh& piece, double pieces_to_come) {
  const double pieces = 1 + 1.1 * pieces_to_come;  // a reserve for those that are a little larger
  const auto reserve = [pieces](const auto& of_piece, auto& values) {
    if (values.size() + of_piece.size() <= values.capacity()) return;
    const auto more = std::size_t(pieces * double(of_piece.size()));
    // Twice as much as before, at least: little more each time would move all values each time.
    values.reserve(std::max(values.size() + more, 2 * values.capacity()));
  };
  reserve(piece.element_numbers, element_numbers);
  reserve(piece.types, types);
  reserve(piece.regions, regions);
  reserve(piece.places, places);
  reserve(piece.offsets, offsets);
  reserve(piece.connectivity, connectivity);
}

void NumberedMesh::reserve_nodes(std::size_t more) {
  node_numbers.reserve(node_numbers.size() + more);
  coordinates.reserve(coordinates.size() + 3 * more);
}

void NumberedMesh::clear_elements() {
  element_numbers.clear();
  types.clear();
  regions.clear();
  places.clear();
  offsets.resize(1);
  connectivity.clear();
}

MeshAssembly::Placed MeshAssembly::add(NumberedMesh part, const std::vector<NodeFrame>& frames) {
  Placed placed{
      .rows = NumberTable(part.node_numbers), .nodes = {}, .first_cell = mesh_.cell_count()};
  placed.nodes = nodes_of_rows(part, placed.rows, std::ssize(points_) / 3, sources_);
  append_points(part, frames, placed.nodes, points_, mesh_.node_numbers);
  append_cells(part, placed.rows, placed.nodes, sources_, mesh_);
  append_sets(part, placed, mesh_);
  append_ties(part, placed, mesh_);
  for (NodeRecords& block : part.records) {
    for (Index& node : block.nodes) node = placed.nodes[std::size_t(node)];
    block.frames.insert(block.frames.end(), frames.begin(), frames.end());
    records_.push_back(std::move(block));
  }
  return placed;
}

void MeshAssembly::order_mid_nodes(CellType type) {
  cadmorph::order_mid_nodes(mesh_, Eigen::Map<const Points>(points_.data(), node_count(), 3), type);
}

ReadMesh MeshAssembly::finish(DeckSources sources, const std::string& region_array) {
  if (points_.empty()) sources.fail({}, "there are no nodes in it");
  ReadMesh result;
  mesh_.points = Eigen::Map<const Points>(points_.data(), std::ssize(points_) / 3, 3);
  result.remarks = take_out_cells_without_thickness(mesh_);
  const auto is_first = [&](int region) { return region == mesh_.regions[0]; };
  if (mesh_.regions.empty() || std::ranges::all_of(mesh_.regions, is_first))
    mesh_.regions.clear();
  else
    mesh_.region_array = region_array;
  tidy_groups(mesh_);
  for (const std::string& name : sources.left_behind())
    result.remarks.push_back(
        "the included file " + name +
        " is not copied: a copy in another folder has to find it by that name");
  if (sources.has_repeats())
    for (NodeRecords& block : records_) block.is_shared = true;
  result.mesh = std::move(mesh_);
  result.copier = make_deck_copier(std::move(sources).take_files(), std::move(records_));
  return result;
}

void remark_on_left_out(const std::map<std::string, Index>& counts,
                        std::vector<std::string>& remarks) {
  std::string text;
  for (const auto& [kind, count] : counts)
    if (count > 0) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + kind;
  if (!text.empty())
    remarks.push_back(
        "elements that are no cells of the mesh, whose nodes move with what is next to them or "
        "tied "
        "to them: " +
        text);
}

}  // namespace cadmorph
