#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "core/mesh.h"
#include "core/parallel.h"

namespace cadmorph {

/// The cells at each node of a mesh (of less than 2^32 cells), ascending. Parallel; O(cells).
class NodeCells {
 public:
  explicit NodeCells(const Mesh& mesh) : first_(mesh.node_count() + 1, 0) {
    const auto for_all = [&](const auto& visit) {
      const Index nodes = mesh.node_count(), parts = thread_count();
      parallel_for(parts, 1, [&](Index part, Index) {
        const Index first = part * nodes / parts, last = (part + 1) * nodes / parts;
        for (Index c = 0; c < mesh.cell_count(); ++c)
          for (const Index node : mesh.cell(c))
            if (node >= first && node < last) visit(node, c);
      });
    };
    for_all([&](Index node, Index) { ++first_[node + 1]; });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    cells_.resize(static_cast<std::size_t>(first_.back()));
    std::vector<Index> next = first_;
    for_all([&](Index node, Index c) { cells_[next[node]++] = static_cast<std::uint32_t>(c); });
  }
  std::span<const std::uint32_t> cells(Index node) const {
    return {cells_.data() + first_[node],
            static_cast<std::size_t>(first_[node + 1] - first_[node])};
  }

 private:
  std::vector<Index> first_;
  std::vector<std::uint32_t> cells_;
};

}  // namespace cadmorph
