#pragma once

#include <algorithm>
#include <vector>

#include "core/types.h"

namespace cadmorph {

/// The numbers that a file gives its nodes or cells, in their order. Of numbers that ascend by one,
/// as most do, only the first is held.
class Numbering {
 public:
  void push_back(Index number) {
    if (runs_.empty() || number != runs_.back().number + size_ - runs_.back().first)
      runs_.push_back({size_, number});
    ++size_;
  }

  bool is_empty() const { return size_ == 0; }

  Index operator[](Index i) const {
    const Run& run = *(std::ranges::upper_bound(runs_, i, {}, &Run::first) - 1);
    return run.number + i - run.first;
  }

 private:
  struct Run {
    Index first, number;
  };
  std::vector<Run> runs_;
  Index size_ = 0;
};

}  // namespace cadmorph
