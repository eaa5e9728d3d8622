#include "volume/baselines/interior_system.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>
#include <mutex>

#include "core/errors.h"
#include "core/remedies.h"

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseColumns = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;
using SparseRows = Eigen::SparseMatrix<double, Eigen::RowMajor, int>;

// Residual at which the iterations stop, as a part of the right-hand side's norm. Rows have a unit
// diagonal, so that this bounds the error of the weighted means, cells of any size alike.
constexpr double kTolerance = 1e-13;

// Largest residual that a solution may have, as a part of the largest prescribed value: far above
// kTolerance, far below what a cell feels.
constexpr double kAccuracy = 1e-9;

// Meshes with inverted elements take some thousand. Factors of 150,000 unknowns cost more than all.
constexpr int kMostIterations = 10000;

[[noreturn]] void fail_singular() {
  throw SolverError(
      "the linear system of the volume nodes is singular to rounding (elements without volume?); "
      "use another method, such as " +
      words_for(Remedy::RbfMethod));
}

/// A solver of A x = b for many b.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;
  virtual MatrixXd solve(const MatrixXd& rhs) const = 0;
};

template <class Iterations, class Matrix>
class IterativeSolver final : public LinearSolver {
 public:
  explicit IterativeSolver(Matrix A) : A_(std::move(A)) {
    iterations_.setTolerance(kTolerance);
    iterations_.setMaxIterations(kMostIterations);
    iterations_.compute(A_);
  }
  MatrixXd solve(const MatrixXd& rhs) const override {
    const std::lock_guard lock(mutex_);
    if (iterations_.info() != Eigen::Success && iterations_.info() != Eigen::NoConvergence)
      return MatrixXd::Zero(rhs.rows(), rhs.cols());
    return iterations_.solve(rhs);
  }

 private:
  Matrix A_;  // the iterations refer to it
  Iterations iterations_;
  mutable std::mutex mutex_;  // Eigen's solver keeps its figures in itself
};

using ConjugateGradients =
    IterativeSolver<Eigen::ConjugateGradient<SparseColumns, Eigen::Lower | Eigen::Upper,
                                             Eigen::IncompleteCholesky<double>>,
                    SparseColumns>;

// Incomplete factors of weighted means: Eigen's own threshold of 1e-12 drops next to nothing.
class SparseFactors : public Eigen::IncompleteLUT<double> {
 public:
  SparseFactors() {
    setDroptol(1e-3);
    setFillfactor(5);
  }
};

using BiconjugateGradients =
    IterativeSolver<Eigen::BiCGSTAB<SparseRows, SparseFactors>, SparseRows>;

template <class Factorisation>
MatrixXd solve_by_factors(const SparseColumns& A, const MatrixXd& rhs) {
  const Factorisation factors(A);
  if (factors.info() != Eigen::Success) fail_singular();
  return factors.solve(rhs);
}

}  // namespace

struct InteriorSystem::Impl {
  Impl(Index nodes, std::vector<Index> given, const std::vector<MatrixEntry>& entries,
       Symmetry kind)
      : symmetry(kind), prescribed(std::move(given)), place(nodes, 0) {
    for (const Index node : prescribed) place[node] = -1;
    for (Index node = 0; node < nodes; ++node)
      if (place[node] == 0) {
        place[node] = static_cast<int>(free.size());
        free.push_back(node);
      }
    for (std::size_t i = 0; i < prescribed.size(); ++i)
      place[prescribed[i]] = -1 - static_cast<int>(i);
    assemble(entries);
    if (free.empty()) return;
    if (symmetry == Symmetry::PositiveDefinite)
      solver = std::make_unique<ConjugateGradients>(inside);
    else
      solver = std::make_unique<BiconjugateGradients>(SparseRows(inside));
  }

  // A_II and A_IB with D^-1/2 on both sides of A_II (or D^-1 on the left of both), D its diagonal.
  void assemble(const std::vector<MatrixEntry>& entries) {
    const auto n = static_cast<Index>(free.size());
    VectorXd diagonal = VectorXd::Zero(n);
    for (const MatrixEntry& e : entries)
      if (e.row() == e.col() && place[e.row()] >= 0) diagonal[place[e.row()]] += e.value();
    std::vector<MatrixEntry> inner, outer;
    for (Index i = 0; i < n; ++i)
      if (diagonal[i] == 0) {
        diagonal[i] = 1;
        inner.emplace_back(i, i, 1.0);
      }
    const bool is_symmetric = symmetry == Symmetry::PositiveDefinite;
    left = is_symmetric ? VectorXd(diagonal.cwiseSqrt().cwiseInverse())
                        : VectorXd(diagonal.cwiseInverse());
    right = is_symmetric ? left : VectorXd(VectorXd::Ones(n));
    for (const MatrixEntry& e : entries) {
      const int row = place[e.row()], column = place[e.col()];
      if (row < 0) continue;
      if (column >= 0)
        inner.emplace_back(row, column, left[row] * e.value() * right[column]);
      else
        outer.emplace_back(row, -1 - column, left[row] * e.value());
    }
    inside.resize(n, n);
    inside.setFromTriplets(inner.begin(), inner.end());
    coupling.resize(n, static_cast<Index>(prescribed.size()));
    coupling.setFromTriplets(outer.begin(), outer.end());
  }

  // Scaled unknowns y = D^1/2 u, whose residual D^1/2 turns back into that of u.
  MatrixXd solve_inside(const Points& values) const {
    const MatrixXd rhs = -(coupling * values);
    const double allowed = kAccuracy * values.cwiseAbs().maxCoeff();
    const auto is_accurate = [&](const MatrixXd& y) {
      const MatrixXd missed = right.asDiagonal() * (rhs - inside * y);
      return y.allFinite() && missed.cwiseAbs().maxCoeff() <= allowed;
    };
    MatrixXd y = solver->solve(rhs);
    if (!is_accurate(y)) {
      y = symmetry == Symmetry::PositiveDefinite
              ? solve_by_factors<Eigen::SimplicialLDLT<SparseColumns>>(inside, rhs)
              : solve_by_factors<Eigen::SparseLU<SparseColumns>>(inside, rhs);
      if (!is_accurate(y)) fail_singular();
    }
    return right.asDiagonal() * y;
  }

  Symmetry symmetry;
  std::vector<Index> prescribed, free;
  std::vector<int> place;  // in `free`; -1 - place in `prescribed`
  SparseColumns inside, coupling;
  VectorXd left, right;
  std::unique_ptr<LinearSolver> solver;
};

InteriorSystem::InteriorSystem(Index nodes, std::vector<Index> prescribed,
                               const std::vector<MatrixEntry>& entries, Symmetry symmetry)
    : impl_(std::make_unique<Impl>(nodes, std::move(prescribed), entries, symmetry)) {}

InteriorSystem::~InteriorSystem() = default;

Points InteriorSystem::solve(const Points& prescribed) const {
  const Impl& s = *impl_;
  Points result(static_cast<Index>(s.place.size()), 3);
  for (std::size_t i = 0; i < s.prescribed.size(); ++i)
    result.row(s.prescribed[i]) = prescribed.row(i);
  if (s.free.empty()) return result;
  const MatrixXd inside = s.solve_inside(prescribed);
  for (std::size_t i = 0; i < s.free.size(); ++i) result.row(s.free[i]) = inside.row(i);
  return result;
}

}  // namespace cadmorph
