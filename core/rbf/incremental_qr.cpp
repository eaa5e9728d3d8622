#include "core/rbf/incremental_qr.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <string>

#include "core/blas.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/rbf/point_order.h"

extern "C" {
void dgeqrt_(const int*, const int*, const int*, double*, const int*, double*, const int*, double*,
             int*);
void dgemqrt_(const char*, const char*, const int*, const int*, const int*, const int*,
              const double*, const int*, const double*, const int*, double*, const int*, double*,
              int*);
}

namespace cadmorph {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Columns in a panel, and columns that one thread transforms at a time: wide enough for the BLAS to
// be bound by arithmetic, narrow enough that few columns are made in vain.
constexpr Index kPanel = 128;
constexpr Index kStrip = 64;

// Product of the reflectors of some columns, from their first row down, as LAPACK's dgeqrt leaves
// it: I - V T V^T, V below the diagonal.
struct Panel {
  Index first;  // row and column of its first entry
  MatrixXd reflectors, T;
};

int as_int(Index n) { return static_cast<int>(n); }

void factor(Panel& panel) {
  const int rows = as_int(panel.reflectors.rows()), columns = as_int(panel.reflectors.cols());
  panel.T.resize(columns, columns);
  VectorXd work(columns * columns);
  int info = 0;
  dgeqrt_(&rows, &columns, &columns, panel.reflectors.data(), &rows, panel.T.data(), &columns,
          work.data(), &info);
}

// X = Q^T X for the reflectors of a panel; X has all rows.
void transform(const Panel& panel, Eigen::Ref<MatrixXd> X) {
  const int rows = as_int(panel.reflectors.rows()), columns = as_int(X.cols()),
            depth = as_int(panel.reflectors.cols()), stride = as_int(X.outerStride());
  VectorXd work(columns * depth);
  int info = 0;
  dgemqrt_("L", "T", &rows, &columns, &depth, &depth, panel.reflectors.data(), &rows,
           panel.T.data(), &depth, X.data() + panel.first, &stride, work.data(), &info);
}

Points in_space(const MatrixXd& centres) {
  Points result = Points::Zero(centres.rows(), 3);
  result.leftCols(centres.cols()) = centres;
  return result;
}

}  // namespace

struct IncrementalQr::Impl {
  Index row_count() const { return P.rows() + P.cols(); }
  Index column_count() const { return P.rows() + P.cols(); }

  MatrixXd columns(Index begin, Index end) const;
  void require_memory(Index columns) const;
  const Panel& panel(std::size_t number);
  QrSolution back_substitute(const MatrixXd& transformed, Index k, double error);

  KernelSum sum;
  std::shared_ptr<const MatrixXd> centres;
  MatrixXd P;
  VectorXd scale;  // 1 / local length
  QrOptions options;
  std::vector<Index> order;

  std::mutex mutex;  // of what follows, which grows as needed
  std::vector<std::shared_ptr<const Panel>> panels;
  std::vector<MatrixXd> R;  // rows of each panel's columns down to the diagonal
};

// Columns of D A: the polynomials, then the kernels of the centres in their order, each with its
// side conditions below, which weigh as much as the most exact residual.
MatrixXd IncrementalQr::Impl::columns(Index begin, Index end) const {
  const Index n = P.rows(), q = P.cols();
  MatrixXd result = MatrixXd::Zero(row_count(), end - begin);
  const MatrixXd one = MatrixXd::Ones(1, 1);
  parallel_for(end - begin, 1, [&](Index from, Index to) {
    for (Index c = from; c < to; ++c) {
      auto column = result.col(c);
      if (begin + c < q) {
        column.head(n) = P.col(begin + c);
      } else {
        const Index row = order[begin + c - q];
        sum.add(*centres, centres->middleRows(row, 1), one, result.block(0, c, n, 1));
        column.tail(q) = scale.maxCoeff() * P.row(row);
      }
      column.head(n).array() *= scale.array();
    }
  });
  return result;
}

void IncrementalQr::Impl::require_memory(Index columns) const {
  const double bytes = 8.0 * static_cast<double>(row_count()) * static_cast<double>(columns);
  if (bytes > options.memory_limit)
    throw SolverError("the incremental QR solver has not reached the tolerance with " +
                      std::to_string(columns) + " of " + std::to_string(P.rows()) +
                      " centres, which need " + std::to_string(static_cast<long>(bytes / 1e6)) +
                      " MB; allow a larger tolerance or more memory, or use the fast solver");
}

// The panel of columns [number * kPanel, ...), made when it is first asked for.
const Panel& IncrementalQr::Impl::panel(std::size_t number) {
  const std::lock_guard lock(mutex);
  while (panels.size() <= number) {
    const Index first = static_cast<Index>(panels.size()) * kPanel;
    const Index last = std::min(first + kPanel, column_count());
    require_memory(last);
    MatrixXd block = columns(first, last);
    parallel_for(last - first, kStrip, [&](Index begin, Index end) {
      for (const auto& earlier : panels) transform(*earlier, block.middleCols(begin, end - begin));
    });
    auto made = std::make_shared<Panel>();
    made->first = first;
    made->reflectors = block.bottomRows(row_count() - first);
    factor(*made);
    MatrixXd above = block.topRows(last);
    above.bottomRows(last - first) =
        made->reflectors.topRows(last - first).triangularView<Eigen::Upper>();
    R.push_back(std::move(above));
    panels.push_back(std::move(made));
  }
  return *panels[number];
}

// Solves R_k X = (Q^T B)_k.
QrSolution IncrementalQr::Impl::back_substitute(const MatrixXd& transformed, Index k,
                                                double error) {
  const std::lock_guard lock(mutex);
  MatrixXd X = transformed.topRows(k);
  for (Index j = k - 1; j >= 0; --j) {
    const auto column = R[j / kPanel].col(j % kPanel);
    X.row(j) /= column(j);
    X.topRows(j).noalias() -= column.head(j) * X.row(j);
  }
  const Index q = P.cols();
  return {{order.begin(), order.begin() + (k - q)}, X.bottomRows(k - q), X.topRows(q), error};
}

IncrementalQr::IncrementalQr(const KernelSum& sum, std::shared_ptr<const MatrixXd> centres,
                             const MatrixXd& P, const VectorXd& local_length, QrOptions options)
    : impl_(new Impl{
          sum, std::move(centres), P, local_length.cwiseInverse(), options, {}, {}, {}, {}}) {
  if (impl_->centres->cols() > 3)
    throw InvalidInputError("the incremental QR solver serves up to three dimensions");
  impl_->order = farthest_point_order(in_space(*impl_->centres)).rows;
}

QrSolution IncrementalQr::solve(const MatrixXd& values) const {
  Impl& s = *impl_;
  const SerialBlas serial;
  const Index n = s.P.rows(), q = s.P.cols();
  MatrixXd B = MatrixXd::Zero(s.row_count(), values.cols());
  B.topRows(n) = s.scale.asDiagonal() * values;
  const double allowed = s.options.tolerance * std::sqrt(static_cast<double>(n));
  for (std::size_t number = 0;; ++number) {
    const Panel& panel = s.panel(number);
    transform(panel, B);
    const Index last = panel.first + panel.reflectors.cols();
    // What is left after each column of the panel, from the last one up.
    double squares = B.bottomRows(s.row_count() - last).squaredNorm();
    std::optional<Index> enough;
    double error = 0;
    for (Index k = last; k >= std::max(q, panel.first + 1); --k) {
      if (std::sqrt(squares) > allowed) break;
      enough = k;
      error = std::sqrt(squares / static_cast<double>(n));
      squares += B.row(k - 1).squaredNorm();
    }
    if (enough) return s.back_substitute(B, *enough, error);
    if (last == s.column_count())
      throw SolverError(
          "the incremental QR solver took all centres and reached a mean residual of " +
          std::to_string(std::sqrt(squares / static_cast<double>(n))) +
          " local lengths only; allow a larger tolerance");
  }
}

}  // namespace cadmorph
