#include "core/validity.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <limits>

#include "core/jacobian_samples.h"
#include "core/orient3d.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

enum class Sign { Positive, NotPositive, Undecided };

// Cutting 12 times leaves parts of 2^-12 of the cell: what is undecided then touches zero.
constexpr int kMaxDepth = 12;
// Rounding of a 3 x 3 determinant of columns a, b, c, in |a| |b| |c|, and of the change of basis.
constexpr double kRounding = 256 * std::numeric_limits<double>::epsilon();
constexpr Index kBatch = 32;

Sign sign_of(const JacobianSamples& samples, const VectorXd& coefficients, double least,
             int depth) {
  if (coefficients.minCoeff() > least) return Sign::Positive;
  for (const int corner : samples.corners)
    if (coefficients[corner] <= least) return Sign::NotPositive;
  if (depth == kMaxDepth) return Sign::Undecided;
  Sign result = Sign::Positive;
  for (const MatrixXd& child : samples.children) {
    const Sign sign = sign_of(samples, child * coefficients, least, depth + 1);
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
    return sign_of(samples, column, may_vanish ? -noise : noise, 0);
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

Sign polyhedron_sign(const Mesh& mesh, const Points& points, Index c, int orientation) {
  Vector3d centre = Vector3d::Zero();
  for (const Index node : mesh.cell(c)) centre += points.row(node).transpose();
  centre /= static_cast<double>(mesh.cell(c).size());
  for (const Facet& facet : cell_facets(mesh, c)) {
    double volume = 0;
    const std::size_t count = facet.nodes.size();
    for (std::size_t i = 1; i + 1 < count; ++i) {
      const Vector3d a = points.row(facet.nodes[0]).transpose() - centre;
      const Vector3d b = points.row(facet.nodes[i]).transpose() - centre;
      const Vector3d d = points.row(facet.nodes[i + 1]).transpose() - centre;
      volume += a.dot(b.cross(d));
    }
    if (volume * orientation <= 0) return Sign::NotPositive;
  }
  return Sign::Positive;
}

void test_cells(const Mesh& mesh, const Points& points, const Orientation& orientation, Index begin,
                Index end, std::vector<Sign>& signs) {
  Batch batch(mesh, points, orientation);
  for (Index c = begin; c < end; ++c) {
    const CellType type = mesh.types[c];
    const int sign = orientation[static_cast<std::size_t>(type)];
    if (dimension(type) != 3) continue;
    if (type == CellType::Tetra)
      signs[c] = tetra_sign(mesh, points, c, sign);
    else if (type == CellType::Polyhedron)
      signs[c] = polyhedron_sign(mesh, points, c, sign);
    else
      batch.add(c, signs);
  }
  batch.flush(signs);
}

}  // namespace

ValidityReport check_validity(const Mesh& mesh, const Points& points,
                              const Orientation& orientation) {
  std::vector<Sign> signs(mesh.cell_count(), Sign::Positive);
  parallel_for(mesh.cell_count(), 4096, [&](Index begin, Index end) {
    test_cells(mesh, points, orientation, begin, end, signs);
  });
  ValidityReport report;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) == 3) ++report.cells;
    if (signs[c] == Sign::Positive) continue;
    report.invalid_cells.push_back(c);
    if (signs[c] == Sign::Undecided) ++report.undecided;
  }
  report.invalid = static_cast<Index>(report.invalid_cells.size());
  return report;
}

}  // namespace cadmorph
