#include "core/rbf/unit_targets.h"

#include <utility>

#include "core/archive_types.h"
#include "core/parallel.h"
#include "core/rbf/conjugate_gradient.h"
#include "core/rbf/field_evaluator.h"
#include "core/rbf/multiscale_correction.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

// Up to here direct sums beat the trees.
constexpr Index kFewTargets = 2000;

bool share_sums(const UnitField& a, const UnitField& b) {
  return a.centres == b.centres && a.far_field == b.far_field;
}

}  // namespace

UnitTargets::UnitTargets(const KernelSum& sum, MatrixXd points, const H2Matrix* far_field)
    : sum_(sum), count_(points.rows()) {
  if (far_field && count_ > kFewTargets)
    far_ = std::make_shared<const FieldEvaluator>(*far_field, points);
  else
    direct_points_ = std::move(points);
}

UnitTargets::UnitTargets(const KernelSum& sum, InputArchive& archive) : sum_(sum), count_(0) {
  bool has_evaluator = false;
  archive(count_, direct_points_, has_evaluator);
  if (has_evaluator) far_ = std::make_shared<const FieldEvaluator>(archive);
}

void UnitTargets::store(OutputArchive& archive) const {
  archive(count_, direct_points_, static_cast<bool>(far_));
  if (far_) far_->store(archive);
}

const MatrixXd& UnitTargets::points() const {
  return far_ ? far_->targets().points : direct_points_;
}

// Kernel sums of fields that share them, side by side, in the order of points().
MatrixXd UnitTargets::sums(const std::vector<const UnitField*>& fields) const {
  std::vector<const MatrixXd*> weights;
  for (const UnitField* field : fields) weights.push_back(&field->weights);
  const UnitField& first = *fields.front();
  const MatrixXd all = join_columns(weights);
  if (!far_ || !first.far_field) return sum_(points(), *first.centres, all);
  return far_->evaluate(*first.far_field, first.far_field->compress(all));
}

// Adds the linear part and the correction; brings the rows into the order of the caller.
RowMatrix UnitTargets::finish(const UnitField& field,
                              const Eigen::Ref<const MatrixXd>& sums) const {
  const MatrixXd& x = points();
  MatrixXd correction;
  if (field.correction) correction = field.correction->evaluate(x);
  RowMatrix result(count_, sums.cols());
  parallel_for(count_, 4096, [&](Index begin, Index end) {
    const Index n = end - begin;
    MatrixXd values = sums.middleRows(begin, n);
    values += x.middleRows(begin, n) * field.linear.bottomRows(x.cols());
    values.rowwise() += field.linear.row(0);
    if (field.correction) values += correction.middleRows(begin, n);
    for (Index i = 0; i < n; ++i)
      result.row(far_ ? far_->targets().rows[begin + i] : begin + i) = values.row(i);
  });
  return result;
}

std::vector<RowMatrix> UnitTargets::evaluate(const std::vector<const UnitField*>& fields) const {
  std::vector<RowMatrix> results(fields.size());
  std::vector<char> is_done(fields.size(), 0);
  for (std::size_t first = 0; first < fields.size(); ++first) {
    if (is_done[first]) continue;
    std::vector<std::size_t> group;
    std::vector<const UnitField*> members;
    for (std::size_t f = first; f < fields.size(); ++f)
      if (!is_done[f] && share_sums(*fields[first], *fields[f])) {
        group.push_back(f);
        members.push_back(fields[f]);
      }
    const MatrixXd all = sums(members);
    Index column = 0;
    for (const std::size_t f : group) {
      const Index width = fields[f]->weights.cols();
      results[f] = finish(*fields[f], all.middleCols(column, width));
      column += width;
      is_done[f] = 1;
    }
  }
  return results;
}

}  // namespace cadmorph
