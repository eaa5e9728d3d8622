#include "core/rbf/conjugate_gradient.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::RowVectorXd;

RowVectorXd column_dots(const MatrixXd& a, const MatrixXd& b) {
  RowVectorXd result(a.cols());
  for (Index c = 0; c < a.cols(); ++c) result(c) = a.col(c).dot(b.col(c));
  return result;
}

// Columns that are solved already (zero denominators) stand still.
RowVectorXd safe_quotient(const RowVectorXd& a, const RowVectorXd& b) {
  return (b.array() > 0).select(a.array() / b.array().max(1e-300), 0.0);
}

// The iteration of one set.
struct State {
  MatrixXd r, direction, image;
  RowVectorXd previous;
  CgResult result;
};

// One application of a map to the same member of all sets; take(set, image) gets each image.
template <class Take>
void apply_to(const LinearMap& map, const std::vector<State*>& sets, MatrixXd State::*member,
              const Take& take) {
  if (sets.empty()) return;
  std::vector<const MatrixXd*> columns;
  for (const State* set : sets) columns.push_back(&(set->*member));
  const MatrixXd image = map(join_columns(columns));
  Index column = 0;
  for (State* set : sets) {
    const Index width = set->r.cols();
    take(*set, image.middleCols(column, width));
    column += width;
  }
}

void set_direction(const MatrixXd& P, State& set, MatrixXd z) {
  project_out(P, z);
  const RowVectorXd current = column_dots(set.r, z);
  set.direction = z + set.direction * safe_quotient(current, set.previous).asDiagonal();
  set.previous = current;
}

void take_step(const MatrixXd& P, State& set) {
  const RowVectorXd step = safe_quotient(set.previous, column_dots(set.direction, set.image));
  set.result.weights += set.direction * step.asDiagonal();
  set.r -= set.image * step.asDiagonal();
  project_out(P, set.r);
  ++set.result.iterations;
}

}  // namespace

MatrixXd join_columns(const std::vector<const MatrixXd*>& sets) {
  Index columns = 0;
  for (const MatrixXd* set : sets) columns += set->cols();
  MatrixXd result(sets.empty() ? 0 : sets.front()->rows(), columns);
  columns = 0;
  for (const MatrixXd* set : sets) {
    result.middleCols(columns, set->cols()) = *set;
    columns += set->cols();
  }
  return result;
}

void project_out(const MatrixXd& P, MatrixXd& r) {
  const MatrixXd coefficients = P.transpose() * r / static_cast<double>(P.rows());
  r.noalias() -= P * coefficients;
}

double relative_residual(const MatrixXd& r, const Eigen::VectorXd& allowed) {
  if (!r.allFinite()) return std::numeric_limits<double>::infinity();
  const Index width = r.cols() % 3 == 0 ? 3 : r.cols();
  double largest = 0;
  for (Index c = 0; c < r.cols(); c += width)
    largest = std::max(
        largest, (r.middleCols(c, width).rowwise().norm().array() / allowed.array()).maxCoeff());
  return largest;
}

std::vector<CgResult> solve_projected_cg(const LinearMap& A, const LinearMap& preconditioner,
                                         const MatrixXd& P, std::vector<MatrixXd> r,
                                         const std::vector<Eigen::VectorXd>& allowed,
                                         const CgOptions& options) {
  std::vector<State> states(r.size());
  for (std::size_t s = 0; s < r.size(); ++s) {
    State& set = states[s];
    set.r = std::move(r[s]);
    set.direction = set.result.weights = MatrixXd::Zero(set.r.rows(), set.r.cols());
    set.previous = RowVectorXd::Zero(set.r.cols());
    project_out(P, set.r);
  }
  const auto take_image = [](State& set, const auto& image) { set.image = image; };
  for (int iteration = 0;; ++iteration) {
    std::vector<State*> active, exact, relaxed;
    double worst = 0;
    for (std::size_t s = 0; s < states.size(); ++s) {
      CgResult& result = states[s].result;
      if (iteration > 0 && result.has_converged()) continue;
      result.residual = relative_residual(states[s].r, allowed[s]);
      worst = std::max(worst, result.residual);
      if (result.has_converged()) continue;
      active.push_back(&states[s]);
      const bool is_relaxed = options.relaxed && result.residual < options.relaxed_below;
      (is_relaxed ? relaxed : exact).push_back(&states[s]);
    }
    if (options.watch) options.watch(iteration, worst);
    if (active.empty() || iteration == options.max_iterations) break;
    apply_to(preconditioner, active, &State::r,
             [&](State& set, const auto& z) { set_direction(P, set, z); });
    apply_to(A, exact, &State::direction, take_image);
    apply_to(options.relaxed, relaxed, &State::direction, take_image);
    for (State* set : active) take_step(P, *set);
  }
  std::vector<CgResult> results;
  for (State& set : states) results.push_back(std::move(set.result));
  return results;
}

}  // namespace cadmorph
