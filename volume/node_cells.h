#pragma once

#include <span>
#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// The cells at each node of a mesh, ascending.
class NodeCells {
 public:
  explicit NodeCells(const Mesh& mesh) : first_(mesh.node_count() + 1, 0) {
    for (const Index node : mesh.connectivity) ++first_[node + 1];
    for (std::size_t n = 1; n < first_.size(); ++n) first_[n] += first_[n - 1];
    cells_.resize(mesh.connectivity.size());
    auto next = first_;
    for (Index c = 0; c < mesh.cell_count(); ++c)
      for (const Index node : mesh.cell(c)) cells_[next[node]++] = c;
  }
  std::span<const Index> cells(Index node) const {
    return {cells_.data() + first_[node],
            static_cast<std::size_t>(first_[node + 1] - first_[node])};
  }

 private:
  std::vector<Index> first_, cells_;
};

}  // namespace cadmorph
