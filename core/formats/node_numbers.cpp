#include "core/formats/node_numbers.h"

#include <algorithm>

namespace cadmorph {

NodeNumbers::NodeNumbers(std::vector<Index> numbers) {
  if (numbers.empty()) return;
  const auto [least, largest] = std::ranges::minmax(numbers);
  first_ = least;
  last_ = largest;
  const Index count = std::ssize(numbers);
  is_consecutive_ = true;
  for (Index row = 0; row < count && is_consecutive_; ++row)
    is_consecutive_ = numbers[std::size_t(row)] - numbers.front() == row;
  if (is_consecutive_) return;
  // Unsigned: the range of wild numbers may overflow.
  const std::uint64_t range = std::uint64_t(last_) - std::uint64_t(first_);
  if (range / 8 <= std::uint64_t(count)) {
    table_.assign(std::size_t(range + 1), -1);
    for (Index row = 0; row < count; ++row) {
      Index& entry = table_[std::size_t(numbers[std::size_t(row)] - first_)];
      if (entry >= 0 && double_row_ < 0) double_row_ = row;
      entry = row;
    }
    return;
  }
  by_number_.reserve(numbers.size());
  for (Index row = 0; row < count; ++row) by_number_.emplace_back(numbers[std::size_t(row)], row);
  std::ranges::sort(by_number_);
  for (std::size_t i = 1; i < by_number_.size() && double_row_ < 0; ++i)
    if (by_number_[i].first == by_number_[i - 1].first) double_row_ = by_number_[i].second;
}

Index NodeNumbers::find(Index number) const {
  const auto entry =
      std::ranges::lower_bound(by_number_, number, {}, &std::pair<Index, Index>::first);
  return entry != by_number_.end() && entry->first == number ? entry->second : -1;
}

}  // namespace cadmorph
