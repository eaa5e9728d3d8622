#include "core/formats/number_table.h"

#include <algorithm>

namespace cadmorph {

NumberTable::NumberTable(std::span<const Index> numbers) {
  if (numbers.empty()) return;
  const Index count = std::ssize(numbers);
  const auto [least, largest] = std::ranges::minmax(numbers);
  first_ = least;
  last_ = largest;
  // Unsigned: the distance of wild numbers may overflow.
  const auto distance = [&](Index number) { return std::uint64_t(number) - std::uint64_t(first_); };
  is_consecutive_ = true;
  for (Index i = 0; i < count && is_consecutive_; ++i)
    is_consecutive_ = distance(numbers[std::size_t(i)]) == std::uint64_t(i);
  if (is_consecutive_) return;
  constexpr Index kGaps = 8, kLeast = 1 << 20;  // beyond, a table would be mostly empty
  if (distance(last_) < std::uint64_t(kGaps * count + kLeast)) {
    dense_.assign(std::size_t(distance(last_) + 1), -1);
    for (Index i = 0; i < count; ++i) {
      Index& entry = dense_[std::size_t(distance(numbers[std::size_t(i)]))];
      if (entry < 0)
        entry = i;
      else if (double_item_ < 0)
        double_item_ = i;
    }
    return;
  }
  sparse_.reserve(numbers.size());
  for (Index i = 0; i < count; ++i) sparse_.emplace_back(numbers[std::size_t(i)], i);
  std::ranges::sort(sparse_);
  for (std::size_t i = 1; i < sparse_.size() && double_item_ < 0; ++i)
    if (sparse_[i].first == sparse_[i - 1].first) double_item_ = sparse_[i].second;
}

Index NumberTable::find_sparse(Index number) const {
  const auto entry = std::ranges::lower_bound(sparse_, number, {}, &std::pair<Index, Index>::first);
  return entry != sparse_.end() && entry->first == number ? entry->second : -1;
}

}  // namespace cadmorph
