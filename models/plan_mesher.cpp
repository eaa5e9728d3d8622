#include "models/plan_mesher.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <unordered_map>

#include "models/gmsh_scope.h"

namespace cadmorph::models {
namespace {

/// Triangles, or triangles and quadrangles, with every second node of the loops on the boundary.
struct CoarseMesh {
  std::vector<Point2> points;
  std::vector<std::vector<int>> cells;
};

/// Adds a loop's even nodes and the lines between them to gmsh's model, each line to stay whole.
int add_loop(const Loop& loop) {
  std::vector<int> points, lines;
  for (std::size_t i = 0; i < loop.size(); i += 2) {
    points.push_back(gmsh::model::geo::addPoint(loop[i][0], loop[i][1], 0));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    lines.push_back(gmsh::model::geo::addLine(points[i], points[(i + 1) % points.size()]));
    gmsh::model::geo::mesh::setTransfiniteCurve(lines.back(), 2);
  }
  return gmsh::model::geo::addCurveLoop(lines);
}

CoarseMesh collect_coarse(int surface) {
  std::vector<std::size_t> tags;
  std::vector<double> positions, parameters;
  gmsh::model::mesh::getNodes(tags, positions, parameters);
  CoarseMesh mesh;
  std::unordered_map<std::size_t, int> ids;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    ids[tags[i]] = static_cast<int>(i);
    mesh.points.emplace_back(positions[3 * i], positions[3 * i + 1]);
  }
  constexpr int triangle = 2;  // gmsh's element type
  std::vector<std::size_t> elements, nodes;
  gmsh::model::mesh::getElementsByType(triangle, elements, nodes, surface);
  for (std::size_t i = 0; i < nodes.size(); i += 3) {
    mesh.cells.push_back({ids.at(nodes[i]), ids.at(nodes[i + 1]), ids.at(nodes[i + 2])});
  }
  return mesh;
}

CoarseMesh mesh_coarsely(const std::vector<Loop>& loops) {
  return with_gmsh("a plane section", [&] {
    std::vector<int> curve_loops;
    for (const Loop& loop : loops) curve_loops.push_back(add_loop(loop));
    const int surface = gmsh::model::geo::addPlaneSurface(curve_loops);
    gmsh::model::geo::synchronize();
    gmsh::option::setNumber("Mesh.Algorithm", 6);  // frontal; 8, for quadrangles, crashes in 4.8.4
    gmsh::model::mesh::generate(2);
    return collect_coarse(surface);
  });
}

double cross(const Point2& a, const Point2& b) { return a[0] * b[1] - a[1] * b[0]; }

/// The smallest sine of a quadrangle's angles; negative for one folded over.
double worst_angle(const std::vector<Point2>& points, const std::array<int, 4>& quad) {
  double worst = 1;
  for (int i = 0; i < 4; ++i) {
    const Point2 &here = points[quad[i]], &next = points[quad[(i + 1) % 4]],
                 &before = points[quad[(i + 3) % 4]];
    const Point2 a = next - here, b = before - here;
    worst = std::min(worst, cross(a, b) / (a.norm() * b.norm()));
  }
  return worst;
}

/// Joins triangles in pairs, the best quadrangles first.
CoarseMesh pair_triangles(const CoarseMesh& triangles) {
  constexpr double least_sine = 0.5;
  struct Pair {
    double sine;
    int first, second;
    std::array<int, 4> quad;
  };
  std::map<std::pair<int, int>, std::pair<int, int>> sides;  // edge to triangle and apex
  std::vector<Pair> pairs;
  for (int t = 0; t < static_cast<int>(triangles.cells.size()); ++t) {
    for (int i = 0; i < 3; ++i) {
      const int a = triangles.cells[t][i], b = triangles.cells[t][(i + 1) % 3],
                apex = triangles.cells[t][(i + 2) % 3];
      const auto [entry, is_new] = sides.try_emplace(std::minmax(a, b), t, apex);
      if (is_new) continue;
      const std::array<int, 4> quad = {a, entry->second.second, b, apex};
      const double sine = worst_angle(triangles.points, quad);
      if (sine > least_sine) pairs.push_back({sine, entry->second.first, t, quad});
    }
  }
  std::ranges::stable_sort(pairs, std::greater(), &Pair::sine);
  std::vector<char> is_paired(triangles.cells.size());
  CoarseMesh mesh{triangles.points, {}};
  for (const Pair& pair : pairs) {
    if (is_paired[pair.first] || is_paired[pair.second]) continue;
    is_paired[pair.first] = is_paired[pair.second] = true;
    mesh.cells.emplace_back(pair.quad.begin(), pair.quad.end());
  }
  for (std::size_t t = 0; t < triangles.cells.size(); ++t) {
    if (!is_paired[t]) mesh.cells.push_back(triangles.cells[t]);
  }
  return mesh;
}

/// Cuts each cell of n corners into n quadrangles about its middle.
class Subdivision {
 public:
  Subdivision(const CoarseMesh& coarse, const std::vector<Loop>& loops) {
    mesh_.points = coarse.points;
    place_loop_nodes(coarse, loops);
    for (const std::vector<int>& cell : coarse.cells) cut(cell);
  }
  const PlanMesh& mesh() const { return mesh_; }
  /// Whether a node is one of the loops'.
  const std::vector<char>& is_fixed() const { return is_fixed_; }

 private:
  int add_point(const Point2& point, bool fixed) {
    mesh_.points.push_back(point);
    is_fixed_.push_back(fixed);
    return static_cast<int>(mesh_.points.size()) - 1;
  }

  void place_loop_nodes(const CoarseMesh& coarse, const std::vector<Loop>& loops) {
    std::map<std::pair<double, double>, int> ids;
    for (std::size_t i = 0; i < coarse.points.size(); ++i) {
      ids[{coarse.points[i][0], coarse.points[i][1]}] = static_cast<int>(i);
    }
    is_fixed_.assign(coarse.points.size(), false);
    for (const Loop& loop : loops) {
      for (std::size_t i = 0; i < loop.size(); i += 2) {
        const Point2& next = loop[(i + 2) % loop.size()];
        const int a = ids.at({loop[i][0], loop[i][1]}), b = ids.at({next[0], next[1]});
        is_fixed_[a] = is_fixed_[b] = true;
        middles_[std::minmax(a, b)] = add_point(loop[i + 1], true);
      }
    }
  }

  int middle(int a, int b) {
    const auto [entry, is_new] = middles_.try_emplace(std::minmax(a, b), 0);
    if (is_new) entry->second = add_point((mesh_.points[a] + mesh_.points[b]) / 2, false);
    return entry->second;
  }

  void cut(const std::vector<int>& cell) {
    Point2 sum(0, 0);
    for (const int node : cell) sum += mesh_.points[node];
    const int centre = add_point(sum / static_cast<double>(cell.size()), false);
    for (std::size_t i = 0; i < cell.size(); ++i) {
      const int before = cell[(i + cell.size() - 1) % cell.size()];
      const int after = cell[(i + 1) % cell.size()];
      mesh_.quads.push_back({cell[i], middle(cell[i], after), centre, middle(before, cell[i])});
    }
  }

  PlanMesh mesh_;
  std::vector<char> is_fixed_;
  std::map<std::pair<int, int>, int> middles_;
};

/// Moves free nodes to better places: the mean of their neighbours, or a part of the way there,
/// where that improves the worst angle around them.
void smooth(PlanMesh& mesh, const std::vector<char>& is_fixed) {
  constexpr int sweeps = 30;
  std::vector<std::vector<int>> around(mesh.points.size());
  for (std::size_t q = 0; q < mesh.quads.size(); ++q) {
    for (const int node : mesh.quads[q]) around[node].push_back(static_cast<int>(q));
  }
  const auto worst_around = [&](std::size_t node) {
    double worst = 1;
    for (const int q : around[node]) {
      worst = std::min(worst, worst_angle(mesh.points, mesh.quads[q]));
    }
    return worst;
  };
  const auto mean_of_neighbours = [&](std::size_t node) {
    Point2 sum(0, 0);
    for (const int q : around[node]) {
      const auto& quad = mesh.quads[q];
      const int i =
          static_cast<int>(std::ranges::find(quad, static_cast<int>(node)) - quad.begin());
      sum += mesh.points[quad[(i + 1) % 4]] + mesh.points[quad[(i + 3) % 4]];
    }
    return Point2(sum / (2. * static_cast<double>(around[node].size())));
  };
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (std::size_t node = 0; node < mesh.points.size(); ++node) {
      if (is_fixed[node]) continue;
      const Point2 old = mesh.points[node], target = mean_of_neighbours(node);
      double best = worst_around(node);
      Point2 best_point = old;
      for (const double part : {1., 0.5, 0.25, -0.25}) {
        mesh.points[node] = old + part * (target - old);
        const double worst = worst_around(node);
        if (worst > best) {
          best = worst;
          best_point = mesh.points[node];
        }
      }
      mesh.points[node] = best_point;
    }
  }
}

}  // namespace

Loop sample_loop(const std::vector<PlanCurve>& curves, const std::vector<int>& cells) {
  Loop loop;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    for (int i = 0; i < cells[c]; ++i) loop.push_back(curves[c].at(double(i) / cells[c]));
  }
  return loop;
}

Loop sample_circle(const Point2& centre, double radius, int cells, double first) {
  Loop loop;
  for (int i = 0; i < cells; ++i) {
    loop.push_back(polar(centre, radius, first + 2 * std::numbers::pi * i / cells));
  }
  return loop;
}

PlanMesh mesh_plan(const Loop& outline, const std::vector<Loop>& holes) {
  std::vector<Loop> loops = {outline};
  loops.insert(loops.end(), holes.begin(), holes.end());
  const Subdivision subdivision(pair_triangles(mesh_coarsely(loops)), loops);
  PlanMesh mesh = subdivision.mesh();
  smooth(mesh, subdivision.is_fixed());
  return mesh;
}

}  // namespace cadmorph::models
