#include "models/median_dual.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <vector>

#include "core/boundary.h"

namespace cadmorph::models {
namespace {

using Point = Eigen::Vector3d;
using Edge = std::pair<Index, Index>;

class Dual {
 public:
  Dual(const Mesh& tets, const PlaceDualNode& place) : tets_(tets), place_(place) {
    faces_.resize(static_cast<std::size_t>(tets.node_count()));
    for (Index c = 0; c < tets.cell_count(); ++c) add_node(tets.cell(c));
    for (Index c = 0; c < tets.cell_count(); ++c) {
      for (const Facet& facet : cell_facets(tets, c)) add_triangle(c, facet.nodes);
    }
    add_boundary();
    for (const auto& [edge, links] : links_) add_edge_face(edge, links);
  }

  Mesh mesh() const {
    Mesh dual;
    dual.points.resize(static_cast<Index>(points_.size()), 3);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      dual.points.row(static_cast<Index>(i)) = points_[i].transpose();
    }
    dual.offsets = {0};
    dual.polyhedron_offsets = {0};
    for (const auto& faces : faces_) append_cell(faces, dual);
    return dual;
  }

 private:
  using Face = std::vector<Index>;
  using Triangle = std::array<Index, 3>;

  Point mean(std::span<const Index> nodes) const {
    Point sum(0, 0, 0);
    for (const Index node : nodes) sum += tets_.points.row(node).transpose();
    return sum / static_cast<double>(nodes.size());
  }

  Index add_point(const Point& point) {
    points_.push_back(point);
    return static_cast<Index>(points_.size()) - 1;
  }

  /// Links the middles on both sides of a triangle about each of its edges.
  void link(const Triangle& nodes, Index one, Index other) {
    for (int i = 0; i < 3; ++i) {
      links_[std::minmax(nodes[i], nodes[(i + 1) % 3])].emplace_back(one, other);
    }
  }

  void add_triangle(Index cell, const std::vector<Index>& nodes) {
    Triangle sorted = {nodes[0], nodes[1], nodes[2]};
    std::ranges::sort(sorted);
    const auto [entry, is_new] =
        open_.try_emplace(sorted, cell, Triangle{nodes[0], nodes[1], nodes[2]});
    if (is_new) return;
    link(sorted, entry->second.first, cell);
    open_.erase(entry);
  }

  Index add_node(std::span<const Index> nodes) {
    return add_point(nodes.size() == 1 ? mean(nodes) : place_(nodes, mean(nodes)));
  }

  /// Middle of a boundary edge, or a boundary node itself.
  Index node_of(Index a, Index b) {
    const auto [entry, is_new] = edge_nodes_.try_emplace(std::minmax(a, b), -1);
    if (is_new) {
      const std::array nodes = {a, b};
      entry->second = add_node(std::span(nodes).first(a == b ? 1 : 2));
    }
    return entry->second;
  }

  /// Puts a quadrangle in each corner of each triangle that is still open.
  void add_boundary() {
    for (const auto& [sorted, owner] : open_) {
      const auto& [cell, nodes] = owner;
      const Index middle = add_node(nodes);
      link(sorted, cell, middle);
      for (int i = 0; i < 3; ++i) {
        const Index here = nodes[i], after = nodes[(i + 1) % 3], before = nodes[(i + 2) % 3];
        links_[std::minmax(here, after)].emplace_back(middle, node_of(here, after));
        faces_[here].push_back(
            {node_of(here, here), node_of(here, after), middle, node_of(before, here)});
      }
    }
  }

  /// Chains the links around an edge to the face between its two ends' cells.
  void add_edge_face(const Edge& edge, const std::vector<std::pair<Index, Index>>& links) {
    std::map<Index, std::vector<Index>> next;
    for (const auto& [a, b] : links) {
      next[a].push_back(b);
      next[b].push_back(a);
    }
    Face face = {next.begin()->first};
    for (Index before = -1; face.size() < next.size();) {
      const std::vector<Index>& ways = next.at(face.back());
      const Index here = face.back();
      face.push_back(ways[0] == before ? ways[1] : ways[0]);
      before = here;
    }
    if (is_turned(edge, face)) std::ranges::reverse(face);
    faces_[edge.first].push_back(face);
    std::ranges::reverse(face);
    faces_[edge.second].push_back(face);
  }

  /// Whether a face's normal points from the edge's second end to its first.
  bool is_turned(const Edge& edge, const Face& face) const {
    Point area(0, 0, 0);
    for (std::size_t i = 1; i + 1 < face.size(); ++i) {
      area += (points_[face[i]] - points_[face[0]]).cross(points_[face[i + 1]] - points_[face[0]]);
    }
    const Point along = (tets_.points.row(edge.second) - tets_.points.row(edge.first)).transpose();
    return area.dot(along) < 0;
  }

  static void append_cell(const std::vector<Face>& faces, Mesh& dual) {
    std::vector<Index> nodes;
    for (const Face& face : faces) {
      dual.polyhedron_faces.push_back(static_cast<Index>(face.size()));
      dual.polyhedron_faces.insert(dual.polyhedron_faces.end(), face.begin(), face.end());
      nodes.insert(nodes.end(), face.begin(), face.end());
    }
    std::ranges::sort(nodes);
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    dual.connectivity.insert(dual.connectivity.end(), nodes.begin(), nodes.end());
    dual.offsets.push_back(static_cast<Index>(dual.connectivity.size()));
    dual.polyhedron_offsets.push_back(static_cast<Index>(dual.polyhedron_faces.size()));
    dual.types.push_back(CellType::Polyhedron);
  }

  const Mesh& tets_;
  const PlaceDualNode& place_;
  std::vector<Point> points_;
  std::vector<std::vector<Face>> faces_;  // of each node's cell
  std::map<Triangle, std::pair<Index, Triangle>> open_;
  std::map<Edge, std::vector<std::pair<Index, Index>>> links_;
  std::map<Edge, Index> edge_nodes_;
};

}  // namespace

Mesh median_dual(const Mesh& tets, const PlaceDualNode& place) { return Dual(tets, place).mesh(); }

}  // namespace cadmorph::models
