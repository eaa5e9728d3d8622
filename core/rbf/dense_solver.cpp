#include "core/rbf/dense_solver.h"

#include <Eigen/Dense>
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "core/archive_types.h"
#include "core/blas.h"
#include "core/errors.h"
#include "core/large_matrix.h"
#include "core/parallel.h"

extern "C" {
void dgetrf_(const int*, const int*, double*, const int*, int*, int*);
void dgetrs_(const char*, const int*, const int*, const double*, const int*, const int*, double*,
             const int*, int*);
void dgecon_(const char*, const int*, const double*, const int*, const double*, double*, double*,
             int*, int*);
void dsytrf_(const char*, const int*, double*, const int*, int*, double*, const int*, int*);
void dsytrs_(const char*, const int*, const int*, const double*, const int*, const int*, double*,
             const int*, int*);
void dsycon_(const char*, const int*, const double*, const int*, const int*, const double*, double*,
             double*, int*, int*);
void dpotrf_(const char*, const int*, double*, const int*, int*);
void dpotrs_(const char*, const int*, const int*, const double*, const int*, double*, const int*,
             int*);
void dtrsm_(const char*, const char*, const char*, const char*, const int*, const int*,
            const double*, const double*, const int*, double*, const int*);
void dgemm_(const char*, const char*, const int*, const int*, const int*, const double*,
            const double*, const int*, const double*, const int*, const double*, double*,
            const int*);
void dpocon_(const char*, const int*, const double*, const int*, const double*, double*, double*,
             int*, int*);
}

namespace cadmorph {
namespace {

using Eigen::MatrixXd;

void require_success(int info, const char* routine) {
  if (info == 0) return;
  throw SolverError(std::string(routine) +
                    ": the interpolation matrix is singular to rounding (pivot " +
                    std::to_string(info) +
                    "); remove centres that nearly coincide, or choose another kernel or shape");
}

int as_int(Index n) { return static_cast<int>(n); }

double one_norm(const MatrixXd& A) {
  return A.size() == 0 ? 0 : A.cwiseAbs().colwise().sum().maxCoeff();
}

MatrixXd saddle_matrix(MatrixXd A, const MatrixXd& P) {
  const Index n = P.rows(), q = P.cols();
  MatrixXd result = large_matrix(n + q, n + q);
  result.topLeftCorner(n, n) = A;
  result.topRightCorner(n, q) = P;
  result.bottomLeftCorner(q, n) = P.transpose();
  result.bottomRightCorner(q, q).setZero();
  return result;
}

MatrixXd saddle_rhs(const MatrixXd& values, Index q) {
  MatrixXd rhs = MatrixXd::Zero(values.rows() + q, values.cols());
  rhs.topRows(values.rows()) = values;
  return rhs;
}

// Cholesky factor in the lower triangle of A, in tiles by one-threaded BLAS calls on all threads:
// the result does not depend on their number. Returns LAPACK's info.
int tiled_cholesky(Index n, double* A, Index stride) {
  constexpr Index kTile = 256;  // half a megabyte, for a second-level cache
  constexpr double kOne = 1, kMinusOne = -1;
  const int lda = as_int(stride);
  const auto at = [&](Index i, Index j) { return A + j * stride + i; };
  for (Index k = 0; k < n; k += kTile) {
    const Index next = std::min(n, k + kTile), rest = n - next;
    const int depth = as_int(next - k);
    int info = 0;
    dpotrf_("L", &depth, at(k, k), &lda, &info);
    if (info != 0) return as_int(k) + info;
    parallel_for(rest, kTile, [&](Index begin, Index end) {
      const int rows = as_int(end - begin);
      dtrsm_("R", "L", "T", "N", &rows, &depth, &kOne, at(k, k), &lda, at(next + begin, k), &lda);
    });
    parallel_for(rest, kTile, [&](Index begin, Index end) {
      const int rows = as_int(rest - begin), columns = as_int(end - begin);
      dgemm_("N", "T", &rows, &columns, &depth, &kMinusOne, at(next + begin, k), &lda,
             at(next + begin, k), &lda, &kOne, at(next + begin, next + begin), &lda);
    });
  }
  return 0;
}

// Small systems run on one BLAS thread: many are solved at once, and the result then does not
// depend on the number of threads.
class SmallSystemGuard {
 public:
  explicit SmallSystemGuard(Index rows) {
    constexpr Index kSmall = 1500;  // below, threads of the BLAS cost more than they save
    if (rows < kSmall) serial_.emplace();
  }

 private:
  std::optional<SerialBlas> serial_;
};

// LAPACK's routines for one factorisation of the full matrix.
struct FullFactorisation {
  const char* name;
  void (*factor)(int n, double* A, int* pivots, int* info);
  void (*solve)(int n, int columns, const double* A, const int* pivots, double* x, int* info);
  double (*reciprocal_condition)(int n, const double* A, const int* pivots, double norm);
};

const FullFactorisation kLu = {
    "dgetrf",
    [](int n, double* A, int* pivots, int* info) { dgetrf_(&n, &n, A, &n, pivots, info); },
    [](int n, int columns, const double* A, const int* pivots, double* x, int* info) {
      dgetrs_("N", &n, &columns, A, &n, pivots, x, &n, info);
    },
    [](int n, const double* A, const int*, double norm) {
      double result = 0;
      int info = 0;
      std::vector<double> work(4 * static_cast<std::size_t>(n));
      std::vector<int> integers(n);
      dgecon_("1", &n, A, &n, &norm, &result, work.data(), integers.data(), &info);
      return result;
    }};

const FullFactorisation kLdlt = {
    "dsytrf",
    [](int n, double* A, int* pivots, int* info) {
      int length = -1;
      double optimal = 0;
      dsytrf_("L", &n, A, &n, pivots, &optimal, &length, info);
      length = std::max(1, static_cast<int>(optimal));
      std::vector<double> work(length);
      dsytrf_("L", &n, A, &n, pivots, work.data(), &length, info);
    },
    [](int n, int columns, const double* A, const int* pivots, double* x, int* info) {
      dsytrs_("L", &n, &columns, A, &n, pivots, x, &n, info);
    },
    [](int n, const double* A, const int* pivots, double norm) {
      double result = 0;
      int info = 0;
      std::vector<double> work(2 * static_cast<std::size_t>(n));
      std::vector<int> integers(n);
      dsycon_("L", &n, A, &n, pivots, &norm, &result, work.data(), integers.data(), &info);
      return result;
    }};

class FullSolver final : public DenseSolver {
 public:
  FullSolver(const FullFactorisation& routines, MatrixXd A, const MatrixXd& P)
      : routines_(routines),
        terms_(P.cols()),
        factor_(saddle_matrix(std::move(A), P)),
        pivots_(factor_.rows()) {
    const SmallSystemGuard guard(factor_.rows());
    const int n = as_int(factor_.rows());
    const double norm = one_norm(factor_);
    int info = 0;
    routines_.factor(n, factor_.data(), pivots_.data(), &info);
    require_success(info, routines_.name);
    rcond_ = routines_.reciprocal_condition(n, factor_.data(), pivots_.data(), norm);
  }

  FullSolver(const FullFactorisation& routines, const MatrixXd& P, InputArchive& archive)
      : routines_(routines), terms_(P.cols()) {
    archive(factor_, pivots_, rcond_);
  }

  void store(OutputArchive& archive) const override { archive(factor_, pivots_, rcond_); }

  SaddleSolution solve(const MatrixXd& values) const override {
    const SmallSystemGuard guard(factor_.rows());
    MatrixXd x = saddle_rhs(values, terms_);
    int info = 0;
    routines_.solve(as_int(x.rows()), as_int(x.cols()), factor_.data(), pivots_.data(), x.data(),
                    &info);
    return {x.topRows(values.rows()), x.bottomRows(terms_)};
  }

  double reciprocal_condition() const override { return rcond_; }

 private:
  const FullFactorisation& routines_;
  Index terms_;
  MatrixXd factor_;
  std::vector<int> pivots_;
  double rcond_ = 0;
};

// With P = H [R; 0], H orthogonal, and B = H^T A H split after row Q: w = H [0; y] with
// B22 y = (H^T f)_2 by Cholesky, then R c = (H^T f)_1 - B12 y.
class NullSpaceCholeskySolver final : public DenseSolver {
 public:
  NullSpaceCholeskySolver(MatrixXd A, const MatrixXd& P, int sign)
      : sign_(sign), polynomials_(P), factor_(std::move(A)) {
    transform();
    const Index q = P.cols();
    coupling_ = factor_.bottomLeftCorner(rows(), q);
    if (rows() == 0) return;
    const int n = as_int(rows()), stride = as_int(factor_.rows());
    const double norm = symmetric_one_norm();
    const SerialBlas serial;
    require_success(tiled_cholesky(rows(), block(), factor_.rows()), "dpotrf");
    int info = 0;
    std::vector<double> work(3 * rows());
    std::vector<int> integers(rows());
    dpocon_("L", &n, block(), &stride, &norm, &rcond_, work.data(), integers.data(), &info);
  }

  NullSpaceCholeskySolver(const MatrixXd& P, InputArchive& archive) : polynomials_(P) {
    archive(sign_, coupling_, rcond_);
    factor_.setZero(P.rows(), P.rows());
    for_each_column(
        [&](double* column, std::size_t bytes) { archive(cereal::binary_data(column, bytes)); });
  }

  void store(OutputArchive& archive) const override {
    archive(sign_, coupling_, rcond_);
    for_each_column([&](const double* column, std::size_t bytes) {
      archive(cereal::binary_data(column, bytes));
    });
  }

  SaddleSolution solve(const MatrixXd& values) const override {
    const Index q = polynomials_.cols();
    MatrixXd rotated = values;
    rotated.applyOnTheLeft(polynomials_.householderQ().adjoint());
    MatrixXd y = rotated.bottomRows(rows());
    solve_block(y);
    MatrixXd c = rotated.topRows(q) - sign_ * (coupling_.transpose() * y);
    polynomials_.matrixQR().topRows(q).triangularView<Eigen::Upper>().solveInPlace(c);
    MatrixXd w = MatrixXd::Zero(values.rows(), values.cols());
    w.bottomRows(rows()) = y;
    w.applyOnTheLeft(polynomials_.householderQ());
    return {w, c};
  }

  double reciprocal_condition() const override { return rcond_; }

 private:
  Index rows() const { return factor_.rows() - polynomials_.cols(); }
  const double* block() const { return &factor_(polynomials_.cols(), polynomials_.cols()); }
  double* block() { return &factor_(polynomials_.cols(), polynomials_.cols()); }

  // Columns of the factor, from the diagonal down, with their size in bytes.
  void for_each_column(const auto& call) const {
    for (Index j = 0; j < rows(); ++j)
      call(block() + j * (factor_.rows() + 1), sizeof(double) * (rows() - j));
  }
  void for_each_column(const auto& call) {
    for (Index j = 0; j < rows(); ++j)
      call(block() + j * (factor_.rows() + 1), sizeof(double) * (rows() - j));
  }

  // Lower triangle of sign * H^T A H = sign * A - V Y^T - Y V^T with H = I - V T V^T.
  void transform() {
    const Index n = factor_.rows(), q = polynomials_.cols();
    if (sign_ < 0) factor_ = -factor_;
    MatrixXd V = polynomials_.matrixQR().leftCols(q);
    for (Index j = 0; j < q; ++j) {
      V.col(j).head(j).setZero();
      V(j, j) = 1;
    }
    MatrixXd T = MatrixXd::Zero(q, q);
    for (Index j = 0; j < q; ++j) {
      const double tau = polynomials_.hCoeffs()(j);
      T(j, j) = tau;
      if (j > 0)
        T.col(j).head(j) = -tau * (T.topLeftCorner(j, j) * (V.leftCols(j).transpose() * V.col(j)));
    }
    const MatrixXd AVT = (factor_ * V) * T;
    const MatrixXd Y = AVT - 0.5 * V * (T.transpose() * (V.transpose() * AVT));
    parallel_for(n, 64, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j)
        factor_.col(j).tail(n - j) -=
            V.bottomRows(n - j) * Y.row(j).transpose() + Y.bottomRows(n - j) * V.row(j).transpose();
    });
  }

  double symmetric_one_norm() const {
    const Index q = polynomials_.cols();
    Eigen::VectorXd sums = Eigen::VectorXd::Zero(rows());
    for (Index j = 0; j < rows(); ++j) {
      const auto below = factor_.col(q + j).tail(rows() - j).cwiseAbs();
      sums.tail(rows() - j) += below;
      sums(j) += below.tail(rows() - j - 1).sum();
    }
    return sums.maxCoeff();
  }

  void solve_block(MatrixXd& y) const {
    y *= sign_;
    if (rows() == 0 || y.cols() == 0) return;
    const SerialBlas serial;
    const int n = as_int(rows()), stride = as_int(factor_.rows()), columns = as_int(y.cols());
    int info = 0;
    dpotrs_("L", &n, &columns, block(), &stride, y.data(), &n, &info);
  }

  int sign_ = 1;
  Eigen::HouseholderQR<MatrixXd> polynomials_;
  MatrixXd factor_;
  MatrixXd coupling_;
  double rcond_ = 1;
};

}  // namespace

std::unique_ptr<DenseSolver> make_dense_solver(Factorisation factorisation, Eigen::MatrixXd A,
                                               const Eigen::MatrixXd& P, int sign) {
  switch (factorisation) {
    case Factorisation::Lu:
      return std::make_unique<FullSolver>(kLu, std::move(A), P);
    case Factorisation::Ldlt:
      return std::make_unique<FullSolver>(kLdlt, std::move(A), P);
    case Factorisation::Cholesky:
      break;
  }
  return std::make_unique<NullSpaceCholeskySolver>(std::move(A), P, sign);
}

std::unique_ptr<DenseSolver> restore_dense_solver(Factorisation factorisation,
                                                  const Eigen::MatrixXd& P, InputArchive& archive) {
  if (factorisation == Factorisation::Lu) return std::make_unique<FullSolver>(kLu, P, archive);
  if (factorisation == Factorisation::Ldlt) return std::make_unique<FullSolver>(kLdlt, P, archive);
  return std::make_unique<NullSpaceCholeskySolver>(P, archive);
}

}  // namespace cadmorph
