#include "core/formats/mid_node_order.h"

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "core/cell_topology.h"

namespace cadmorph {

void order_mid_nodes(Mesh& mesh, const Eigen::Ref<const Points>& points, CellType type) {
  const std::vector<LocalMidNode> places = mid_nodes_of(type);
  const auto count = static_cast<Index>(places.size());
  // Squared distances of the file's nodes (rows) from the places of VTK's, in those of the corners.
  Eigen::MatrixXd apart = Eigen::MatrixXd::Zero(count, count);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (mesh.types[c] != type) continue;
    const auto cell = mesh.cell(c);
    const auto corners = cell.first(static_cast<std::size_t>(info_of(type).corners));
    const Points ends = points(std::vector<Index>(corners.begin(), corners.end()), Eigen::all);
    const double size = (ends.rowwise() - ends.colwise().mean()).squaredNorm();
    if (!(size > 0)) continue;
    for (Index p = 0; p < count; ++p) {
      Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
      for (const int corner : places[p].corners) middle += points.row(cell[corner]);
      middle /= static_cast<double>(places[p].corners.size());
      for (Index i = 0; i < count; ++i)
        apart(i, p) += (points.row(cell[places[i].node]) - middle).squaredNorm() / size;
    }
  }
  std::vector<Index> source(static_cast<std::size_t>(count));  // of each place: the file's node
  std::vector<char> is_taken(static_cast<std::size_t>(count), 0);
  for (Index p = 0; p < count; ++p) {
    apart.col(p).minCoeff(&source[p]);
    if (std::exchange(is_taken[source[p]], 1)) return;
  }
  if (std::ranges::is_sorted(source)) return;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (mesh.types[c] != type) continue;
    const auto cell = mesh.cell(c);
    const std::vector<Index> before(cell.begin(), cell.end());
    for (Index p = 0; p < count; ++p)
      mesh.connectivity[mesh.offsets[c] + places[p].node] = before[places[source[p]].node];
  }
}

}  // namespace cadmorph
