#include "core/validity.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <ranges>
#include <span>

#include "core/finite_volumes.h"
#include "core/jacobian_samples.h"
#include "core/orient3d.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

enum class Sign : char { Positive, NotPositive, Undecided };

// Cutting 12 times leaves parts of 2^-12 of the cell: what is undecided then touches zero.
constexpr int kMaxDepth = 12;
// Of a cell, that are looked at: one whose determinant is zero in a whole region would have 8^12.
constexpr int kMostParts = 100'000;
// Rounding of a 3 x 3 determinant of columns a, b, c, in |a| |b| |c|, and of the change of basis.
constexpr double kRounding = 256 * std::numeric_limits<double>::epsilon();
constexpr Index kBatch = 32;  // cells: 96 columns, enough for a product bound by arithmetic

// `parts`: how many may still be looked at.
Sign sign_of(const JacobianSamples& samples, const VectorXd& coefficients, double least, int depth,
             int& parts) {
  if (coefficients.minCoeff() > least) return Sign::Positive;
  for (const int corner : samples.corners)
    if (!(coefficients[corner] > least)) return Sign::NotPositive;
  if (depth == kMaxDepth || --parts < 0) return Sign::Undecided;
  Sign result = Sign::Positive;
  for (const MatrixXd& child : samples.children) {
    const Sign sign = sign_of(samples, child * coefficients, least, depth + 1, parts);
    if (sign == Sign::NotPositive) return sign;
    if (sign == Sign::Undecided) result = sign;
  }
  return result;
}

bool names_a_node_twice(std::span<const Index> nodes) {
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = i + 1; j < nodes.size(); ++j)
      if (nodes[i] == nodes[j]) return true;
  return false;
}

// Values of a bilinear function at 0, 1/2, 1 in both directions, the first the faster, from its
// corners.
using Grid = std::array<Vector3d, 9>;

Grid bilinear_grid(const Vector3d& at_00, const Vector3d& at_10, const Vector3d& at_01,
                   const Vector3d& at_11) {
  const Vector3d low = (at_00 + at_10) / 2, high = (at_01 + at_11) / 2;
  return {at_00, low,  at_10, (at_00 + at_01) / 2, (low + high) / 2, (at_10 + at_11) / 2,
          at_01, high, at_11};
}

// The derivatives of a hexahedron's map in one direction: bilinear in the other two, so none is
// farther from the mean of the four edges than these are.
struct Derivatives {
  std::array<Vector3d, 4> edges;
  Vector3d mean = (edges[0] + edges[1] + edges[2] + edges[3]) / 4;
  double length = mean.norm();
  double spread =
      std::sqrt(std::max({(edges[0] - mean).squaredNorm(), (edges[1] - mean).squaredNorm(),
                          (edges[2] - mean).squaredNorm(),
                          (edges[3] - mean).squaredNorm()}));  ///< of the edges about their mean

  Grid grid() const { return bilinear_grid(edges[0], edges[1], edges[2], edges[3]); }
};

// Whether the determinant of the means is larger than any change of its columns within their
// spreads, which by multilinearity and Hadamard's inequality is at most the product of the lengths
// with spreads less that without. So it is in cells near to a parallelepiped, and soon told.
bool is_positive_about_mean(const Derivatives& r, const Derivatives& s, const Derivatives& t,
                            int orientation) {
  const double longest = (r.length + r.spread) * (s.length + s.spread) * (t.length + t.spread);
  const double change = longest - r.length * s.length * t.length;
  return orientation * r.mean.dot(s.mean.cross(t.mean)) > change + kRounding * longest;
}

// Values of a quadratic at 0, 1/2, 1 -> its Bernstein coefficients: the middle one changes.
void to_bernstein(double* middle, Index stride) {
  *middle = 2 * *middle - (middle[-stride] + middle[stride]) / 2;
}

// The first Bernstein bound of a hexahedron by the products its map consists of: what most cells
// pass, several times faster than by the matrices of JacobianSamples.
bool is_surely_valid_hexahedron(const Mesh& mesh, const Points& points, Index c, int orientation) {
  const auto cell = mesh.cell(c);
  const auto edge = [&](int from, int to) -> Vector3d {
    return (points.row(cell[to]) - points.row(cell[from])).transpose();
  };
  const Derivatives by_r{{edge(0, 1), edge(3, 2), edge(4, 5), edge(7, 6)}};  // of (s, t)
  const Derivatives by_s{{edge(0, 3), edge(1, 2), edge(4, 7), edge(5, 6)}};  // of (r, t)
  const Derivatives by_t{{edge(0, 4), edge(1, 5), edge(3, 7), edge(2, 6)}};  // of (r, s)
  if (is_positive_about_mean(by_r, by_s, by_t, orientation)) return true;
  const Grid r = by_r.grid(), s = by_s.grid(), t = by_t.grid();
  std::array<double, 27> b;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        b[9 * k + 3 * j + i] = orientation * r[3 * k + j].dot(s[3 * k + i].cross(t[3 * j + i]));
  for (int a = 0; a < 3; ++a)
    for (int d = 0; d < 3; ++d) to_bernstein(&b[9 * a + 3 * d + 1], 1);
  for (int a = 0; a < 3; ++a)
    for (int d = 0; d < 3; ++d) to_bernstein(&b[9 * a + 3 + d], 3);
  for (int a = 0; a < 9; ++a) to_bernstein(&b[9 + a], 9);
  const auto longest = [](const Grid& grid) {
    return std::sqrt(std::max({grid[0].squaredNorm(), grid[2].squaredNorm(), grid[6].squaredNorm(),
                               grid[8].squaredNorm()}));
  };
  return *std::ranges::min_element(b) > kRounding * longest(r) * longest(s) * longest(t);
}

// Cells of one mapped type, tested together so that their products are one matrix product.
class Batch {
 public:
  Batch(const Mesh& mesh, const Points& points, const Orientation& orientation)
      : mesh_(mesh), points_(points), orientation_(orientation) {}

  void add(Index cell, std::vector<Sign>& signs) {
    if (!cells_.empty() && mesh_.types[cell] != mesh_.types[cells_.front()]) flush(signs);
    cells_.push_back(cell);
    if (static_cast<Index>(cells_.size()) == kBatch) flush(signs);
  }

  void flush(std::vector<Sign>& signs) {
    if (cells_.empty()) return;
    const CellType type = mesh_.types[cells_.front()];
    const JacobianSamples& samples = *jacobian_samples(type);
    gather(samples.nodes);
    slopes_.noalias() = samples.derivatives * positions_;
    evaluate(samples.samples, orientation_[static_cast<std::size_t>(type)]);
    coefficients_.noalias() = samples.to_bernstein * determinants_;
    for (std::size_t i = 0; i < cells_.size(); ++i) signs[cells_[i]] = sign_at(samples, i);
    cells_.clear();
  }

 private:
  // Relative to the first node, so that a small cell far from the origin loses no digits.
  void gather(int nodes) {
    positions_.resize(nodes, 3 * cells_.size());
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const auto cell = mesh_.cell(cells_[i]);
      for (int n = 0; n < nodes; ++n)
        positions_.block<1, 3>(n, 3 * i) = points_.row(cell[n]) - points_.row(cell[0]);
    }
  }

  void evaluate(int samples, int orientation) {
    determinants_.resize(samples, cells_.size());
    scale_.setZero(cells_.size());
    for (std::size_t i = 0; i < cells_.size(); ++i)
      for (int s = 0; s < samples; ++s) {
        const Eigen::Matrix3d jacobian = slopes_.block<3, 3>(3 * s, 3 * i);
        determinants_(s, i) = orientation * jacobian.determinant();
        const Vector3d lengths = jacobian.rowwise().norm();
        scale_[i] = std::max(scale_[i], lengths.prod());
      }
  }

  Sign sign_at(const JacobianSamples& samples, std::size_t i) const {
    const double noise = kRounding * scale_[i];
    const auto column = coefficients_.col(i);
    if (column.maxCoeff() <= noise) return Sign::NotPositive;
    if (column.minCoeff() > noise) return Sign::Positive;
    const bool may_vanish = names_a_node_twice(mesh_.cell(cells_[i]));
    int parts = kMostParts;
    return sign_of(samples, column, may_vanish ? -noise : noise, 0, parts);
  }

  const Mesh& mesh_;
  const Points& points_;
  const Orientation& orientation_;
  std::vector<Index> cells_;
  MatrixXd positions_, slopes_, determinants_, coefficients_;
  VectorXd scale_;
};

Sign tetra_sign(const Mesh& mesh, const Points& points, Index c, int orientation) {
  const auto cell = mesh.cell(c);
  const int sign = orient3d(points.row(cell[0]).transpose(), points.row(cell[1]).transpose(),
                            points.row(cell[2]).transpose(), points.row(cell[3]).transpose());
  return sign * orientation > 0 ? Sign::Positive : Sign::NotPositive;
}

/// A face's triangles as tetrahedra over a point: six times their volume, and that times the mean
/// of the corners that differ from the point.
struct Pyramid {
  double volume = 0;
  Vector3d moment = Vector3d::Zero();
};

Pyramid pyramid_of(const Facet& facet, const Points& points, const Vector3d& apex) {
  Pyramid result;
  for (std::size_t i = 1; i + 1 < facet.nodes.size(); ++i) {
    const Vector3d a = points.row(facet.nodes[0]).transpose() - apex;
    const Vector3d b = points.row(facet.nodes[i]).transpose() - apex;
    const Vector3d d = points.row(facet.nodes[i + 1]).transpose() - apex;
    const double volume = a.dot(b.cross(d));
    result.volume += volume;
    result.moment += volume * (a + b + d);
  }
  return result;
}

/// Many nodes at one side pull the nodes' mean out of a sound cell: the centroid of the volume,
/// which finite volumes take, decides then.
Sign polyhedron_sign(const Mesh& mesh, const Points& points, Index c, int orientation) {
  Vector3d centre = Vector3d::Zero();
  for (const Index node : mesh.cell(c)) centre += points.row(node).transpose();
  centre /= static_cast<double>(mesh.cell(c).size());
  const std::vector<Facet> facets = cell_facets(mesh, c);
  const auto is_inside = [&](const Vector3d& point) {
    return std::ranges::all_of(facets, [&](const Facet& facet) {
      return pyramid_of(facet, points, point).volume * orientation > 0;
    });
  };
  if (is_inside(centre)) return Sign::Positive;
  Pyramid whole;
  for (const Facet& facet : facets) {
    const Pyramid pyramid = pyramid_of(facet, points, centre);
    whole.volume += pyramid.volume;
    whole.moment += pyramid.moment;
  }
  if (whole.volume * orientation <= 0) return Sign::NotPositive;
  return is_inside(centre + whole.moment / (4 * whole.volume)) ? Sign::Positive : Sign::NotPositive;
}

template <class Cells>
void test_cells(const Mesh& mesh, const Points& points, const Orientation& orientation,
                const Cells& cells, std::vector<Sign>& signs) {
  Batch batch(mesh, points, orientation);
  for (const Index c : cells) {
    const CellType type = mesh.types[c];
    const int sign = orientation[static_cast<std::size_t>(type)];
    if (dimension(type) != 3) continue;
    if (type == CellType::Tetra)
      signs[c] = tetra_sign(mesh, points, c, sign);
    else if (finite_volume::is_volume(mesh, type))
      signs[c] =
          finite_volume::is_sound(mesh, points, c, sign) ? Sign::Positive : Sign::NotPositive;
    else if (type == CellType::Polyhedron)
      signs[c] = polyhedron_sign(mesh, points, c, sign);
    else if (type != CellType::Hexahedron || !is_surely_valid_hexahedron(mesh, points, c, sign))
      batch.add(c, signs);
  }
  batch.flush(signs);
}

std::span<const Index> corners_of(const Facet& facet) {
  const auto count = static_cast<Index>(facet.nodes.size());
  return std::span(facet.nodes).first(corner_count(facet.type, count));
}

// +1 where two rings of the same corners go the same way round, -1 where they go against each
// other, 0 where they are no such rings.
int common_sense(std::span<const Index> a, std::span<const Index> b) {
  const auto place = std::ranges::find(b, a[0]);
  if (a.size() != b.size() || place == b.end()) return 0;
  const auto start = static_cast<std::size_t>(place - b.begin()), n = a.size();
  bool is_same = true, is_opposite = true;
  for (std::size_t i = 1; i < n; ++i) {
    is_same &= a[i] == b[(start + i) % n];
    is_opposite &= a[i] == b[(start + n - i) % n];
  }
  return is_same ? 1 : is_opposite ? -1 : 0;
}

// Of `invalid_cells`: those that hold all corners of a face that a valid cell has with no other
// cell, yet no such face. Where two nodes of a hexahedron are swapped, most of its faces are no
// face of a cell around any more.
std::vector<Index> cells_that_miss_faces(const Mesh& mesh, const CellNeighbours& neighbours,
                                         const std::vector<Index>& invalid_cells) {
  std::vector<std::pair<Index, Index>> cell_at_node;
  for (const Index c : invalid_cells)
    if (dimension(mesh.types[c]) == 3)
      for (const Index node : mesh.cell(c)) cell_at_node.emplace_back(node, c);
  std::ranges::sort(cell_at_node);
  std::vector<Index> result;
  const auto look_round = [&](std::span<const Index> face) {
    const auto at_node =
        std::ranges::equal_range(cell_at_node, face[0], {}, &std::pair<Index, Index>::first);
    for (const auto& [node, c] : at_node)
      if (std::ranges::all_of(face, [&](Index corner) {
            return std::ranges::find(mesh.cell(c), corner) != mesh.cell(c).end();
          }))
        result.push_back(c);
  };
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const auto open = neighbours.of(c);
    if (std::ranges::find(open, -1) == open.end() || std::ranges::binary_search(invalid_cells, c))
      continue;
    const auto facets = cell_facets(mesh, c);
    for (std::size_t f = 0; f < facets.size(); ++f)
      if (open[f] < 0) look_round(corners_of(facets[f]));
  }
  std::ranges::sort(result);
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

template <class Cells>
ValidityReport check_cells(const Mesh& mesh, const Points& points, const Orientation& orientation,
                           const Cells& cells) {
  check_positions(mesh, points);
  std::vector<Sign> signs(mesh.cell_count(), Sign::Positive);
  parallel_for(std::ssize(cells), 4096, [&](Index begin, Index end) {
    test_cells(mesh, points, orientation,
               std::ranges::subrange(cells.begin() + begin, cells.begin() + end), signs);
  });
  ValidityReport report;
  for (const Index c : cells) {
    if (dimension(mesh.types[c]) == 3) ++report.cells;
    if (signs[c] == Sign::Positive) continue;
    report.invalid_cells.push_back(c);
    if (signs[c] == Sign::Undecided) ++report.undecided;
  }
  report.invalid = static_cast<Index>(report.invalid_cells.size());
  return report;
}

}  // namespace

ValidityReport check_validity(const Mesh& mesh, const Points& points,
                              const Orientation& orientation) {
  return check_cells(mesh, points, orientation, std::views::iota(Index{0}, mesh.cell_count()));
}

ValidityReport check_validity(const Mesh& mesh, const Points& points,
                              const Orientation& orientation, const std::vector<Index>& cells) {
  return check_cells(mesh, points, orientation, cells);
}

std::vector<Index> misordered_cells(const Mesh& mesh, const CellNeighbours& neighbours,
                                    const Orientation& orientation,
                                    const std::vector<Index>& invalid_cells) {
  const auto sign = [&](Index c) { return orientation[static_cast<std::size_t>(mesh.types[c])]; };
  // Sorted; grows, as a cell among misordered ones alone shows by them what it is.
  std::vector<Index> result = cells_that_miss_faces(mesh, neighbours, invalid_cells);
  const auto is_misordered = [&](Index c) {
    const auto facets = cell_facets(mesh, c);
    for (std::size_t f = 0; f < facets.size(); ++f) {
      const Index other = neighbours.neighbour[neighbours.offsets[c] + static_cast<Index>(f)];
      if (other < 0 || other == c) continue;
      const bool is_known = std::ranges::binary_search(result, other);
      if (!is_known && std::ranges::binary_search(invalid_cells, other)) continue;
      const int usual = is_known ? 1 : -1;
      for (const Facet& facet : cell_facets(mesh, other))
        if (common_sense(corners_of(facets[f]), corners_of(facet)) * sign(c) * sign(other) * usual <
            0)
          return true;
    }
    return false;
  };
  for (bool has_grown = true; has_grown;) {
    std::vector<Index> found;
    for (const Index c : invalid_cells)
      if (dimension(mesh.types[c]) == 3 && !std::ranges::binary_search(result, c) &&
          is_misordered(c))
        found.push_back(c);
    has_grown = !found.empty();
    result.insert(result.end(), found.begin(), found.end());
    std::ranges::sort(result);
  }
  return result;
}

}  // namespace cadmorph
