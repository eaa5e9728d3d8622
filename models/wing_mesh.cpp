#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "models/far_field.h"
#include "models/hex_builder.h"
#include "models/median_dual.h"
#include "models/step_files.h"
#include "models/wing.h"

namespace cadmorph::models {
namespace {

constexpr double chord = 1000;  // mm
constexpr double first_height = 1e-5 * chord;
constexpr double growth = 1.3;
constexpr int layer_count = 25;          // 23 mm in all
constexpr double root_tolerance = 1e-6;  // mm; gmsh's nodes off the plane y = 0

const HalfBox far_field = {
    {-5 * chord, 0, -6 * chord}, {8 * chord, 6 * chord, 6 * chord}, 1.5 * chord};

bool is_on_root(const Point3& point) { return std::abs(point[1]) < root_tolerance; }

/// The wing's triangles that air flows along: all but the root's.
TriangleMesh wetted_surface(const std::filesystem::path& step, const TetOptions& options,
                            const TriangleSizes& sizes) {
  const TriangleMesh all = triangulate(step, options, sizes);
  TriangleMesh wetted;
  std::vector<int> ids(all.points.size(), -1);
  for (std::size_t t = 0; t < all.triangles.size(); ++t) {
    const auto& triangle = all.triangles[t];
    if (std::ranges::all_of(triangle, [&](int n) { return is_on_root(all.points[n]); })) continue;
    auto& added = wetted.triangles.emplace_back();
    for (int i = 0; i < 3; ++i) {
      int& id = ids[triangle[i]];
      if (id < 0) {
        id = static_cast<int>(wetted.points.size());
        Point3 point = all.points[triangle[i]];
        if (is_on_root(point)) point[1] = 0;
        wetted.points.push_back(point);
      }
      added[i] = id;
    }
    wetted.faces.push_back(all.faces[t]);
  }
  return wetted;
}

Point3 area_vector(const TriangleMesh& mesh, std::size_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return (mesh.points[b] - mesh.points[a]).cross(mesh.points[c] - mesh.points[a]) / 2;
}

/// Unit normals at the nodes, into the air: the mean of the triangles' weighted by their angles; in
/// the plane y = 0 at its nodes.
std::vector<Point3> node_normals(const TriangleMesh& mesh) {
  std::vector<Point3> normals(mesh.points.size(), Point3::Zero());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Point3 normal = area_vector(mesh, t).normalized();
    for (int i = 0; i < 3; ++i) {
      const Point3& here = mesh.points[mesh.triangles[t][i]];
      const Point3 a = mesh.points[mesh.triangles[t][(i + 1) % 3]] - here;
      const Point3 b = mesh.points[mesh.triangles[t][(i + 2) % 3]] - here;
      normals[mesh.triangles[t][i]] += std::atan2(a.cross(b).norm(), a.dot(b)) * normal;
    }
  }
  for (std::size_t n = 0; n < normals.size(); ++n) {
    if (is_on_root(mesh.points[n])) normals[n][1] = 0;
    normals[n].normalize();
  }
  return normals;
}

/// Distance of the layer's upper side from the wing.
double height(int layer) { return first_height * (std::pow(growth, layer) - 1) / (growth - 1); }

/// The air's nodes, layer over layer, and the surface that the last layer ends in.
TriangleMesh raise(const TriangleMesh& wing, int layer, const std::vector<Point3>& normals) {
  TriangleMesh raised = wing;
  for (std::size_t n = 0; n < wing.points.size(); ++n)
    raised.points[n] += height(layer) * normals[n];
  return raised;
}

/// Joins the wedges between wing and `tets`, whose first nodes are those on the last layer.
Mesh join(const TriangleMesh& wing, const std::vector<Point3>& normals, const Mesh& tets) {
  const auto per_layer = static_cast<Index>(wing.points.size());
  const Index below = layer_count * per_layer;  // nodes under the tetrahedra
  Mesh mesh;
  mesh.points.resize(below + tets.node_count(), 3);
  for (int layer = 0; layer < layer_count; ++layer) {
    const TriangleMesh raised = raise(wing, layer, normals);
    for (Index n = 0; n < per_layer; ++n) {
      mesh.points.row(layer * per_layer + n) = raised.points[n].transpose();
    }
  }
  mesh.points.bottomRows(tets.node_count()) = tets.points;
  mesh.offsets = {0};
  const auto add = [&](CellType type, std::span<const Index> nodes) {
    mesh.types.push_back(type);
    mesh.connectivity.insert(mesh.connectivity.end(), nodes.begin(), nodes.end());
    mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
  };
  for (int layer = 0; layer < layer_count; ++layer) {
    const Index lower = layer * per_layer, upper = lower + per_layer;
    for (const auto& [a, b, c] : wing.triangles) {
      // VTK's wedge has its first triangle's normal point out of it.
      const std::array<Index, 6> nodes = {lower + a, lower + c, lower + b,
                                          upper + a, upper + c, upper + b};
      add(CellType::Wedge, nodes);
    }
  }
  for (Index c = 0; c < tets.cell_count(); ++c) {
    std::vector<Index> nodes(tets.cell(c).begin(), tets.cell(c).end());
    for (Index& node : nodes) node += below;
    add(CellType::Tetra, nodes);
  }
  return mesh;
}

/// Edges of the wing between two CAD faces, or at its root.
std::set<std::pair<Index, Index>> feature_edges(const TriangleMesh& wing) {
  std::map<std::pair<Index, Index>, std::set<int>> faces;
  for (std::size_t t = 0; t < wing.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const Index a = wing.triangles[t][i], b = wing.triangles[t][(i + 1) % 3];
      faces[std::minmax(a, b)].insert(wing.faces[t]);
    }
  }
  std::set<std::pair<Index, Index>> features;
  for (const auto& [edge, touching] : faces) {
    if (touching.size() > 1) features.insert(edge);
  }
  for (const auto& [a, b] : rim(wing)) features.insert(std::minmax<Index>(a, b));
  return features;
}

/// A mean of a tetrahedron's nodes in which those on the wing count less: the polyhedra on the wing
/// grow thick enough to be star-shaped about its nose and edges.
Point3 off_wing(const Mesh& tets, std::span<const Index> nodes, Index wing_nodes) {
  constexpr double weight_on_wing = 0.6;
  Point3 sum(0, 0, 0);
  double weights = 0;
  for (const Index node : nodes) {
    const double weight = node < wing_nodes ? weight_on_wing : 1;
    sum += weight * tets.points.row(node).transpose();
    weights += weight;
  }
  return sum / weights;
}

}  // namespace

Mesh make_wing_layers(const std::filesystem::path& step) {
  const TriangleMesh wing =
      wetted_surface(step, {.size = 70, .elements_per_turn = 8}, {.at_curves = 26});
  const std::vector<Point3> normals = node_normals(wing);
  return join(wing, normals, fill_with_tets(enclose(raise(wing, layer_count, normals), far_field)));
}

Mesh make_wing_polyhedra(const std::filesystem::path& step) {
  const TriangleMesh wing = wetted_surface(
      step, {.size = 60}, {.at_curves = 22, .formula = "12 + 0.25 * Fabs(x - 0.2 * y)"});
  const Mesh tets = fill_with_tets(enclose(wing, far_field));
  const auto features = feature_edges(wing);
  const NearestOnShape on_edges(read_step(step), ShapeKind::Edges);
  const NearestOnShape on_faces(read_step(step), ShapeKind::Faces);
  const auto wing_nodes = static_cast<Index>(wing.points.size());
  const auto is_wing = [&](Index node) { return node < wing_nodes; };
  return median_dual(tets, [&](std::span<const Index> nodes, const Point3& mean) -> Point3 {
    if (nodes.size() == 4) return off_wing(tets, nodes, wing_nodes);
    if (nodes.size() == 2 && features.contains(std::minmax(nodes[0], nodes[1]))) {
      return on_edges(mean);
    }
    return std::ranges::all_of(nodes, is_wing) ? on_faces(mean) : mean;
  });
}

}  // namespace cadmorph::models
