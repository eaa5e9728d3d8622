#pragma once

#include <span>
#include <utility>
#include <vector>

#include "core/types.h"

namespace cadmorph {

/// Finds items by the numbers that a file gives them, in any order and with gaps.
class NumberTable {
 public:
  NumberTable() = default;
  /// `numbers[i]` is that of item i, any integer; of equal ones the first item counts. Memory: some
  /// 16 bytes an item, 64 where there are gaps.
  explicit NumberTable(std::span<const Index> numbers);

  /// The item of a number; -1 when there is none. O(1), with many gaps O(log items).
  Index find(Index number) const {
    if (number < first_ || number > last_) return -1;
    if (is_consecutive_) return number - first_;
    return dense_.empty() ? find_sparse(number) : dense_[std::size_t(number - first_)];
  }

  /// An item whose number an earlier item has too; -1 if there is none.
  Index double_item() const { return double_item_; }

 private:
  Index find_sparse(Index number) const;

  Index first_ = 0, last_ = -1;
  bool is_consecutive_ = false;
  Index double_item_ = -1;
  std::vector<Index> dense_;                     ///< by number - first_; empty: too many gaps
  std::vector<std::pair<Index, Index>> sparse_;  ///< number and item, ascending
};

}  // namespace cadmorph
