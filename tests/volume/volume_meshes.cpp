#include "volume_meshes.h"

#include <cmath>

#include "../core/sample_meshes.h"

namespace cadmorph::testing {

std::vector<Index> cube_surface(const Mesh& mesh) {
  std::vector<Index> nodes;
  for (Index n = 0; n < mesh.node_count(); ++n)
    for (int d = 0; d < 3; ++d)
      if (std::abs(mesh.points(n, d) - 0.5) > 0.5 - 1e-9) {
        nodes.push_back(n);
        break;
      }
  return nodes;
}

Points rows_of(const Points& points, const std::vector<Index>& rows) {
  Points result(rows.size(), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(i) = points.row(rows[i]);
  return result;
}

Points mapped(const Points& points,
              const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map) {
  Points result(points.rows(), 3);
  for (Index i = 0; i < points.rows(); ++i)
    result.row(i) = map(points.row(i).transpose()).transpose();
  return result;
}

Mesh graded_layers(int n, double first) {
  Mesh mesh = cube(CellType::Wedge, n);
  for (Index i = 0; i < mesh.node_count(); ++i) {
    const double level = mesh.points(i, 2);
    mesh.points(i, 2) = level == 0 ? 0 : first * std::pow(1 / first, (n * level - 1) / (n - 1));
  }
  return mesh;
}

Eigen::Vector3d wave(const Eigen::Vector3d& x) {
  const double height = 0.08 * std::sin(5 * x[0]) * std::cos(4 * x[1]);
  return x + Eigen::Vector3d(0, 0, height * (1 - x[2]));
}

}  // namespace cadmorph::testing
