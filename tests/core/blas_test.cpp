#include "core/blas.h"

#include <dlfcn.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core/rbf/rbf_system.h"

namespace cadmorph {
namespace {

constexpr const char* kVariable = "OPENBLAS_CORETYPE";

// The variable as a test wants it; as it was when the object goes.
class Variable {
 public:
  explicit Variable(const char* value) {
    if (const char* old = std::getenv(kVariable)) old_ = old;
    set(value);
  }
  ~Variable() { set(old_ ? old_->c_str() : nullptr); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  static void set(const char* value) { value ? setenv(kVariable, value, 1) : unsetenv(kVariable); }
  std::optional<std::string> old_;
};

// What loading OpenBLAS with the variable set does. False for another BLAS.
bool load_kernel(const char* name) {
  const auto forget = reinterpret_cast<void (*)()>(dlsym(RTLD_DEFAULT, "gotoblas_dynamic_quit")),
             choose = reinterpret_cast<void (*)()>(dlsym(RTLD_DEFAULT, "gotoblas_dynamic_init"));
  if (!forget || !choose) return false;
  const Variable variable(name);
  forget();
  choose();
  return true;
}

// Runs a test on another kernel; the one before comes back when the object goes.
class ForcedKernel {
 public:
  explicit ForcedKernel(const char* name)
      : before_(blas_kernel()), is_possible_(load_kernel(name)) {}
  ~ForcedKernel() { load_kernel(before_.c_str()); }
  ForcedKernel(const ForcedKernel&) = delete;
  ForcedKernel& operator=(const ForcedKernel&) = delete;

  bool is_possible() const { return is_possible_; }

 private:
  std::string before_;
  bool is_possible_;
};

// The processor's instruction sets, as the operating system tells them.
std::set<std::string> processor_flags() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("flags")) {
      std::istringstream words(line);
      return {std::istream_iterator<std::string>(words), {}};
    }
  return {};
}

std::set<std::string> fitting_kernels() {
  const std::set<std::string> flags = processor_flags();
  const auto has_all = [&](const std::set<std::string>& names) {
    return std::includes(flags.begin(), flags.end(), names.begin(), names.end());
  };
  if (has_all({"avx512f", "avx512dq", "avx512bw", "avx512vl"}))
    return {"SkylakeX", "Cooperlake", "Sapphirerapids"};
  if (has_all({"avx2", "fma"})) return {"Haswell", "Zen", "Excavator"};
  return {};
}

}  // namespace

TEST_CASE("OpenBLAS runs code that fits the processor, whatever it began with", "[core][blas]") {
  const std::set<std::string> fitting = fitting_kernels();
  if (fitting.empty()) return;  // an old processor: nothing to choose
  for (const char* first : {"Prescott", "Nehalem"}) {
    const ForcedKernel forced(first);
    if (!forced.is_possible()) return;
    REQUIRE(blas_kernel() == first);
    const Variable none(nullptr);
    use_fitting_blas_kernel();
    CHECK(fitting.contains(blas_kernel()));
    CHECK(std::getenv(kVariable) == nullptr);
    const std::string chosen = blas_kernel();
    use_fitting_blas_kernel();
    CHECK(blas_kernel() == chosen);
  }
}

TEST_CASE("The user's choice of a kernel stays", "[core][blas]") {
  const ForcedKernel forced("Prescott");
  if (!forced.is_possible()) return;
  const Variable choice("Prescott");
  use_fitting_blas_kernel();
  CHECK(blas_kernel() == "Prescott");
}

TEST_CASE("Every kernel that runs here solves alike", "[core][blas]") {
  srand(1);
  const RowMatrix centres = RowMatrix::Random(1800, 3), values = RowMatrix::Random(1800, 3),
                  targets = RowMatrix::Random(50, 3);
  std::vector<const char*> names = {"Prescott"};
  const std::set<std::string> fitting = fitting_kernels();
  if (!fitting.empty()) names.push_back("Haswell");
  if (fitting.contains("SkylakeX")) names.push_back("SkylakeX");
  for (const SolverKind solver : {SolverKind::Lu, SolverKind::Ldlt, SolverKind::Cholesky}) {
    RowMatrix expected;
    for (const char* name : names) {
      const ForcedKernel forced(name);
      if (!forced.is_possible()) return;
      INFO(name);
      const RbfSystem system(centres, Kernel::triharmonic_3d(), {.solver = solver});
      const RowMatrix found = system.solve(values).evaluate(targets);
      if (expected.size() == 0) expected = found;
      // Rounding at the systems' condition, 1e7.
      CHECK((found - expected).cwiseAbs().maxCoeff() < 1e-7);
    }
  }
}

}  // namespace cadmorph
