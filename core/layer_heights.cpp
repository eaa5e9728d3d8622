#include "core/layer_heights.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <ranges>
#include <utility>
#include <vector>

#include "core/cell_topology.h"
#include "core/least_squares.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr double kDegrees = 180 / std::numbers::pi;
// Of its height, by which a cell may change that keeps it: the report's share_within_1_percent.
constexpr double kKept = 0.01;
// Of its floor's shortest edge: a cell that is higher is none of a layer. With half or twice this,
// kThin, kHigh or kSameRate the 5,828 columns of a wing's layers come out the same.
constexpr double kFlat = 1.5;
// A cell at most this high, of the same edge, tells of a layer: heights that are worth holding are
// those of thin cells, others grow by accident.
constexpr double kThin = 0.5;
// Of the same edge: where a mesher ends its layers. With 0.1 layers on a border end too soon.
constexpr double kHigh = 1;
// Layers towards a wall are made with growth rates of 1.05 to 1.3, the same from one to the next;
// other cells are as high as they happen to be. Three cells at the first rate below tell of a
// layer, at a smaller one as many as come to this multiple of the height: with 4 layers that grow
// by less are not told in the tests, with 1.5 all of these are. With any kSameRate cells
// three times as high as those below go on with a layer.
constexpr double kGrowth = 1.1, kSameRate = 0.1, kMultiple = 2;
// Beside such cells this part of either, as logarithms, is enough: rounding does not part a layer
// whose rate is just 1.1. With 1, heights shaken by 1e-3 do.
constexpr double kBeside = 0.5;
// Of the heights' weight, that of a column's direction. At a trailing edge of 20 degrees a column
// is a sixth as high over either side as it is long: by the square, heights count 1/36 there, still
// six times as much.
constexpr double kTurnWeight = 0.005;

std::vector<Index> corners(const Facet& facet) {
  const Index count = corner_count(facet.type, std::ssize(facet.nodes));
  return {facet.nodes.begin(), facet.nodes.begin() + count};
}

Vector3d middle(const std::vector<Index>& nodes, const Points& points) {
  return points(nodes, Eigen::all).colwise().mean();
}

// Along the normal, twice as long as the facet is large.
Vector3d area_vector(const std::vector<Index>& nodes, const Points& points) {
  Vector3d area = Vector3d::Zero();
  const Vector3d first = points.row(nodes[0]);
  for (std::size_t i = 1; i + 1 < nodes.size(); ++i)
    area +=
        (Vector3d(points.row(nodes[i])) - first).cross(Vector3d(points.row(nodes[i + 1])) - first);
  return area;
}

Vector3d normal(const std::vector<Index>& nodes, const Points& points) {
  return area_vector(nodes, points).normalized();
}

// A cell between a face and the one opposite to it.
struct Storey {
  Index cell = -1;
  std::vector<Index> floor, ceiling;
  Index above = -1;  // the cell beyond the ceiling

  double height(const Points& points) const {
    return std::abs((middle(ceiling, points) - middle(floor, points)).dot(normal(floor, points)));
  }
  // Between the normal of the floor and the way from its middle to the ceiling's, degrees.
  double lean(const Points& points) const {
    const Vector3d way = middle(ceiling, points) - middle(floor, points);
    const Vector3d up = normal(floor, points);
    return kDegrees * std::atan2(way.cross(up).norm(), std::abs(way.dot(up)));
  }
};

bool can_stand(CellType type) {
  const Shape shape = info_of(type).shape;
  return shape == Shape::Cube || shape == Shape::Prism;
}

// The neighbour beyond a face of the cell; -1 where the mesh, or its region, ends.
Index beyond(const Mesh& mesh, const CellNeighbours& neighbours, Index cell, std::size_t face) {
  const Index other = neighbours.neighbour[neighbours.offsets[cell] + static_cast<Index>(face)];
  return other >= 0 && mesh.region(other) != mesh.region(cell) ? -1 : other;
}

Storey storey(const Mesh& mesh, const CellNeighbours& neighbours, Index cell,
              const std::vector<Facet>& facets, std::size_t floor) {
  Storey result{.cell = cell, .floor = corners(facets[floor]), .ceiling = {}, .above = -1};
  for (std::size_t f = 0; f < facets.size(); ++f) {
    std::vector<Index> nodes = corners(facets[f]);
    const bool is_apart = std::ranges::none_of(
        nodes, [&](Index n) { return std::ranges::find(result.floor, n) != result.floor.end(); });
    if (!is_apart || nodes.size() != result.floor.size()) continue;
    result.ceiling = std::move(nodes);
    result.above = beyond(mesh, neighbours, cell, f);
  }
  return result;
}

// The cell that stands on a storey, if it is one of these.
Storey next(const Mesh& mesh, const CellNeighbours& neighbours, const Storey& under) {
  const Index cell = under.above;
  if (cell < 0 || !can_stand(mesh.types[cell])) return {};
  const std::vector<Facet> facets = cell_facets(mesh, cell);
  for (std::size_t f = 0; f < facets.size(); ++f)
    if (neighbours.neighbour[neighbours.offsets[cell] + static_cast<Index>(f)] == under.cell)
      return storey(mesh, neighbours, cell, facets, f);
  return {};
}

// Whether a cell is at most `most` times as high as its floor is wide. On a symmetry plane that
// layers end at, cells stand as high as they are apart along the body.
bool is_flat(const Storey& one, const Points& points, double most) {
  const double height = one.height(points);
  for (std::size_t i = 0; i < one.floor.size(); ++i) {
    const Index next = one.floor[(i + 1) % one.floor.size()];
    if (height > most * (points.row(next) - points.row(one.floor[i])).norm()) return false;
  }
  return true;
}

bool stands_on_moved(const Storey& one, const Points& before, const Points& after) {
  return std::ranges::any_of(one.floor, [&](Index n) { return before.row(n) != after.row(n); });
}

// What is above a wall at rest may move, too: by less than this no cell is another one.
bool has_new_ceiling(const Storey& one, const Points& before, const Points& after) {
  const double least = kKept * one.height(before);
  return std::ranges::any_of(
      one.ceiling, [&](Index n) { return (before.row(n) - after.row(n)).norm() > least; });
}

// The storey between the cell's one face on the surface that `counts` and the cell that stands on
// it, if any.
Storey first_storey(const Mesh& mesh, const CellNeighbours& neighbours, Index cell,
                    const std::vector<char>& is_surface, const auto& counts) {
  const std::size_t faces = neighbours.of(cell).size();
  const auto ends = [&](std::size_t f) { return beyond(mesh, neighbours, cell, f) < 0; };
  const auto all = std::views::iota(std::size_t{0}, faces);
  if (std::ranges::none_of(all, ends)) return {};
  const std::vector<Facet> facets = cell_facets(mesh, cell);
  Storey found;
  for (const std::size_t f : all) {
    if (!ends(f)) continue;
    Storey one = storey(mesh, neighbours, cell, facets, f);
    if (one.above < 0 || std::ranges::any_of(one.floor, [&](Index n) { return !is_surface[n]; }) ||
        !counts(one))
      continue;
    if (!found.floor.empty()) return {};
    found = std::move(one);
  }
  return found;
}

// Adds to a layer, of `storeys`, those whose floors go on from its own across an edge. Round a nose
// the cells of a layer are as high as they are wide.
void add_adjacent(const std::vector<Storey>& storeys, std::vector<std::size_t>& layer) {
  const auto edges = [&](std::size_t i) {
    const std::vector<Index>& floor = storeys[i].floor;
    std::vector<std::pair<Index, Index>> found;
    for (std::size_t k = 0; k < floor.size(); ++k)
      found.emplace_back(std::minmax(floor[k], floor[(k + 1) % floor.size()]));
    return found;
  };
  std::map<std::pair<Index, Index>, std::vector<std::size_t>> beside;
  for (std::size_t i = 0; i < storeys.size(); ++i)
    for (const auto& edge : edges(i)) beside[edge].push_back(i);
  std::vector<char> is_in(storeys.size(), 0);
  for (const std::size_t i : layer) is_in[i] = 1;
  for (std::size_t k = 0; k < layer.size(); ++k)
    for (const auto& edge : edges(layer[k]))
      for (const std::size_t i : beside[edge])
        if (!std::exchange(is_in[i], 1)) layer.push_back(i);
}

// Whether a layer of the rate goes on: the growth is off by a tenth at most, and at least half of
// the rate's, as logarithms.
bool is_same_rate(double growth, double rate) {
  return std::abs(growth / rate - 1) <= kSameRate && growth * growth >= rate;
}

// The storeys of a layer from the first one on.
std::vector<Storey> storeys_from(const Mesh& mesh, const CellNeighbours& neighbours,
                                 const Storey& first, const Points& points) {
  std::vector<Storey> result{first};
  Storey one = next(mesh, neighbours, first);
  const double rate = one.height(points) / first.height(points);
  while (!one.ceiling.empty() && is_flat(one, points, kHigh) &&
         is_same_rate(one.height(points) / result.back().height(points), rate)) {
    result.push_back(one);
    one = next(mesh, neighbours, one);
  }
  return result;
}

// How much a storey and those on it grow at one rate: 1 or more for a layer, 0 where the third has
// another rate.
double growth_on(const Mesh& mesh, const CellNeighbours& neighbours, const Storey& first,
                 const Points& points, LayerGrowth wanted) {
  const double height = first.height(points);
  Storey one = next(mesh, neighbours, first);
  const double rate = one.ceiling.empty() ? 0 : one.height(points) / height;
  if (rate <= 1 || (wanted == LayerGrowth::Marked && rate < kGrowth)) return 0;
  double result = 0;
  while (result < 1) {
    const Storey above = next(mesh, neighbours, one);
    if (above.ceiling.empty() || !is_same_rate(above.height(points) / one.height(points), rate))
      return result;
    one = above;
    result = std::max(std::log(rate) / std::log(kGrowth),
                      std::log(one.height(points) / height) / std::log(kMultiple));
  }
  return result;
}

// A storey on the surface that may be the lowest of a layer; those that are not sure are only where
// they go on from one that is.
struct LowestStorey {
  Storey storey;
  bool is_sure = false;
};

// The one that the cell is, if it and those on it grow at one rate.
std::optional<LowestStorey> growing_storey(const Mesh& mesh, const CellNeighbours& neighbours,
                                           Index cell, const std::vector<char>& is_surface,
                                           const Points& points, LayerGrowth wanted) {
  Storey first = first_storey(mesh, neighbours, cell, is_surface,
                              [&](const Storey& one) { return is_flat(one, points, kThin); });
  const bool is_thin = !first.floor.empty();
  if (!is_thin)
    first = first_storey(mesh, neighbours, cell, is_surface, [](const Storey&) { return true; });
  if (first.floor.empty()) return std::nullopt;
  const double growth = growth_on(mesh, neighbours, first, points, wanted);
  if (growth < (wanted == LayerGrowth::Marked ? 1 : kBeside)) return std::nullopt;
  return LowestStorey{std::move(first), is_thin && growth >= 1};
}

// The lowest storeys of all layers.
std::vector<Storey> first_storeys(const Mesh& mesh, const CellNeighbours& neighbours,
                                  const std::vector<char>& is_surface, const Points& points,
                                  LayerGrowth growth) {
  constexpr Index kGrain = 4096;  // cells a task
  std::vector<std::vector<LowestStorey>> found(mesh.cell_count() / kGrain + 1);
  parallel_for(mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    for (Index cell = begin; cell < end; ++cell)
      if (can_stand(mesh.types[cell]))
        if (auto one = growing_storey(mesh, neighbours, cell, is_surface, points, growth))
          found[begin / kGrain].push_back(std::move(*one));
  });
  std::vector<Storey> growing;
  std::vector<std::size_t> layer;  // of these: the sure ones first
  for (std::vector<LowestStorey>& some : found)
    for (LowestStorey& one : some) {
      if (one.is_sure) layer.push_back(growing.size());
      growing.push_back(std::move(one.storey));
    }
  add_adjacent(growing, layer);
  std::vector<Storey> result;
  for (const std::size_t i : layer) result.push_back(std::move(growing[i]));
  return result;
}

LayerNodes nodes_of_solid_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                                 const std::vector<char>& is_surface, const Points& points,
                                 LayerGrowth growth) {
  LayerNodes result;
  for (const Storey& first : first_storeys(mesh, neighbours, is_surface, points, growth)) {
    result.feet.insert(result.feet.end(), first.floor.begin(), first.floor.end());
    for (const Storey& one : storeys_from(mesh, neighbours, first, points))
      result.all.insert(result.all.end(), one.ceiling.begin(), one.ceiling.end());
  }
  result.all.insert(result.all.end(), result.feet.begin(), result.feet.end());
  for (std::vector<Index>* nodes : {&result.all, &result.feet}) {
    std::ranges::sort(*nodes);
    nodes->erase(std::ranges::unique(*nodes).begin(), nodes->end());
  }
  return result;
}

// Of the largest twentieth, one value at least.
double mean_of_largest(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto count = std::max<std::ptrdiff_t>(1, std::ssize(values) / 20);
  std::ranges::nth_element(values, values.begin() + count - 1, std::greater{});
  return std::accumulate(values.begin(), values.begin() + count, 0.0) / static_cast<double>(count);
}

// All cells that stand on the surface and are no higher than wide.
std::vector<Storey> flat_storeys(const Mesh& mesh, const CellNeighbours& neighbours,
                                 const std::vector<char>& is_surface, const Points& points) {
  std::vector<Storey> result;
  for (Index cell = 0; cell < mesh.cell_count(); ++cell) {
    if (!can_stand(mesh.types[cell])) continue;
    Storey first = first_storey(mesh, neighbours, cell, is_surface,
                                [&](const Storey& one) { return is_flat(one, points, kFlat); });
    if (!first.floor.empty()) result.push_back(std::move(first));
  }
  return result;
}

LayerFigures measure_solid_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                                  const std::vector<char>& is_surface, const Points& before,
                                  const Points& after) {
  LayerFigures result;
  Index kept = 0, stacked = 0;
  std::vector<double> leans_before, leans_after;
  std::vector<Storey> storeys =
      first_storeys(mesh, neighbours, is_surface, before, LayerGrowth::Any);
  result.are_of_layers = !storeys.empty();
  if (storeys.empty()) storeys = flat_storeys(mesh, neighbours, is_surface, before);
  for (const Storey& first : storeys) {
    if (!stands_on_moved(first, before, after) &&
        !(result.are_of_layers && has_new_ceiling(first, before, after)))
      continue;
    const double height = first.height(before), ratio = first.height(after) / height;
    if (!std::isfinite(ratio)) continue;
    result.least = result.cells == 0 ? ratio : std::min(result.least, ratio);
    result.most = result.cells == 0 ? ratio : std::max(result.most, ratio);
    leans_before.push_back(first.lean(before));
    leans_after.push_back(first.lean(after));
    ++result.cells;
    kept += std::abs(ratio - 1) <= kKept;
    const Storey second = next(mesh, neighbours, first);
    if (second.ceiling.empty() || first.height(after) == 0) continue;
    ++stacked;
    result.growth_before += second.height(before) / height;
    result.growth_after += second.height(after) / first.height(after);
  }
  if (result.cells > 0)
    result.share_kept = static_cast<double>(kept) / static_cast<double>(result.cells);
  result.lean_before = mean_of_largest(std::move(leans_before));
  result.lean_after = mean_of_largest(std::move(leans_after));
  if (stacked > 0) {
    result.growth_before /= static_cast<double>(stacked);
    result.growth_after /= static_cast<double>(stacked);
  }
  return result;
}

double change_in_solid_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                              const std::vector<char>& is_surface, const Points& before,
                              const Points& after) {
  const std::vector<Storey> storeys =
      first_storeys(mesh, neighbours, is_surface, before, LayerGrowth::Any);
  double sum = 0;
  for (const Storey& first : storeys) {
    const double ratio = first.height(after) / first.height(before);
    if (std::abs(ratio - 1) > kKept) sum += std::abs(std::log(ratio));
  }
  return storeys.empty() ? 0 : sum / static_cast<double>(storeys.size());
}

// What stands on what: over the edges of the storeys' cells from floor to ceiling.
class Stacks {
 public:
  explicit Stacks(Index nodes) : above_(nodes, -1), below_(nodes, -1), is_torn_(nodes, 0) {}

  void add(const Mesh& mesh, const Storey& storey) {
    const auto cell = mesh.cell(storey.cell);
    const auto is_in = [](const std::vector<Index>& face, Index node) {
      return std::ranges::find(face, node) != face.end();
    };
    for (const LocalEdge& edge : info_of(mesh.types[storey.cell]).edges)
      for (const auto& [a, b] :
           {std::pair(cell[edge.a], cell[edge.b]), std::pair(cell[edge.b], cell[edge.a])})
        if (is_in(storey.floor, a) && is_in(storey.ceiling, b)) join(a, b);
  }

  // Up to a node that stands on more than one, or below more than one.
  std::vector<Index> on(Index foot) const {
    std::vector<Index> nodes;
    if (is_torn_[foot] || below_[foot] >= 0) return nodes;
    for (Index node = above_[foot]; node >= 0 && !is_torn_[node]; node = above_[node])
      nodes.push_back(node);
    return nodes;
  }

 private:
  void join(Index a, Index b) {
    if (above_[a] >= 0 && above_[a] != b) is_torn_[a] = 1;
    if (below_[b] >= 0 && below_[b] != a) is_torn_[b] = 1;
    above_[a] = b;
    below_[b] = a;
  }

  std::vector<Index> above_, below_;
  std::vector<char> is_torn_;
};

LayerColumns columns_of_solid_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                                     const std::vector<char>& is_surface, const Points& points,
                                     LayerGrowth growth) {
  LayerColumns result;
  Stacks stacks(mesh.node_count());
  std::vector<Index> feet;
  for (Storey& first : first_storeys(mesh, neighbours, is_surface, points, growth)) {
    for (const Storey& one : storeys_from(mesh, neighbours, first, points)) stacks.add(mesh, one);
    feet.insert(feet.end(), first.floor.begin(), first.floor.end());
    result.floors.push_back(std::move(first.floor));
  }
  std::ranges::sort(feet);
  feet.erase(std::ranges::unique(feet).begin(), feet.end());
  for (const Index foot : feet)
    if (std::vector<Index> nodes = stacks.on(foot); !nodes.empty())
      result.columns.push_back({foot, std::move(nodes)});
  return result;
}

// Along a floor's normal, in proportion to its size.
Vector3d area_of_floor(const std::vector<Index>& floor, const Vector3d& axis,
                       const Points& points) {
  if (floor.size() > 2) return area_vector(floor, points);
  return axis.cross(Vector3d(points.row(floor[1]) - points.row(floor[0])));
}

using Eigen::Matrix3d;

// The turn of the floors round a foot: of their mean normal by the shortest way, then about it as
// fits the edges from the foot best.
Matrix3d turn_of_floors(const LayerColumns& layers, Index foot, const std::vector<Index>& floors,
                        const Points& before, const Points& after) {
  Vector3d old_normal = Vector3d::Zero(), new_normal = Vector3d::Zero();
  for (const Index f : floors) {
    old_normal += area_of_floor(layers.floors[f], layers.axis, before);
    new_normal += area_of_floor(layers.floors[f], layers.axis, after);
  }
  const Matrix3d tilt = rotation_between(old_normal, new_normal);
  new_normal.normalize();
  double sine = 0, cosine = 0;
  for (const Index f : floors)
    for (const Index node : layers.floors[f]) {
      const Vector3d a = tilt * Vector3d(before.row(node) - before.row(foot)),
                     b = after.row(node) - after.row(foot);
      sine += new_normal.dot(a.cross(b));
      cosine += a.dot(b) - a.dot(new_normal) * b.dot(new_normal);
    }
  return Eigen::AngleAxisd(std::atan2(sine, cosine), new_normal) * tilt;
}

// The linear map of ways from a foot that keeps their heights over each of the floors round it, by
// least squares, and is a little drawn to the floors' turn: where two walls meet at another angle
// than before, no turn keeps both heights. Where all floors look the same way it is that turn.
Matrix3d map_of_floors(const LayerColumns& layers, Index foot, const std::vector<Index>& floors,
                       const Points& before, const Points& after) {
  const Matrix3d turn = turn_of_floors(layers, foot, floors, before, after);
  Matrix3d of_after = Matrix3d::Zero(), of_before = Matrix3d::Zero();
  double size = 0;
  for (const Index f : floors) {
    const Vector3d area = area_of_floor(layers.floors[f], layers.axis, before),
                   normal = area_of_floor(layers.floors[f], layers.axis, after).normalized();
    of_after += area.norm() * normal * normal.transpose();
    of_before += normal * area.transpose();
    size += area.norm();
  }
  const double weight = kTurnWeight * size;
  return (of_after + weight * Matrix3d::Identity()).ldlt().solve(of_before + weight * turn);
}

// A plane mesh as one layer of solid cells, with the nodes of both its sides, these as far apart as
// the mesh is large: no floor is less long than it is across.
struct PlaneLayer {
  PlaneLayer(const Mesh& plane, const Points& points, const std::vector<char>& is_surface)
      : mesh(one_layer(plane, points)), is_on(is_surface) {
    is_on.insert(is_on.end(), is_surface.begin(), is_surface.end());
    const Index n = points.rows();
    const double size = (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
    mesh.points.bottomRows(n) = points + size * (mesh.points.bottomRows(n) - points);
  }

  // Where its nodes are when those of the plane move.
  Points moved(const Points& before, const Points& after) const {
    Points result = mesh.points;
    result.topRows(after.rows()) = after;
    result.bottomRows(after.rows()) += after - before;
    return result;
  }

  Mesh mesh;
  CellNeighbours neighbours = find_cell_neighbours(mesh);
  std::vector<char> is_on;
};

}  // namespace

bool LayerFigures::are_growing() const { return are_of_layers || growth_before >= kGrowth; }

LayerFigures measure_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                            const std::vector<char>& is_surface, const Points& before,
                            const Points& after) {
  if (!neighbours.neighbour.empty())
    return measure_solid_layers(mesh, neighbours, is_surface, before, after);
  if (flat_axis(mesh, before) < 0) return {};
  const PlaneLayer layer(mesh, before, is_surface);
  return measure_solid_layers(layer.mesh, layer.neighbours, layer.is_on, layer.mesh.points,
                              layer.moved(before, after));
}

double change_of_heights(const Mesh& mesh, const CellNeighbours& neighbours,
                         const std::vector<char>& is_surface, const Points& before,
                         const Points& after) {
  if (!neighbours.neighbour.empty())
    return change_in_solid_layers(mesh, neighbours, is_surface, before, after);
  if (flat_axis(mesh, before) < 0) return 0;
  const PlaneLayer layer(mesh, before, is_surface);
  return change_in_solid_layers(layer.mesh, layer.neighbours, layer.is_on, layer.mesh.points,
                                layer.moved(before, after));
}

LayerNodes nodes_of_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                           const std::vector<char>& is_surface, const Points& points,
                           LayerGrowth growth) {
  if (!neighbours.neighbour.empty())
    return nodes_of_solid_layers(mesh, neighbours, is_surface, points, growth);
  if (flat_axis(mesh, points) < 0) return {};
  const PlaneLayer layer(mesh, points, is_surface);
  LayerNodes result =
      nodes_of_solid_layers(layer.mesh, layer.neighbours, layer.is_on, layer.mesh.points, growth);
  for (std::vector<Index>* nodes : {&result.all, &result.feet})
    std::erase_if(*nodes, [&](Index node) { return node >= mesh.node_count(); });
  return result;
}

LayerColumns find_layer_columns(const Mesh& mesh, const CellNeighbours& neighbours,
                                const std::vector<char>& is_surface, const Points& points,
                                LayerGrowth growth) {
  if (!neighbours.neighbour.empty())
    return columns_of_solid_layers(mesh, neighbours, is_surface, points, growth);
  const int axis = flat_axis(mesh, points);
  if (axis < 0) return {};
  const PlaneLayer layer(mesh, points, is_surface);
  LayerColumns result =
      columns_of_solid_layers(layer.mesh, layer.neighbours, layer.is_on, layer.mesh.points, growth);
  result.axis = Vector3d::Unit(axis);
  std::erase_if(result.columns,
                [&](const LayerColumn& column) { return column.foot >= mesh.node_count(); });
  for (std::vector<Index>& floor : result.floors) {
    const Vector3d outwards = normal(floor, layer.mesh.points);
    std::erase_if(floor, [&](Index node) { return node >= mesh.node_count(); });
    if (area_of_floor(floor, result.axis, points).dot(outwards) < 0) std::swap(floor[0], floor[1]);
  }
  return result;
}

Points carry_columns(const LayerColumns& layers, const Points& before, const Points& after) {
  std::vector<std::vector<Index>> floors_at(before.rows());
  for (std::size_t f = 0; f < layers.floors.size(); ++f)
    for (const Index node : layers.floors[f]) floors_at[node].push_back(static_cast<Index>(f));
  Points result = after;
  for (const LayerColumn& column : layers.columns) {
    const Index foot = column.foot;
    const Matrix3d map = map_of_floors(layers, foot, floors_at[foot], before, after);
    for (const Index node : column.nodes)
      result.row(node) = after.row(foot) + (before.row(node) - before.row(foot)) * map.transpose();
  }
  return result;
}

}  // namespace cadmorph
