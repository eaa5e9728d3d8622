#include "models/far_field.h"

#include <map>
#include <string>
#include <unordered_map>

#include "core/errors.h"
#include "models/gmsh_scope.h"
#include "models/hex_builder.h"

namespace cadmorph::models {
namespace {

namespace mesher = gmsh::model::mesh;

constexpr int triangle_type = 2, tet_type = 4;  // gmsh's element types

/// The mesh of gmsh's surfaces `tags`.
TriangleMesh collect_triangles(const std::vector<int>& tags) {
  std::vector<std::size_t> node_tags;
  std::vector<double> positions, parameters;
  mesher::getNodes(node_tags, positions, parameters);
  std::unordered_map<std::size_t, std::size_t> at;
  for (std::size_t i = 0; i < node_tags.size(); ++i) at[node_tags[i]] = i;
  TriangleMesh mesh;
  std::unordered_map<std::size_t, int> ids;
  const auto id = [&](std::size_t tag) {
    const auto [entry, is_new] = ids.try_emplace(tag, static_cast<int>(mesh.points.size()));
    if (is_new) mesh.points.emplace_back(&positions[3 * at.at(tag)]);
    return entry->second;
  };
  for (const int tag : tags) {
    std::vector<std::size_t> elements, nodes;
    mesher::getElementsByType(triangle_type, elements, nodes, tag);
    for (std::size_t i = 0; i < nodes.size(); i += 3) {
      mesh.triangles.push_back({id(nodes[i]), id(nodes[i + 1]), id(nodes[i + 2])});
      mesh.faces.push_back(tag);
    }
  }
  return mesh;
}

/// Sizes that grow from that at the curves to `size` at six times that distance.
void set_sizes(double size_at_curves, double size) {
  gmsh::vectorpair curves;
  gmsh::model::getEntities(curves, 1);
  std::vector<double> tags;
  for (const auto& curve : curves) tags.push_back(curve.second);
  const int distance = mesher::field::add("Distance");
  mesher::field::setNumbers(distance, "CurvesList", tags);
  mesher::field::setNumber(distance, "NumPointsPerCurve", 400);
  const int threshold = mesher::field::add("Threshold");
  for (const auto& [name, value] : {std::pair<const char*, double>{"InField", distance},
                                    {"SizeMin", size_at_curves},
                                    {"SizeMax", size},
                                    {"DistMin", 0},
                                    {"DistMax", 6 * size}}) {
    mesher::field::setNumber(threshold, name, value);
  }
  mesher::field::setAsBackgroundMesh(threshold);
}

/// The rim as one closed loop of node numbers.
std::vector<int> rim_loop(const TriangleMesh& body) {
  std::unordered_map<int, int> next;
  for (const auto& [from, to] : rim(body)) next[from] = to;
  std::vector<int> loop;
  if (next.empty()) throw InvalidInputError("the body has no rim on the plane");
  for (int node = next.begin()->first; loop.size() < next.size(); node = next.at(node)) {
    loop.push_back(node);
  }
  return loop;
}

/// Adds a polygon to gmsh's model as lines that stay whole; returns the loop of them.
int add_polygon(const std::vector<Point3>& corners) {
  std::vector<int> points, lines;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const double length = (corners[(i + 1) % corners.size()] - corners[i]).norm();
    points.push_back(
        gmsh::model::geo::addPoint(corners[i][0], corners[i][1], corners[i][2], length));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    lines.push_back(gmsh::model::geo::addLine(points[i], points[(i + 1) % points.size()]));
    gmsh::model::geo::mesh::setTransfiniteCurve(lines.back(), 2);
  }
  return gmsh::model::geo::addCurveLoop(lines);
}

/// Adds the box's sides to gmsh's model, `hole` left out of the one at y = 0.
std::vector<int> add_box(const HalfBox& box, int hole) {
  namespace geo = gmsh::model::geo;
  std::array<int, 8> points;
  for (int i = 0; i < 8; ++i) {
    points[i] = geo::addPoint(i & 1 ? box.high[0] : box.low[0], i & 2 ? box.high[1] : box.low[1],
                              i & 4 ? box.high[2] : box.low[2], box.size);
  }
  std::map<std::pair<int, int>, int> lines;
  const auto line = [&](int a, int b) {
    if (const auto known = lines.find({b, a}); known != lines.end()) return -known->second;
    return lines[{a, b}] = geo::addLine(points[a], points[b]);
  };
  std::vector<int> sides;
  for (const auto& [a, b, c, d] :
       {std::array{0, 1, 5, 4}, std::array{2, 6, 7, 3}, std::array{0, 4, 6, 2},
        std::array{1, 3, 7, 5}, std::array{0, 2, 3, 1}, std::array{4, 5, 7, 6}}) {
    std::vector<int> loops = {geo::addCurveLoop({line(a, b), line(b, c), line(c, d), line(d, a)})};
    if (sides.empty()) loops.push_back(hole);
    sides.push_back(geo::addPlaneSurface(loops));
  }
  return sides;
}

}  // namespace

TriangleMesh triangulate(const std::filesystem::path& step, const TetOptions& options,
                         double size_at_curves) {
  return with_gmsh(step.string(), [&] {
    gmsh::vectorpair solids, faces;
    gmsh::model::occ::importShapes(step.string(), solids);
    gmsh::model::occ::synchronize();
    set_tet_options(options);
    set_sizes(size_at_curves, options.size);
    mesher::generate(2);
    gmsh::model::getEntities(faces, 2);
    std::vector<int> tags;
    for (const auto& face : faces) tags.push_back(face.second);
    return collect_triangles(tags);
  });
}

std::vector<std::array<int, 2>> rim(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> uses;
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) ++uses[std::minmax(t[i], t[(i + 1) % 3])];
  }
  std::vector<std::array<int, 2>> edges;
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const int a = t[i], b = t[(i + 1) % 3];
      if (uses.at(std::minmax(a, b)) == 1) edges.push_back({a, b});
    }
  }
  return edges;
}

TriangleMesh enclose(const TriangleMesh& body, const HalfBox& box) {
  std::vector<Point3> polygon;
  std::map<std::array<double, 3>, int> ids;
  for (const int node : rim_loop(body)) {
    const Point3& p = body.points[node];
    polygon.push_back(p);
    ids[{p[0], p[1], p[2]}] = node;
  }
  const TriangleMesh sides = with_gmsh("the box around a body", [&] {
    const std::vector<int> surfaces = add_box(box, add_polygon(polygon));
    gmsh::model::geo::synchronize();
    mesher::generate(2);
    return collect_triangles(surfaces);
  });
  TriangleMesh closed = body;
  std::vector<int> renumbered;
  for (const Point3& p : sides.points) {
    const auto [entry, is_new] =
        ids.try_emplace({p[0], p[1], p[2]}, static_cast<int>(closed.points.size()));
    if (is_new) closed.points.push_back(p);
    renumbered.push_back(entry->second);
  }
  for (const auto& [a, b, c] : sides.triangles) {
    closed.triangles.push_back({renumbered[a], renumbered[b], renumbered[c]});
  }
  return closed;
}

Mesh fill_with_tets(const TriangleMesh& closed) {
  return with_gmsh("the inside of a closed surface", [&] {
    const int surface = gmsh::model::addDiscreteEntity(2);
    std::vector<std::size_t> tags, nodes;
    std::vector<double> positions;
    for (std::size_t i = 0; i < closed.points.size(); ++i) {
      tags.push_back(i + 1);
      positions.insert(positions.end(), closed.points[i].begin(), closed.points[i].end());
    }
    mesher::addNodes(2, surface, tags, positions);
    for (const auto& t : closed.triangles) {
      for (const int node : t) nodes.push_back(static_cast<std::size_t>(node) + 1);
    }
    mesher::addElementsByType(surface, triangle_type, {}, nodes);
    gmsh::model::geo::addVolume({gmsh::model::geo::addSurfaceLoop({surface})});
    gmsh::model::geo::synchronize();
    mesher::generate(3);

    std::vector<Point3> points = closed.points;
    std::vector<double> all_positions, parameters;
    mesher::getNodes(tags, all_positions, parameters, 3, -1);
    std::unordered_map<std::size_t, Index> inner;
    for (std::size_t i = 0; i < tags.size(); ++i) {
      inner[tags[i]] = static_cast<Index>(points.size());
      points.emplace_back(&all_positions[3 * i]);
    }
    std::vector<std::size_t> elements, corners;
    mesher::getElementsByType(tet_type, elements, corners);
    std::vector<Index> connectivity;
    for (const std::size_t tag : corners) {
      connectivity.push_back(tag <= closed.points.size() ? static_cast<Index>(tag) - 1
                                                         : inner.at(tag));
    }
    return make_mesh(points, CellType::Tetra, 4, connectivity);
  });
}

}  // namespace cadmorph::models
