#include "volume/cell_slopes.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/parallel.h"

namespace cadmorph {

CellSlopes::CellSlopes(const Mesh& mesh, const std::vector<Index>& cells, const FreeNodes& free) {
  first_.reserve(cells.size() + 1);
  first_.push_back(0);
  for (const Index c : cells) first_.push_back(first_.back() + std::ssize(mesh.cell(c)));
  rows_.resize(first_.back(), 3);

  const auto for_all = [&](const auto& visit) {
    Index row = 0;
    for (const Index c : cells)
      for (const Index node : mesh.cell(c)) {
        if (free.contains(node)) visit(free.place_of(node), row);
        ++row;
      }
  };
  node_first_.assign(std::size_t(free.count()) + 1, 0);
  for_all([&](Index i, Index) { ++node_first_[i + 1]; });
  std::partial_sum(node_first_.begin(), node_first_.end(), node_first_.begin());
  rows_of_node_.resize(std::size_t(node_first_.back()));
  std::vector<Index> next = node_first_;
  for_all([&](Index i, Index row) { rows_of_node_[next[i]++] = row; });
}

void CellSlopes::gather(const FreeNodes& free, double factor, Eigen::VectorXd& gradient) const {
  gradient.setZero(free.unknowns());
  parallel_for(free.count(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      for (Index k = node_first_[i]; k < node_first_[i + 1]; ++k)
        sum += rows_.row(rows_of_node_[k]);
      free.add_slope(i, factor * sum.transpose(), gradient);
    }
  });
}

std::vector<NodeBlocks::Block> CellSlopes::gather_blocks(const FreeNodes& free) const {
  std::vector<NodeBlocks::Block> result(std::size_t(free.count()));
  parallel_for(free.count(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
      double stiffness = 0, most = 0;
      for (Index k = node_first_[i]; k < node_first_[i + 1]; ++k) {
        const Index row = rows_of_node_[k];
        hessian += rows_.row(row).transpose() * rows_.row(row);
        stiffness += stiffness_(row, 0);
        most = std::max<double>(most, stiffness_(row, 1));
      }
      hessian.diagonal().array() += stiffness;
      result[i] = {hessian, 1 / std::sqrt(most)};
    }
  });
  return result;
}

}  // namespace cadmorph
