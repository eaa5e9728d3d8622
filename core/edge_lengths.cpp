#include "core/edge_lengths.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace cadmorph {
namespace {

using Edge = std::pair<int, int>;

// Edges in the order of VTK's mid-side nodes.
constexpr Edge kTriangle[] = {{0, 1}, {1, 2}, {2, 0}};
constexpr Edge kQuad[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}};
constexpr Edge kTetra[] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
constexpr Edge kVoxel[] = {{0, 1}, {1, 3}, {3, 2}, {2, 0}, {4, 5}, {5, 7},
                           {7, 6}, {6, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
constexpr Edge kHexahedron[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6},
                                {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
constexpr Edge kWedge[] = {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}};
constexpr Edge kPyramid[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}};
constexpr Edge kLine[] = {{0, 1}};

struct EdgeTable {
  std::span<const Edge> edges;
  bool is_quadratic;  ///< a node follows the corners for each edge
};

EdgeTable edge_table(CellType type) {
  switch (type) {
    case CellType::Line:
      return {kLine, false};
    case CellType::Triangle:
      return {kTriangle, false};
    case CellType::Quad:
      return {kQuad, false};
    case CellType::Tetra:
      return {kTetra, false};
    case CellType::Voxel:
      return {kVoxel, false};
    case CellType::Hexahedron:
      return {kHexahedron, false};
    case CellType::Wedge:
    case CellType::QuadraticLinearWedge:
      return {kWedge, false};
    case CellType::Pyramid:
      return {kPyramid, false};
    case CellType::QuadraticEdge:
      return {kLine, true};
    case CellType::QuadraticTriangle:
    case CellType::BiquadraticTriangle:
      return {kTriangle, true};
    case CellType::QuadraticQuad:
    case CellType::BiquadraticQuad:
      return {kQuad, true};
    case CellType::QuadraticLinearQuad:
      return {kQuad, false};
    case CellType::QuadraticTetra:
      return {kTetra, true};
    case CellType::QuadraticHexahedron:
    case CellType::TriquadraticHexahedron:
    case CellType::BiquadraticQuadraticHexahedron:
      return {kHexahedron, true};
    case CellType::QuadraticWedge:
    case CellType::BiquadraticQuadraticWedge:
      return {kWedge, true};
    case CellType::QuadraticPyramid:
      return {kPyramid, true};
    default:
      return {{}, false};
  }
}

int table_corners(std::span<const Edge> edges) {
  int corners = 0;
  for (const auto& [a, b] : edges) corners = std::max({corners, a + 1, b + 1});
  return corners;
}

class EdgeLengths {
 public:
  explicit EdgeLengths(const Mesh& mesh)
      : points_(mesh.points),
        lengths_{
            Eigen::VectorXd::Constant(mesh.node_count(), std::numeric_limits<double>::infinity()),
            Eigen::VectorXd::Zero(mesh.node_count())} {}

  void add(Index a, Index b) {
    if (a == b) return;
    const double length = (points_.row(a) - points_.row(b)).norm();
    for (const Index n : {a, b}) {
      lengths_.shortest[n] = std::min(lengths_.shortest[n], length);
      lengths_.longest[n] = std::max(lengths_.longest[n], length);
    }
  }

  void add_loop(std::span<const Index> nodes) {
    for (std::size_t i = 0; i < nodes.size(); ++i) add(nodes[i], nodes[(i + 1) % nodes.size()]);
  }

  IncidentEdges take() {
    for (double& length : lengths_.shortest)
      if (!std::isfinite(length)) length = 0;
    return std::move(lengths_);
  }

 private:
  const Points& points_;
  IncidentEdges lengths_;
};

void add_polyhedron(const Mesh& mesh, Index c, EdgeLengths& lengths) {
  const std::span<const Index> faces(mesh.polyhedron_faces);
  for (Index i = mesh.polyhedron_offsets[c]; i < mesh.polyhedron_offsets[c + 1];) {
    const Index count = faces[i];
    lengths.add_loop(faces.subspan(i + 1, count));
    i += count + 1;
  }
}

void add_cell(std::span<const Index> nodes, const EdgeTable& table, EdgeLengths& lengths) {
  const int corners = table_corners(table.edges);
  for (std::size_t e = 0; e < table.edges.size(); ++e) {
    const auto& [a, b] = table.edges[e];
    if (table.is_quadratic) {
      lengths.add(nodes[a], nodes[corners + e]);
      lengths.add(nodes[corners + e], nodes[b]);
    } else {
      lengths.add(nodes[a], nodes[b]);
    }
  }
}

}  // namespace

IncidentEdges incident_edges(const Mesh& mesh) {
  EdgeLengths lengths(mesh);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (mesh.types[c] == CellType::Polyhedron)
      add_polyhedron(mesh, c, lengths);
    else if (mesh.types[c] == CellType::Polygon)
      lengths.add_loop(mesh.cell(c));
    else
      add_cell(mesh.cell(c), edge_table(mesh.types[c]), lengths);
  }
  return lengths.take();
}

}  // namespace cadmorph
