#include "volume/deformation_field.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/rbf/pointwise_field.h"

namespace cadmorph {
namespace {

// Finds rows of a point set by their coordinates, to the last bit (zeros of both signs are equal).
class RowsByPosition {
 public:
  explicit RowsByPosition(const Points& points) : points_(points), rows_(points.rows()) {
    std::iota(rows_.begin(), rows_.end(), Index{0});
    std::sort(rows_.begin(), rows_.end(), [&](Index a, Index b) {
      const auto order = compare(points_.row(a), points_.row(b));
      return order < 0 || (order == 0 && a < b);
    });
  }

  // The first row at a position; -1: none.
  Index find(const Eigen::RowVector3d& x) const {
    const auto found = std::lower_bound(
        rows_.begin(), rows_.end(), x,
        [&](Index row, const auto& value) { return compare(points_.row(row), value) < 0; });
    return found != rows_.end() && compare(points_.row(*found), x) == 0 ? *found : -1;
  }

 private:
  static int compare(const Eigen::RowVector3d& a, const Eigen::RowVector3d& b) {
    for (int d = 0; d < 3; ++d)
      if (a(d) != b(d)) return a(d) < b(d) ? -1 : 1;
    return 0;
  }

  const Points& points_;
  std::vector<Index> rows_;
};

void check_same_places(const std::vector<Index>& ids, const Points& nodes,
                       const Points& new_nodes) {
  const RowsByPosition rows(nodes);
  for (Index i = 0; i < nodes.rows(); ++i) {
    const Index first = rows.find(nodes.row(i));
    if (new_nodes.row(i) != new_nodes.row(first))
      throw InvalidInputError(
          "nodes " + std::to_string(ids[first]) + " and " + std::to_string(ids[i]) +
          " lie at the same place and move apart (bodies in contact): no field of the position can "
          "say so; make a field for the mesh of each body");
  }
}

}  // namespace

DeformationTerms record_deformation(const Mesh& mesh, const VolumeMorph& first,
                                    const SurfaceMotion& motion, int steps) {
  DeformationTerms terms;
  terms.low = mesh.points.colwise().minCoeff();
  terms.high = mesh.points.colwise().maxCoeff();
  terms.new_nodes = motion.target;
  terms.nodes.resize(motion.target.rows(), 3);
  for (Index i = 0; i < terms.nodes.rows(); ++i)
    terms.nodes.row(i) = mesh.points.row(first.surface_nodes()[i]);
  if (first.field_count() > 1)
    throw InvalidInputError("the mesh has " + std::to_string(first.field_count()) +
                            " components that morph one by one: which of them a point of another "
                            "mesh belongs to its position can't say; make a field for the mesh "
                            "of each");
  check_same_places(first.surface_nodes(), terms.nodes, terms.new_nodes);
  for (const std::vector<RbfField>& fields : fields_of_steps(mesh, first, motion, steps))
    terms.steps.push_back(fields.front().terms());
  return terms;
}

struct DeformationField::Impl {
  explicit Impl(DeformationTerms given) : terms(std::move(given)), rows(terms.nodes) {
    for (const FieldTerms& step : terms.steps) steps.emplace_back(step);
  }

  DeformationTerms terms;
  RowsByPosition rows;
  std::vector<PointwiseField> steps;
};

DeformationField::DeformationField(DeformationTerms terms)
    : impl_(std::make_unique<const Impl>(std::move(terms))) {}

DeformationField::~DeformationField() = default;
DeformationField::DeformationField(DeformationField&&) noexcept = default;

const DeformationTerms& DeformationField::terms() const { return impl_->terms; }

MovedPoints DeformationField::apply(const Points& points) const {
  const DeformationTerms& terms = impl_->terms;
  MovedPoints moved{.positions = points};
  for (const PointwiseField& step : impl_->steps)
    moved.positions += step.evaluate(Points(moved.positions));
  for (Index i = 0; i < points.rows(); ++i) {
    const Eigen::RowVector3d x = points.row(i);
    if ((x.array() < terms.low.array()).any() || (x.array() > terms.high.array()).any())
      ++moved.outside;
    const Index node = impl_->rows.find(x);
    if (node < 0) continue;
    ++moved.at_nodes;
    moved.positions.row(i) = terms.new_nodes.row(node);
  }
  return moved;
}

}  // namespace cadmorph
