#pragma once

#include <vector>

#include "core/types.h"

namespace cadmorph {

/// The rows of nodes that a file calls by numbers of its own, in any order and with gaps.
class NodeNumbers {
 public:
  NodeNumbers() = default;
  /// `numbers[row]` is the number of the node in that row.
  explicit NodeNumbers(std::vector<Index> numbers);

  /// A row whose number an earlier row has too; -1 if there is none.
  Index double_row() const { return double_row_; }

  /// The row of a node; -1 for a number that no node has.
  Index row(Index number) const {
    if (number < first_ || number > last_) return -1;
    if (is_consecutive_) return number - first_;
    return table_.empty() ? find(number) : table_[std::size_t(number - first_)];
  }

 private:
  Index find(Index number) const;

  Index first_ = 0, last_ = -1;
  bool is_consecutive_ = false;
  Index double_row_ = -1;
  std::vector<Index> table_;                        ///< row of first_ + i; empty: too many gaps
  std::vector<std::pair<Index, Index>> by_number_;  ///< number and row, ascending
};

}  // namespace cadmorph
