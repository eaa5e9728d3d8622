#include "core/finite_volumes.h"

#include "core/plane_mesh.h"

namespace cadmorph {

FiniteVolumes::FiniteVolumes(const Mesh& mesh, const Points& points,
                             const CellNeighbours& neighbours, const Orientation& orientation)
    : mesh_(mesh),
      neighbours_(neighbours),
      orientation_(orientation),
      normal_(neighbours.neighbour.empty() ? plane_normal(mesh, points) : Eigen::Vector3d::Zero()) {
  if (normal_.isZero(0)) return;
  layer_.emplace();
  layer_->mesh = one_layer(mesh, points);
  layer_->neighbours = find_cell_neighbours(layer_->mesh);
  layer_->orientation = detect_orientation(layer_->mesh);
}

const Points& FiniteVolumes::place(const Points& points, Points& scratch) const {
  if (!is_layer()) return points;
  const Index n = mesh_.node_count();
  scratch.resize(2 * n, 3);
  scratch << points, points.rowwise() + normal_.transpose();
  return scratch;
}

}  // namespace cadmorph
