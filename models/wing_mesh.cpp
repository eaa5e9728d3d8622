#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>

#include "models/far_field.h"
#include "models/hex_builder.h"
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
                            double size_at_curves) {
  const TriangleMesh all = triangulate(step, options, size_at_curves);
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

/// Starts a mesh with the nodes of `outside` and, before them, those of the layers below it; adds
/// the wedges of the first `layers` layers.
Mesh add_wedges(const TriangleMesh& wing, const std::vector<Point3>& normals, int layers,
                const Points& outside) {
  const auto per_layer = static_cast<Index>(wing.points.size());
  Mesh mesh;
  mesh.points.resize(layer_count * per_layer + outside.rows(), 3);
  for (int layer = 0; layer < layer_count; ++layer) {
    const TriangleMesh raised = raise(wing, layer, normals);
    for (Index n = 0; n < per_layer; ++n) {
      mesh.points.row(layer * per_layer + n) = raised.points[n].transpose();
    }
  }
  mesh.points.bottomRows(outside.rows()) = outside;
  mesh.offsets = {0};
  for (int layer = 0; layer < layers; ++layer) {
    const Index lower = layer * per_layer, upper = lower + per_layer;
    for (const auto& [a, b, c] : wing.triangles) {
      // VTK's wedge has its first triangle's normal point out of it.
      const std::array<Index, 6> nodes = {lower + a, lower + c, lower + b,
                                          upper + a, upper + c, upper + b};
      add_cell(mesh, CellType::Wedge, nodes);
    }
  }
  return mesh;
}

/// The wing's surface, its normals, and the tetrahedra outside the layers, whose first nodes are
/// those on the last layer.
struct Layers {
  TriangleMesh wing;
  std::vector<Point3> normals;
  Mesh tets;
};

Layers make_layers(const std::filesystem::path& step, const TetOptions& options,
                   double size_at_curves) {
  Layers layers;
  layers.wing = wetted_surface(step, options, size_at_curves);
  layers.normals = node_normals(layers.wing);
  layers.tets = fill_with_tets(enclose(raise(layers.wing, layer_count, layers.normals), far_field));
  return layers;
}

}  // namespace

Mesh make_wing_layers(const std::filesystem::path& step) {
  const Layers layers = make_layers(step, {.size = 70, .elements_per_turn = 8}, 26);
  Mesh mesh = add_wedges(layers.wing, layers.normals, layer_count, layers.tets.points);
  const Index below = mesh.node_count() - layers.tets.node_count();
  for (Index c = 0; c < layers.tets.cell_count(); ++c) {
    std::vector<Index> nodes(layers.tets.cell(c).begin(), layers.tets.cell(c).end());
    for (Index& node : nodes) node += below;
    add_cell(mesh, CellType::Tetra, nodes);
  }
  return mesh;
}

}  // namespace cadmorph::models
