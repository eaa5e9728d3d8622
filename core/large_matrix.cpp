#include "core/large_matrix.h"

#include <sys/mman.h>

#include <cstdint>

namespace cadmorph {

Eigen::MatrixXd large_matrix(Index rows, Index columns) {
  Eigen::MatrixXd result(rows, columns);
#ifdef MADV_HUGEPAGE
  constexpr std::uintptr_t kPage = std::uintptr_t{1} << 21;  // bytes of a huge page on x86-64
  const auto begin = reinterpret_cast<std::uintptr_t>(result.data());
  const std::uintptr_t end = begin + sizeof(double) * static_cast<std::size_t>(result.size());
  const std::uintptr_t first = (begin + kPage - 1) / kPage * kPage, last = end / kPage * kPage;
  // Whether it is granted makes no difference but to speed.
  if (first < last) (void)madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);
#endif
  return result;
}

}  // namespace cadmorph
