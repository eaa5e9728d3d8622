#include "volume/wall_rows.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "core/cell_topology.h"
#include "core/least_squares.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// Rows across a wall have at most kMostCells cells. Rows of up to kFarthest are followed, too, to
// tell along a wall from across it. With 8 or 32 for 16 a bore, a pipe and a canister of hexahedra
// come out the same; the tests of rows pass with 4, or 16 or 64 for 32.
constexpr std::size_t kMostCells = 16, kFarthest = 32;
// A row goes across where it is at most this part as long as the next shortest through its nodes.
// With 1 a cube of 4 x 4 x 4 cells is a wall; with 1/4 those hexahedra come out the same.
constexpr double kThin = 0.5;
// Off the line between its ends, of its length. With any, rows bent to a sine count, too; with
// half or twice of it those hexahedra come out the same.
constexpr double kStraight = 0.1;
// Largest height of a cell over the smallest: layers towards a wall grow by 1.1 or more.
constexpr double kEven = 1.1;

// A face of a cell type and the one that has no node in common with it.
struct Across {
  int far_face = -1;
  int count = 0;
  std::array<std::uint8_t, 4> near = {}, far = {};  ///< corners, joined by edges
};

bool has(const LocalFace& face, int node) {
  const auto corners =
      std::span(face.nodes).first(static_cast<std::size_t>(corner_count(face.type, face.count)));
  return std::ranges::find(corners, node) != corners.end();
}

Across across(CellType type, int face) {
  const CellInfo& info = info_of(type);
  Across result;
  const LocalFace& near = info.faces[static_cast<std::size_t>(face)];
  for (std::size_t f = 0; f < info.faces.size(); ++f) {
    bool is_apart = true;
    for (int n = 0; n < info.corners; ++n) is_apart &= !(has(near, n) && has(info.faces[f], n));
    if (is_apart) result.far_face = static_cast<int>(f);
  }
  if (result.far_face < 0) return result;
  const LocalFace& far = info.faces[static_cast<std::size_t>(result.far_face)];
  for (const LocalEdge& edge : info.edges)
    for (const auto& [a, b] : {std::pair(edge.a, edge.b), std::pair(edge.b, edge.a)})
      if (has(near, a) && has(far, b)) {
        result.near[static_cast<std::size_t>(result.count)] = a;
        result.far[static_cast<std::size_t>(result.count++)] = b;
      }
  return result;
}

class RowFinder {
 public:
  RowFinder(const Mesh& mesh, const CellNeighbours& neighbours, const Points& points)
      : mesh_(mesh), neighbours_(neighbours), points_(points) {}

  std::vector<NodeRow> across_walls(std::span<const NodeRow> swept) {
    find_starts([](Index) { return true; });
    for (const Start& start : starts_) walk(start, kFarthest);
    std::vector<char> is_swept(static_cast<std::size_t>(mesh_.node_count()), 0);
    for (const NodeRow& row : swept)
      for (const Index n : row) is_swept[n] = 1;
    std::erase_if(rows_, [&](const NodeRow& row) {
      return std::ranges::any_of(inner(row), [&](Index n) { return is_swept[n]; });
    });
    keep_across();
    std::erase_if(rows_, [](const NodeRow& row) { return row.size() > kMostCells + 1; });
    return std::move(rows_);
  }

  std::vector<NodeRow> from_image_to_image(std::vector<SheetNode> sheets) {
    std::ranges::sort(sheets, {}, &SheetNode::node);
    const auto at = [&](Index n) {
      return std::ranges::equal_range(sheets, n, {}, &SheetNode::node);
    };
    find_starts([&](Index n) { return !at(n).empty(); });
    for (const Start& start : starts_) walk(start, static_cast<std::size_t>(mesh_.node_count()));

    // A family is swept where each of its places that a cell stands on has a row.
    std::map<Index, Family> families;
    for (const Start& start : starts_)
      for (const SheetNode& from : at(std::get<0>(start)))
        families[from.family].places.insert(from.place);
    const auto for_families = [&](const NodeRow& row, const auto& act) {
      for (const SheetNode& from : at(row.front()))
        for (const SheetNode& to : at(row.back()))
          if (from.family == to.family && from.place == to.place) act(families[from.family], from);
    };
    for (const NodeRow& row : rows_)
      for_families(row, [&](Family& family, const SheetNode& from) {
        family.places_with_row.insert(from.place);
        family.nodes += std::ssize(row);
      });
    const auto nodes_of_sweep = [&](const NodeRow& row) {
      Index most = 0;
      for_families(row, [&](const Family& family, const SheetNode&) {
        if (family.places_with_row.size() == family.places.size())
          most = std::max(most, family.nodes);
      });
      return most;
    };
    std::vector<Index> most(static_cast<std::size_t>(mesh_.node_count()), 0);
    for (const NodeRow& row : rows_) {
      const Index nodes = nodes_of_sweep(row);
      for (const Index n : row) most[n] = std::max(most[n], nodes);
    }
    std::erase_if(rows_, [&](const NodeRow& row) {
      const Index nodes = nodes_of_sweep(row);
      return nodes == 0 ||
             std::ranges::any_of(inner(row), [&](Index n) { return nodes < most[n]; });
    });
    keep_across();
    return std::move(rows_);
  }

 private:
  // A node of the surface, the next one inwards, and the cell and face to go in by.
  using Start = std::tuple<Index, Index, Index, int>;

  struct Family {
    std::set<Index> places, places_with_row;
    Index nodes = 0;  ///< of its rows
  };

  bool can_pass(Index cell) const {
    const Shape shape = info_of(mesh_.types[cell]).shape;
    return shape == Shape::Cube || shape == Shape::Prism;
  }

  Index beyond(Index cell, int face) const {
    return neighbours_.neighbour[neighbours_.offsets[cell] + face];
  }

  const Across& across_of(Index cell, int face) {
    auto& known =
        across_[static_cast<std::size_t>(mesh_.types[cell])][static_cast<std::size_t>(face)];
    if (!known) known = across(mesh_.types[cell], face);
    return *known;
  }

  Index node(Index cell, int local) const {
    return mesh_.connectivity[mesh_.offsets[cell] + local];
  }

  static std::span<const Index> inner(const NodeRow& row) {
    return std::span(row).subspan(1, row.size() - 2);
  }

  void find_starts(const auto& may_start) {
    for (Index cell = 0; cell < mesh_.cell_count(); ++cell) {
      if (!can_pass(cell)) continue;
      const Index faces = neighbours_.offsets[cell + 1] - neighbours_.offsets[cell];
      for (int face = 0; face < faces; ++face) {
        if (beyond(cell, face) != -1) continue;
        const Across& to = across_of(cell, face);
        for (int i = 0; to.far_face >= 0 && i < to.count; ++i)
          if (may_start(node(cell, to.near[i])))
            starts_.emplace_back(node(cell, to.near[i]), node(cell, to.far[i]), cell, face);
      }
    }
    std::ranges::sort(starts_);
    const auto twins = std::ranges::unique(starts_, {}, [](const Start& start) {
      return std::pair(std::get<0>(start), std::get<1>(start));
    });
    starts_.erase(twins.begin(), twins.end());
  }

  void walk(const Start& start, std::size_t most_cells) {
    auto [first, second, cell, face] = start;
    NodeRow row = {first};
    while (row.size() <= most_cells) {
      const Across& to = across_of(cell, face);
      const auto near = std::find_if(to.near.begin(), to.near.begin() + to.count,
                                     [&](int i) { return node(cell, i) == row.back(); });
      if (near == to.near.begin() + to.count) return;  // a collapsed cell
      row.push_back(node(cell, to.far[static_cast<std::size_t>(near - to.near.begin())]));
      const Index next = beyond(cell, to.far_face);
      if (next < 0) {
        if (row.size() > 2 && row.front() < row.back()) rows_.push_back(std::move(row));
        return;
      }
      if (next == cell || !can_pass(next)) return;
      for (face = 0; beyond(next, face) != cell;) ++face;
      cell = next;
      if (across_of(cell, face).far_face < 0) return;  // in through the side of a wedge
    }
  }

  double length(const NodeRow& row) const {
    return (points_.row(row.back()) - points_.row(row.front())).norm();
  }

  bool is_straight(const NodeRow& row) const {
    const Vector3d start = points_.row(row.front());
    const Vector3d along = (Vector3d(points_.row(row.back())) - start).normalized();
    return std::ranges::all_of(row, [&](Index n) {
      const Vector3d way = Vector3d(points_.row(n)) - start;
      return (way - way.dot(along) * along).norm() <= kStraight * length(row);
    });
  }

  // Of the rows through a node the one that is much the shortest goes across the wall.
  void keep_across() {
    std::vector<std::array<double, 2>> shortest(static_cast<std::size_t>(mesh_.node_count()));
    for (const NodeRow& row : rows_) {
      const double own = length(row);
      for (const Index n : row) {
        auto& [least, next] = shortest[static_cast<std::size_t>(n)];
        if (least == 0 || own < least)
          next = std::exchange(least, own);
        else if (next == 0 || own < next)
          next = own;
      }
    }
    std::erase_if(rows_, [&](const NodeRow& row) {
      const double own = length(row);
      const bool is_across = std::ranges::all_of(inner(row), [&](Index n) {
        const auto& [least, next] = shortest[static_cast<std::size_t>(n)];
        return own == least && (next == 0 || own <= kThin * next);
      });
      return !is_across || !is_straight(row);
    });
  }

  const Mesh& mesh_;
  const CellNeighbours& neighbours_;
  const Points& points_;
  std::array<std::array<std::optional<Across>, 6>, 128> across_;  ///< by type and face
  std::vector<Start> starts_;
  std::vector<NodeRow> rows_;
};

}  // namespace

std::vector<NodeRow> find_wall_rows(const Mesh& mesh, const CellNeighbours& neighbours,
                                    const Points& points, std::span<const NodeRow> swept) {
  if (neighbours.neighbour.empty()) return {};
  return RowFinder(mesh, neighbours, points).across_walls(swept);
}

std::vector<NodeRow> find_swept_rows(const Mesh& mesh, const CellNeighbours& neighbours,
                                     const Points& points, std::vector<SheetNode> sheets) {
  if (neighbours.neighbour.empty() || sheets.empty()) return {};
  return RowFinder(mesh, neighbours, points).from_image_to_image(std::move(sheets));
}

Points straight_places(const NodeRow& row, const Points& before, const Points& after) {
  const Vector3d start = before.row(row.front()), to = after.row(row.front());
  const Vector3d along = Vector3d(before.row(row.back())) - start;
  const Vector3d along_after = Vector3d(after.row(row.back())) - to;
  const Eigen::Matrix3d turn = rotation_between(along, along_after);
  const double scale = along_after.norm() / along.norm();
  Points result(std::ssize(row) - 2, 3);
  for (Index i = 0; i < result.rows(); ++i) {
    const Vector3d way = Vector3d(before.row(row[static_cast<std::size_t>(i) + 1])) - start;
    const double share = way.dot(along) / along.squaredNorm();
    result.row(i) = to + share * along_after + scale * (turn * (way - share * along));
  }
  return result;
}

bool is_even(const NodeRow& row, const Points& points) {
  double least = 0, most = 0;
  for (std::size_t i = 1; i < row.size(); ++i) {
    const double gap = (points.row(row[i]) - points.row(row[i - 1])).norm();
    least = i == 1 ? gap : std::min(least, gap);
    most = std::max(most, gap);
  }
  return most < kEven * least;
}

double deviation(const NodeRow& row, const Points& before, const Points& after) {
  const Points places = straight_places(row, before, after);
  double largest = 0;
  for (Index i = 0; i < places.rows(); ++i)
    largest =
        std::max(largest, (places.row(i) - after.row(row[static_cast<std::size_t>(i) + 1])).norm());
  return largest / (after.row(row.back()) - after.row(row.front())).norm();
}

}  // namespace cadmorph
