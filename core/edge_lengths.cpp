#include "core/edge_lengths.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>

#include "core/cell_topology.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

class EdgeLengths {
 public:
  explicit EdgeLengths(const Points& points)
      : points_(points),
        squares_{Eigen::VectorXd::Constant(points.rows(), std::numeric_limits<double>::infinity()),
                 Eigen::VectorXd::Zero(points.rows())} {}

  void add(Index a, Index b) {
    if (a == b) return;
    const double square = (points_.row(a) - points_.row(b)).squaredNorm();
    add_square(a, square);
    add_square(b, square);
  }

  void add_line(std::span<const Index> nodes) {
    for (std::size_t i = 1; i < nodes.size(); ++i) add(nodes[i - 1], nodes[i]);
  }

  void add_loop(std::span<const Index> nodes) {
    add_line(nodes);
    add(nodes.back(), nodes.front());
  }

  // A node inside a face or cell, on no edge, and the nearest ones around it.
  void add_centre(Index centre, std::span<const Index> around) {
    for (const Index node : around)
      add_square(centre, (points_.row(centre) - points_.row(node)).squaredNorm());
  }

  IncidentEdges take() {
    for (double& square : squares_.shortest)
      if (!std::isfinite(square)) square = 0;
    return {squares_.shortest.cwiseSqrt(), squares_.longest.cwiseSqrt()};
  }

 private:
  void add_square(Index n, double square) {
    replace_if(squares_.shortest[n], square, std::less());
    replace_if(squares_.longest[n], square, std::greater());
  }

  /// Several threads do it: whatever their order, the extreme of all stays.
  template <class Compare>
  static void replace_if(double& extreme, double value, Compare is_beyond) {
    const std::atomic_ref<double> shared(extreme);
    double known = shared.load(std::memory_order_relaxed);
    while (is_beyond(value, known) &&
           !shared.compare_exchange_weak(known, value, std::memory_order_relaxed))
      continue;
  }

  const Points& points_;
  IncidentEdges squares_;  ///< of the lengths
};

void add_polyhedron(const Mesh& mesh, Index c, EdgeLengths& lengths) {
  const std::span<const Index> faces(mesh.polyhedron_faces);
  for (Index i = mesh.polyhedron_offsets[c]; i < mesh.polyhedron_offsets[c + 1];) {
    const Index count = faces[i];
    lengths.add_loop(faces.subspan(i + 1, count));
    i += count + 1;
  }
}

void add_edges(std::span<const Index> nodes, const CellInfo& info, EdgeLengths& lengths) {
  std::size_t mid = std::size_t(info.corners);
  const std::size_t last_mid = mid + std::size_t(info.mid_nodes);
  for (const auto& [a, b] : info.edges) {
    if (mid < last_mid) {
      lengths.add(nodes[a], nodes[mid]);
      lengths.add(nodes[mid++], nodes[b]);
    } else {
      lengths.add(nodes[a], nodes[b]);
    }
  }
}

// Biquadratic shells end with their centre, after the mid nodes of their sides.
void add_shell_centre(CellType type, std::span<const Index> nodes, EdgeLengths& lengths) {
  if (type == CellType::BiquadraticQuad) lengths.add_centre(nodes[8], nodes.subspan(4, 4));
  if (type == CellType::BiquadraticTriangle) lengths.add_centre(nodes[6], nodes.subspan(3, 3));
}

void add_centres(const Mesh& mesh, Index c, EdgeLengths& lengths) {
  const CellType type = mesh.types[c];
  const auto nodes = mesh.cell(c);
  add_shell_centre(type, nodes, lengths);
  for (const LocalFace& face : local_faces(type)) {
    if (face.type != CellType::BiquadraticQuad) continue;
    std::array<Index, 9> of_face;
    for (int i = 0; i < face.count; ++i) of_face[i] = nodes[face.nodes[i]];
    add_shell_centre(face.type, of_face, lengths);
  }
  if (type == CellType::TriquadraticHexahedron) lengths.add_centre(nodes[26], nodes.subspan(20, 6));
}

void add_cell(const Mesh& mesh, Index c, EdgeLengths& lengths) {
  if (mesh.types[c] == CellType::Polyhedron)
    add_polyhedron(mesh, c, lengths);
  else if (mesh.types[c] == CellType::Polygon)
    lengths.add_loop(mesh.cell(c));
  else if (mesh.types[c] == CellType::PolyLine)
    lengths.add_line(mesh.cell(c));
  else
    add_edges(mesh.cell(c), info_of(mesh.types[c]), lengths);
  add_centres(mesh, c, lengths);
}

}  // namespace

IncidentEdges incident_edges(const Mesh& mesh) { return incident_edges(mesh, mesh.points); }

IncidentEdges incident_edges(const Mesh& mesh, const Points& points) {
  EdgeLengths lengths(points);
  parallel_for(mesh.cell_count(), 1 << 14, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) add_cell(mesh, c, lengths);
  });
  return lengths.take();
}

}  // namespace cadmorph
