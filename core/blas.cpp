#include "core/blas.h"

#include <dlfcn.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <mutex>
#include <new>
#include <string_view>

#include "core/parallel.h"

namespace cadmorph {
namespace {

// Looked up at run time, so that the program links and runs with any LAPACK.
template <class Function>
Function find_symbol(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_DEFAULT, name));
}

std::mutex threads_mutex;
int serial_users = 0;
int wanted_threads = 0;  // 0: as the library found it

void apply_threads(int count) {
  if (const auto set = find_symbol<void (*)(int)>("openblas_set_num_threads")) set(count);
}

template <std::size_t N>
bool contains(const std::array<std::string_view, N>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Code that this processor can run where `kernel` is slower; else empty.
std::string better_kernel(const std::string& kernel) {
#if defined(__x86_64__)
  constexpr std::array<std::string_view, 3> kAvx512 = {"SkylakeX", "Cooperlake", "Sapphirerapids"};
  constexpr std::array<std::string_view, 3> kAvx2 = {"Haswell", "Zen", "Excavator"};
  if (kernel.empty() || contains(kAvx512, kernel)) return {};
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    return "SkylakeX";
  if (contains(kAvx2, kernel)) return {};
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return "Haswell";
#endif
  return {};
}

// OpenBLAS asks the system for a buffer for each thread when it is first used, and again without an
// end where it gets none, as under a limit of the address space (ulimit -v, a queue's h_vmem).
void require_memory_of_blas() {
  constexpr std::size_t kBuffer = std::size_t{132} << 20;  // OpenBLAS 0.3.21 asks for 128 MiB
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return;
  const std::size_t size = kBuffer * std::size_t(std::max(1, thread_count()));
  void* const block = mmap(nullptr, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (block == MAP_FAILED) throw std::bad_alloc();
  munmap(block, size);
}

}  // namespace

void set_blas_threads(int count) {
  const std::lock_guard lock(threads_mutex);
  wanted_threads = count;
  if (serial_users == 0) apply_threads(count);
}

SerialBlas::SerialBlas() {
  static std::once_flag has_memory;
  std::call_once(has_memory, require_memory_of_blas);
  const std::lock_guard lock(threads_mutex);
  if (serial_users++ > 0) return;
  const auto get = find_symbol<int (*)()>("openblas_get_num_threads");
  if (wanted_threads == 0 && get) wanted_threads = get();
  apply_threads(1);
}

SerialBlas::~SerialBlas() {
  const std::lock_guard lock(threads_mutex);
  if (--serial_users == 0 && wanted_threads > 0) apply_threads(wanted_threads);
}

std::string blas_kernel() {
  const auto core_name = find_symbol<char* (*)()>("openblas_get_corename");
  return core_name ? core_name() : std::string();
}

// OpenBLAS takes its kernel when it is loaded, before main; its two functions do so once more.
void use_fitting_blas_kernel() {
  constexpr const char* kVariable = "OPENBLAS_CORETYPE";
  const auto forget = find_symbol<void (*)()>("gotoblas_dynamic_quit"),
             choose = find_symbol<void (*)()>("gotoblas_dynamic_init");
  if (std::getenv(kVariable) || !forget || !choose) return;
  const std::string better = better_kernel(blas_kernel());
  if (better.empty()) return;
  setenv(kVariable, better.c_str(), 1);
  forget();
  choose();
  unsetenv(kVariable);
}

}  // namespace cadmorph
