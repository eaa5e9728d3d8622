#include <sys/mman.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/rbf/kernel.h"
#include "core/rbf/kernel_sum.h"

using namespace cadmorph;
using Eigen::MatrixXd;

namespace {

const Kernel kGaussian{KernelKind::Gaussian, 0, 0, 2.0};
const Kernel kMultiquadric{KernelKind::Multiquadric, 0, 0, 2.0};
const Kernel kInverseMultiquadric{KernelKind::InverseMultiquadric, 0, 0, 2.0};
const Kernel kTriharmonic2D{KernelKind::Polyharmonic, 3, 2};

const Kernel kWendlandC2{KernelKind::WendlandC2, 0, 0, 0.8};
const Kernel kWendlandC4{KernelKind::WendlandC4, 0, 0, 0.8};

const std::vector<Kernel> kAll = {kGaussian,
                                  kMultiquadric,
                                  kInverseMultiquadric,
                                  Kernel::biharmonic_2d(),
                                  Kernel::biharmonic_3d(),
                                  Kernel::triharmonic_3d(),
                                  Kernel::quadharmonic_3d(),
                                  kTriharmonic2D,
                                  kWendlandC2,
                                  kWendlandC4};

bool is_compact(const Kernel& kernel) {
  return kernel.kind == KernelKind::WendlandC2 || kernel.kind == KernelKind::WendlandC4;
}

// Polynomials below degree `order` at points, as columns.
MatrixXd polynomials(const MatrixXd& x, int order) {
  MatrixXd result(x.rows(), 0);
  const auto append = [&](const Eigen::VectorXd& column) {
    result.conservativeResize(x.rows(), result.cols() + 1);
    result.rightCols(1) = column;
  };
  if (order > 0) append(Eigen::VectorXd::Ones(x.rows()));
  for (Index a = 0; order > 1 && a < x.cols(); ++a) {
    append(x.col(a));
    for (Index b = 0; order > 2 && b <= a; ++b) append(x.col(a).cwiseProduct(x.col(b)));
  }
  return result;
}

MatrixXd direct_sums(const Kernel& kernel, const MatrixXd& t, const MatrixXd& s,
                     const MatrixXd& w) {
  MatrixXd result = MatrixXd::Zero(t.rows(), w.cols());
  for (Index i = 0; i < t.rows(); ++i)
    for (Index j = 0; j < s.rows(); ++j)
      result.row(i) += kernel((t.row(i) - s.row(j)).norm()) * w.row(j);
  return result;
}

/// A matrix whose last number is the last of a page, with no page to read behind.
class GuardedMatrix {
 public:
  GuardedMatrix(Eigen::Index rows, Eigen::Index columns)
      : page_(static_cast<std::size_t>(sysconf(_SC_PAGESIZE))),
        pages_(static_cast<std::size_t>(rows * columns) * sizeof(double) / page_ + 1),
        memory_(mmap(nullptr, (pages_ + 1) * page_, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)) {
    REQUIRE(memory_ != MAP_FAILED);
    char* const end = static_cast<char*>(memory_) + pages_ * page_;
    REQUIRE(mprotect(end, page_, PROT_NONE) == 0);
    map_ = {reinterpret_cast<double*>(end) - rows * columns, rows, columns};
  }
  ~GuardedMatrix() { munmap(memory_, (pages_ + 1) * page_); }
  GuardedMatrix(const GuardedMatrix&) = delete;
  GuardedMatrix& operator=(const GuardedMatrix&) = delete;

  Eigen::Map<MatrixXd> operator()() const { return {map_.data, map_.rows, map_.columns}; }

 private:
  struct Place {
    double* data;
    Eigen::Index rows, columns;
  };

  std::size_t page_, pages_;
  void* memory_;
  Place map_{};
};

}  // namespace

TEST_CASE("kernels are those of Table 1", "[core][rbf]") {
  const double r = 0.7, e = std::exp(1.0);
  CHECK(kGaussian(r) == Approx(std::exp(-1.96)));
  CHECK(kMultiquadric(r) == Approx(std::sqrt(2.96)));
  CHECK(kInverseMultiquadric(r) == Approx(1 / std::sqrt(2.96)));
  CHECK(Kernel::biharmonic_3d()(r) == Approx(0.7));
  CHECK(Kernel::triharmonic_3d()(r) == Approx(0.343));
  CHECK(Kernel::quadharmonic_3d()(r) == Approx(0.16807));
  CHECK(Kernel::biharmonic_2d()(e) == Approx(e * e));
  CHECK(kTriharmonic2D(e) == Approx(std::pow(e, 4)));
  CHECK(Kernel::biharmonic_2d()(0) == 0);
}

TEST_CASE("Wendland's functions are the published polynomials", "[core][rbf]") {
  // Expanded: no term in t (nor t^3 for C4), which is what makes them smooth at the centre.
  for (const double t : {0.0, 0.1, 0.35, 0.5, 0.99}) {
    const double c2 =
        1 - 10 * std::pow(t, 2) + 20 * std::pow(t, 3) - 15 * std::pow(t, 4) + 4 * std::pow(t, 5);
    const double c4 = 1 - 28.0 / 3 * std::pow(t, 2) + 70 * std::pow(t, 4) -
                      448.0 / 3 * std::pow(t, 5) + 140 * std::pow(t, 6) - 64 * std::pow(t, 7) +
                      35.0 / 3 * std::pow(t, 8);
    CHECK(kWendlandC2(t / 0.8) == Approx(c2).epsilon(1e-9).margin(1e-13));
    CHECK(kWendlandC4(t / 0.8) == Approx(c4).epsilon(1e-9).margin(1e-13));
  }
  CHECK(kWendlandC2(1.251) == 0);
  CHECK(kWendlandC4(1.251) == 0);
}

TEST_CASE("sign * kernel is positive definite beside polynomials of its order", "[core][rbf]") {
  srand(3);
  for (const Kernel& kernel : kAll) {
    // Embedded in higher dimensions r^2 log r and r^3 keep their order.
    for (const int dimension : {2, 3, 4}) {
      if (is_compact(kernel) && dimension > 3) continue;  // positive definite up to R^3 only
      const MatrixXd x = MatrixXd::Random(40, dimension);
      const MatrixXd P = polynomials(x, kernel.cpd_order());
      MatrixXd A(40, 40);
      for (Index i = 0; i < 40; ++i)
        for (Index j = 0; j < 40; ++j)
          A(i, j) = kernel.cpd_sign() * kernel((x.row(i) - x.row(j)).norm());
      MatrixXd Z = MatrixXd::Identity(40, 40);
      if (P.cols() > 0) {
        const MatrixXd H =
            Eigen::HouseholderQR<MatrixXd>(P).householderQ() * MatrixXd::Identity(40, 40);
        Z = H.rightCols(40 - P.cols());
      }
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(Z.transpose() * A * Z);
      INFO("kind " << static_cast<int>(kernel.kind) << " order " << kernel.order << " in R^"
                   << dimension);
      CHECK(eigen.eigenvalues().minCoeff() > 0);
    }
  }
}

TEST_CASE("vectorised sums equal plain ones on every instruction set", "[core][rbf]") {
  srand(4);
  for (const Kernel& kernel : kAll)
    for (const InstructionSet set :
         {InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512})
      for (const Index dimension : {1, 2, 3, 4})
        for (const Index columns : {1, 2, 3, 4, 5, 6, 12, 13, 24}) {
          const MatrixXd t = MatrixXd::Random(53, dimension);
          MatrixXd s = MatrixXd::Random(61, dimension);
          s.topRows(9) = t.topRows(9);  // zero distances
          const MatrixXd w = MatrixXd::Random(61, columns);
          const MatrixXd expected = direct_sums(kernel, t, s, w);
          const MatrixXd found = KernelSum(kernel, 0, set)(t, s, w);
          // 61 terms of size up to 4^5 (quadharmonic in R^4).
          REQUIRE((found - expected).cwiseAbs().maxCoeff() <
                  1e-13 * std::max(1.0, expected.cwiseAbs().maxCoeff()));
        }
}

TEST_CASE("sums read nothing beyond their points and weights", "[core][rbf]") {
  for (const Kernel& kernel : kAll)
    for (const InstructionSet set :
         {InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512})
      for (const int dimension : {1, 2, 3, 5})
        for (const int count : {1, 2, 3, 5, 6, 7, 13})
          for (const int columns : {1, 2, 3, 5}) {
            const GuardedMatrix targets(count, dimension), sources(9, dimension),
                weights(9, columns), out(count, columns);
            targets() = MatrixXd::Random(count, dimension);
            sources() = MatrixXd::Random(9, dimension);
            weights() = MatrixXd::Random(9, columns);
            out().setZero();
            const KernelSum sum(kernel, 0, set);
            sum.add(targets(), sources(), weights(), out());
            const MatrixXd t = targets(), s = sources(), w = weights();
            MatrixXd expected = MatrixXd::Zero(count, columns);
            sum.add(t, s, w, expected);
            CHECK(MatrixXd(out()) == expected);
          }
}

TEST_CASE("a sum is the same whatever other columns are summed with it", "[core][rbf]") {
  srand(14);
  const MatrixXd t = MatrixXd::Random(301, 3), s = MatrixXd::Random(1203, 3);
  const MatrixXd w = MatrixXd::Random(1203, 53);
  for (const InstructionSet set :
       {InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512}) {
    const KernelSum sum(Kernel::triharmonic_3d(), 0, set);
    const MatrixXd together = sum(t, s, w);
    for (Index begin = 0; begin < 53; begin += 3) {
      const Index count = std::min<Index>(3, 53 - begin);
      REQUIRE(sum(t, s, w.middleCols(begin, count)) == together.middleCols(begin, count));
    }
    for (const Index count : {9, 15, 21, 24, 47, 48, 49})
      REQUIRE(sum(t, s, w.leftCols(count)) == together.leftCols(count));
  }
}

TEST_CASE("sums of pairs are those of a matrix and its transpose, in twice the precision",
          "[core][rbf]") {
  using Extended = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const auto extended = [](const MatrixPair& x) -> Extended {
    return x.high.cast<long double>() + x.low.cast<long double>();
  };
  const auto random_pair = [](Index rows, Index columns) {
    MatrixPair x(MatrixXd::Random(rows, columns));
    x.low = 0x1p-54 * MatrixXd::Random(rows, columns);
    return x;
  };
  srand(16);
  const Index sizes[][2] = {{53, 61}, {300, 1203}, {1, 8}, {7, 2}};
  for (const Kernel& kernel : kAll)
    for (const InstructionSet set :
         {InstructionSet::Baseline, InstructionSet::Avx2, InstructionSet::Avx512})
      for (const Index dimension : {2, 3})
        for (const auto& [targets, sources] : sizes)
          for (const Index columns : {1, 3, 5}) {
            MatrixXd t = MatrixXd::Random(targets, dimension);
            const MatrixXd s = MatrixXd::Random(sources, dimension);
            t.row(0) = s.row(0);
            const MatrixPair x = random_pair(sources, columns), y = random_pair(targets, columns);
            const KernelSum sum(kernel, 0, set);
            const MatrixPair sums = sum.pairs(t, s, x);
            const MatrixXd plain = sum(t, s, x.high);
            const double scale = std::max(1.0, plain.cwiseAbs().maxCoeff());
            REQUIRE((sums.high - plain).cwiseAbs().maxCoeff() < 1e-13 * scale);
            REQUIRE(sums.low.cwiseAbs().maxCoeff() < 1e-13 * scale);
            const Extended forward = extended(y).transpose() * extended(sums);
            const Extended back = extended(sum.pairs(s, t, y)).transpose() * extended(x);
            // Doubles come to 1e-16 of this size.
            const double size = std::sqrt(static_cast<double>(targets * sources)) * 2 * scale;
            REQUIRE(static_cast<double>((forward - back).cwiseAbs().maxCoeff()) < 1e-18 * size);
          }
}

TEST_CASE("the kernel matrix has the kernel's values", "[core][rbf]") {
  srand(5);
  const MatrixXd x = MatrixXd::Random(70, 3);
  const MatrixXd A = KernelSum(Kernel::triharmonic_3d()).matrix(x);
  for (Index i = 0; i < 70; ++i)
    for (Index j = 0; j < 70; ++j)
      REQUIRE(A(i, j) ==
              Approx(std::pow((x.row(i) - x.row(j)).norm(), 3)).epsilon(1e-13).margin(1e-300));
}

TEST_CASE("sums do not depend on the number of threads", "[core][rbf]") {
  srand(6);
  const MatrixXd x = MatrixXd::Random(1500, 3), w = MatrixXd::Random(1500, 3);
  const KernelSum sum(Kernel::triharmonic_3d());
  set_thread_count(1);
  const MatrixXd one = sum(x, x, w);
  set_thread_count(3);
  const MatrixXd three = sum(x, x, w);
  set_thread_count(0);
  REQUIRE(one == three);
}

TEST_CASE("kernels that are singular or have no width are refused", "[core][rbf]") {
  REQUIRE_THROWS_AS(KernelSum(Kernel{KernelKind::Polyharmonic, 1, 3}), InvalidInputError);
  REQUIRE_THROWS_AS(KernelSum(Kernel{KernelKind::Gaussian, 0, 0, 0.0}), InvalidInputError);
  REQUIRE_THROWS_AS(KernelSum(Kernel{KernelKind::Multiquadric, 0, 0, NAN}), InvalidInputError);
}
