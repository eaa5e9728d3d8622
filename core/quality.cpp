#include "core/quality.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <ranges>
#include <string>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/finite_volumes.h"
#include "core/isoparametric.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

using enum CellType;
using Vec = Eigen::Vector3d;

constexpr double kSqrt2 = std::numbers::sqrt2;
constexpr double kTwoOverSqrt3 = 2.0 * std::numbers::inv_sqrt3;
constexpr Index kGrain = 4096;  // cells a task: some hundred microseconds

double determinant(const Vec& a, const Vec& b, const Vec& c) { return a.dot(b.cross(c)); }

/// What the samples of one cell add up to.
struct CellMeasure {
  double value = 1;  ///< smallest scaled determinant
  bool is_inverted = false;
  double determinants = 0;  ///< their sum: its sign tells the handedness of the node order

  /// Takes in one sample; `unit` is the determinant's value in the ideal cell of the same lengths.
  void add(double det, double unit) {
    add_value(det, unit);
    determinants += det;
    if (!(det > 0)) is_inverted = true;
  }
  void add_value(double det, double unit) {
    value = std::min(value, unit > 0 ? std::max(det / unit, -1.0) : 0.0);
  }
};

/// Positions of a cell's nodes.
struct CellPoints {
  const Points& points;
  std::span<const Index> nodes;
  Vec operator[](int i) const { return points.row(nodes[i]).transpose(); }
};

/// Largest product of the lengths of two edges of the triangle (0, a, b).
double largest_edge_product(const Vec& a, const Vec& b) {
  const double la = a.norm(), lb = b.norm(), lc = (b - a).norm();
  return std::max({la * lb, lb * lc, lc * la});
}

/// Tetrahedron (0, a, b, c): Verdict's tet.
void add_tetra(CellMeasure& m, const Vec& a, const Vec& b, const Vec& c, double sign) {
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), cc = c.squaredNorm();
  const double ab = (b - a).squaredNorm(), bc = (c - b).squaredNorm(), ca = (a - c).squaredNorm();
  const double largest = std::max({aa * bb * cc, aa * ab * ca, bb * ab * bc, cc * bc * ca});
  m.add(sign * determinant(a, b, c), std::sqrt(largest) / kSqrt2);
}

/// Corner with three edges whose determinant is `ideal` in the ideal cell with unit edges.
void add_corner(CellMeasure& m, const Vec& a, const Vec& b, const Vec& c, double ideal,
                double sign) {
  m.add(sign * determinant(a, b, c),
        ideal * std::sqrt(a.squaredNorm() * b.squaredNorm() * c.squaredNorm()));
}

void measure_tetra(CellMeasure& m, const CellPoints& p, double sign) {
  const Vec origin = p[0];
  add_tetra(m, p[1] - origin, p[2] - origin, p[3] - origin, sign);
}

void measure_hexahedron(CellMeasure& m, const std::array<Vec, 8>& x, double sign) {
  for (const LocalCorner& k : kHexahedronCorners)
    add_corner(m, x[k[1]] - x[k[0]], x[k[2]] - x[k[0]], x[k[3]] - x[k[0]], 1, sign);
  const Vec a = x[1] + x[2] + x[5] + x[6] - x[0] - x[3] - x[4] - x[7];
  const Vec b = x[2] + x[3] + x[6] + x[7] - x[0] - x[1] - x[4] - x[5];
  const Vec c = x[4] + x[5] + x[6] + x[7] - x[0] - x[1] - x[2] - x[3];
  m.add_value(sign * determinant(a, b, c), a.norm() * b.norm() * c.norm());
}

void measure_corners(CellMeasure& m, const CellPoints& p, std::span<const LocalCorner> corners,
                     double ideal, double sign) {
  for (const LocalCorner& k : corners) {
    const Vec x = p[k[0]];
    add_corner(m, p[k[1]] - x, p[k[2]] - x, p[k[3]] - x, ideal, sign);
  }
}

/// Apex of a pyramid: `edges` run from it to the corners of the base.
void add_apex(CellMeasure& m, const std::array<Vec, 4>& edges, double sign) {
  for (int i = 0; i < 4; ++i)
    add_corner(m, edges[i], edges[(i + 3) % 4], edges[(i + 2) % 4], 1 / kSqrt2, sign);
}

Vec mean(const Points& points, std::span<const Index> nodes) {
  Vec sum = Vec::Zero();
  for (Index node : nodes) sum += points.row(node).transpose();
  return sum / static_cast<double>(nodes.size());
}

/// Sine of the angle under which a side of a regular polygon is seen from its centre.
double regular_sine(std::size_t sides) {
  return std::sin(2 * std::numbers::pi / static_cast<double>(sides));
}

void measure_polyhedron(CellMeasure& m, const Mesh& mesh, const Points& points, Index c,
                        double sign) {
  const Vec centre = mean(points, mesh.cell(c));
  for_each_polyhedron_face(mesh, c, [&](std::span<const Index> face) {
    const Vec middle = mean(points, face);
    const double ideal = regular_sine(face.size());
    Vec a = points.row(face.back()).transpose() - middle;
    for (Index node : face) {
      const Vec b = points.row(node).transpose() - middle;
      add_corner(m, middle - centre, a, b, ideal, sign);
      a = b;
    }
  });
}

void measure_triangle(CellMeasure& m, const CellPoints& p) {
  const Vec a = p[1] - p[0], b = p[2] - p[0];
  m.add(a.cross(b).norm(), largest_edge_product(a, b) / kTwoOverSqrt3);
}

void measure_quad(CellMeasure& m, const std::array<Vec, 4>& x) {
  const Vec normal = (x[2] - x[0]).cross(x[3] - x[1]).normalized();
  for (int i = 0; i < 4; ++i) {
    const Vec a = x[(i + 1) % 4] - x[i], b = x[(i + 3) % 4] - x[i];
    m.add(normal.dot(a.cross(b)), a.norm() * b.norm());
  }
}

void measure_polygon(CellMeasure& m, const CellPoints& p) {
  const auto count = static_cast<int>(p.nodes.size());
  const Vec centre = mean(p.points, p.nodes);
  Vec normal = Vec::Zero();
  for (int i = 0; i < count; ++i) normal += (p[i] - centre).cross(p[(i + 1) % count] - centre);
  normal.normalize();
  for (int i = 0; i < count; ++i) {
    const Vec a = p[i] - centre, b = p[(i + 1) % count] - centre;
    m.add(normal.dot(a.cross(b)), regular_sine(count) * a.norm() * b.norm());
  }
}

Eigen::Matrix3d jacobian(const CellPoints& p,
                         const Eigen::Matrix<double, Eigen::Dynamic, 3>& derivatives) {
  Eigen::Matrix3d j = Eigen::Matrix3d::Zero();
  for (int i = 0; i < derivatives.rows(); ++i) j += p[i] * derivatives.row(i);
  return j;
}

void add_sample(CellMeasure& m, Shape shape, const Eigen::Matrix3d& j, double sign) {
  const Vec a = j.col(0), b = j.col(1), c = j.col(2);
  switch (shape) {
    case Shape::Simplex:
      return add_tetra(m, a, b, c, sign);
    case Shape::Prism:
      return m.add(sign * determinant(a, b, c),
                   largest_edge_product(a, b) * c.norm() / kTwoOverSqrt3);
    case Shape::Pyramid:
      return add_corner(m, a, b, c, 1 / kSqrt2, sign);
    default:
      return add_corner(m, a, b, c, 1, sign);
  }
}

void measure_quadratic_solid(CellMeasure& m, const Element& element, const CellPoints& p,
                             double sign) {
  for (const auto& sample : element.samples)
    add_sample(m, element.shape, jacobian(p, sample), sign);
  if (element.shape != Shape::Pyramid) return;
  std::array<Vec, 4> tangents;
  for (int i = 0; i < 4; ++i) tangents[i] = 4 * p[9 + i] - 3 * p[4] - p[i];
  add_apex(m, tangents, sign);
}

void measure_quadratic_shell(CellMeasure& m, const Element& element, const CellPoints& p) {
  std::array<Eigen::Matrix3d, 10> jacobians;
  Vec normal = Vec::Zero();
  const auto count = element.samples.size();
  for (std::size_t s = 0; s < count; ++s) {
    jacobians[s] = jacobian(p, element.samples[s]);
    normal += jacobians[s].col(0).cross(jacobians[s].col(1));
  }
  normal.normalize();
  for (std::size_t s = 0; s < count; ++s) {
    const Vec a = jacobians[s].col(0), b = jacobians[s].col(1);
    const double unit = element.shape == Shape::Triangle
                            ? largest_edge_product(a, b) / kTwoOverSqrt3
                            : a.norm() * b.norm();
    m.add(normal.dot(a.cross(b)), unit);
  }
}

template <std::size_t N>
std::array<Vec, N> gather(const CellPoints& p, const std::array<int, N>& order) {
  std::array<Vec, N> x;
  for (std::size_t i = 0; i < N; ++i) x[i] = p[order[i]];
  return x;
}

CellMeasure measure_cell(const Mesh& mesh, const Points& points, Index c, double sign) {
  const CellPoints p{points, mesh.cell(c)};
  const CellType type = mesh.types[c];
  CellMeasure m;
  switch (type) {
    case Vertex:
    case PolyVertex:
    case Line:
    case PolyLine:
    case QuadraticEdge:
      break;
    case Triangle:
      measure_triangle(m, p);
      break;
    case Quad:
      measure_quad(m, gather<4>(p, {0, 1, 2, 3}));
      break;
    case Pixel:
      measure_quad(m, gather<4>(p, {0, 1, 3, 2}));
      break;
    case Polygon:
      if (p.nodes.size() == 3)
        measure_triangle(m, p);
      else if (p.nodes.size() == 4)
        measure_quad(m, gather<4>(p, {0, 1, 2, 3}));
      else
        measure_polygon(m, p);
      break;
    case Tetra:
      measure_tetra(m, p, sign);
      break;
    case Hexahedron:
      measure_hexahedron(m, gather<8>(p, {0, 1, 2, 3, 4, 5, 6, 7}), sign);
      break;
    case Voxel:
      measure_hexahedron(m, gather<8>(p, kVoxelOrder), sign);
      break;
    case Wedge:
      measure_corners(m, p, kWedgeCorners, 1 / kTwoOverSqrt3, sign);
      break;
    case Pyramid:
      measure_corners(m, p, kPyramidCorners, 1 / kSqrt2, sign);
      break;
    case Polyhedron:
      measure_polyhedron(m, mesh, points, c, sign);
      break;
    default:
      if (dimension(type) == 3)
        measure_quadratic_solid(m, element_of(type), p, sign);
      else
        measure_quadratic_shell(m, element_of(type), p);
  }
  return m;
}

/// What one chunk of cells adds to a QualityReport.
struct Part {
  Index cells = 0;
  double sum = 0;
  double min = std::numeric_limits<double>::infinity();
  Index worst_cell = -1;
};

// The figures of all values, of the cells that were measured.
void summarise(QualityReport& report) {
  const Index count = std::ssize(report.values);
  std::vector<Part> parts((count + kGrain - 1) / kGrain);
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    Part& part = parts[begin / kGrain];
    for (Index c = begin; c < end; ++c) {
      const double value = report.values[c];
      if (std::isnan(value)) continue;
      ++part.cells;
      part.sum += value;
      if (value < part.min) {
        part.min = value;
        part.worst_cell = c;
      }
    }
  });
  Part all;
  for (const Part& part : parts) {
    all.cells += part.cells;
    all.sum += part.sum;
    if (part.min < all.min) {
      all.min = part.min;
      all.worst_cell = part.worst_cell;
    }
  }
  report.cells = all.cells;
  report.min = all.cells > 0 ? all.min : 0;
  report.mean = all.cells > 0 ? all.sum / static_cast<double>(all.cells) : 0;
  report.worst_cell = all.worst_cell;
  report.inverted = std::ssize(report.inverted_cells);
}

// Sets the values of cells; returns those that are inverted, in the order of `cells`.
template <class Cells>
std::vector<Index> measure_cells(const Mesh& mesh, const Points& points,
                                 const Orientation& orientation, const Cells& cells,
                                 std::vector<double>& values) {
  const int measured = dimension(mesh);
  const Index count = std::ssize(cells);
  std::vector<std::vector<Index>> inverted((count + kGrain - 1) / kGrain);
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Index c = cells[i];
      if (dimension(mesh.types[c]) != measured) continue;
      const int sign = orientation.at(static_cast<std::size_t>(mesh.types[c]));
      const CellMeasure m = measure_cell(mesh, points, c, sign);
      values[c] = m.value;
      if (m.is_inverted && !(finite_volume::is_volume(mesh, mesh.types[c]) &&
                             finite_volume::is_sound(mesh, points, c, sign)))
        inverted[begin / kGrain].push_back(c);
    }
  });
  std::vector<Index> all;
  for (const auto& part : inverted) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// Shell cells have no sign of their own, those of a plane mesh that of the others.
void count_turned_cells(const Mesh& mesh, const Points& points, QualityReport& report) {
  if (dimension(mesh) != 2) return;
  const std::vector<Index> turned = turned_cells(mesh, points), found = report.inverted_cells;
  for (const Index c : turned) report.values[c] = -std::abs(report.values[c]);
  report.inverted_cells.clear();
  std::ranges::set_union(found, turned, std::back_inserter(report.inverted_cells));
}

}  // namespace

double scaled_jacobian(const Mesh& mesh, const Points& points, Index c) {
  return measure_cell(mesh, points, c, 1).value;
}

Orientation detect_orientation(const Mesh& mesh) {
  constexpr int kTypes = 256;  // CellType is a byte
  // Of a large mesh every so many-th cell of a type: far more than a majority takes, soon counted.
  constexpr Index kVoters = 100'000;
  const Index stride = 1 + mesh.cell_count() / kVoters;
  const Index chunks = (mesh.cell_count() + kGrain - 1) / kGrain;
  std::vector<std::array<Index, kTypes>> balances(chunks);
  parallel_for(mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    auto& balance = balances[begin / kGrain];
    balance.fill(0);
    std::array<Index, kTypes> seen{};
    for (Index c = begin; c < end; ++c) {
      const auto type = static_cast<std::size_t>(mesh.types[c]);
      if (dimension(mesh.types[c]) != 3 || seen[type]++ % stride != 0) continue;
      const double sum = measure_cell(mesh, mesh.points, c, 1).determinants;
      balance[type] += (sum > 0) - (sum < 0);
    }
  });
  Orientation orientation(kTypes, 1);
  for (int type = 0; type < kTypes; ++type) {
    Index total = 0;
    for (const auto& balance : balances) total += balance[type];
    if (total < 0) orientation[type] = -1;
  }
  return orientation;
}

void check_positions(const Mesh& mesh, const Points& points) {
  if (points.rows() != mesh.node_count())
    throw InvalidInputError("quality of a mesh of " + std::to_string(mesh.node_count()) +
                            " nodes asked for with " + std::to_string(points.rows()) +
                            " node positions");
  if (points.allFinite()) return;
  for (Index n = 0; n < points.rows(); ++n)
    if (!points.row(n).allFinite())
      throw InvalidInputError("quality asked for, but the position of node " + std::to_string(n) +
                              " is not finite");
}

QualityReport measure_quality(const Mesh& mesh, const Points& points,
                              const Orientation& orientation) {
  check_positions(mesh, points);
  QualityReport report;
  report.values.assign(mesh.cell_count(), std::numeric_limits<double>::quiet_NaN());
  report.inverted_cells = measure_cells(
      mesh, points, orientation, std::views::iota(Index{0}, mesh.cell_count()), report.values);
  count_turned_cells(mesh, points, report);
  summarise(report);
  return report;
}

QualityReport measure_again(QualityReport before, const Mesh& mesh, const Points& points,
                            const Orientation& orientation, const std::vector<Index>& cells) {
  check_positions(mesh, points);
  std::vector<Index> others;
  std::ranges::set_difference(before.inverted_cells, cells, std::back_inserter(others));
  const std::vector<Index> inverted =
      measure_cells(mesh, points, orientation, cells, before.values);
  before.inverted_cells.clear();
  std::ranges::set_union(others, inverted, std::back_inserter(before.inverted_cells));
  count_turned_cells(mesh, points, before);
  summarise(before);
  return before;
}

}  // namespace cadmorph
