#include "volume_meshes.h"

#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "../core/sample_meshes.h"

namespace cadmorph::testing {

using Eigen::Vector3d;

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

FarField far_field(int n, double far) {
  FarField result;
  std::map<std::array<int, 3>, Index> ids;
  std::vector<Vector3d> directions;
  const auto direction = [&](std::array<int, 3> at) {
    const auto [place, is_new] = ids.try_emplace(at, static_cast<Index>(directions.size()));
    if (is_new) {
      Vector3d x;
      for (int d = 0; d < 3; ++d) x[d] = std::tan(std::numbers::pi / 4 * (2.0 * at[d] / n - 1));
      directions.push_back(x.normalized());
    }
    return place->second;
  };
  std::vector<std::array<Index, 4>> quads;
  for (int d = 0; d < 3; ++d)
    for (const int side : {0, n})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto corner = [&](int a, int b) {
            std::array<int, 3> at{};
            at[d] = side;
            at[(d + 1) % 3] = i + a;
            at[(d + 2) % 3] = j + b;
            return direction(at);
          };
          quads.push_back({corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)});
          if (side == 0) std::swap(quads.back()[1], quads.back()[3]);
        }
  const auto count = static_cast<Index>(directions.size());
  const int layers = static_cast<int>(std::ceil(std::log(far) * 2 * n / std::numbers::pi));
  Mesh& mesh = result.mesh;
  mesh.points.resize(count * (layers + 1), 3);
  mesh.offsets = {0};
  for (int k = 0; k <= layers; ++k)
    for (Index i = 0; i < count; ++i)
      mesh.points.row(k * count + i) =
          std::pow(far, static_cast<double>(k) / layers) * directions[i].transpose();
  for (int k = 0; k < layers; ++k)
    for (const auto& q : quads) {
      std::array<Index, 8> cell{};
      for (int c = 0; c < 8; ++c) cell[c] = q[c % 4] + (k + c / 4) * count;
      add_cell(mesh, CellType::Hexahedron, cell);
    }
  for (Index i = 0; i < count; ++i) result.body.push_back(i);
  result.surface = result.body;
  for (Index i = 0; i < count; ++i) result.surface.push_back(layers * count + i);
  return result;
}

FarField flat_far_field(int n, double far) {
  FarField result;
  const int layers = static_cast<int>(std::ceil(std::log(far) * n / (2 * std::numbers::pi)));
  Mesh& mesh = result.mesh;
  mesh.points = Points::Zero(static_cast<Index>(n) * (layers + 1), 3);
  mesh.offsets = {0};
  for (int k = 0; k <= layers; ++k)
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * i / n;
      mesh.points.row(k * n + i) = std::pow(far, static_cast<double>(k) / layers) *
                                   Eigen::RowVector3d(std::cos(angle), std::sin(angle), 0);
    }
  for (int k = 0; k < layers; ++k)
    for (int i = 0; i < n; ++i) {
      const Index a = k * n + i, b = k * n + (i + 1) % n;
      add_cell(mesh, CellType::Quad, std::array<Index, 4>{a, b, b + n, a + n});
    }
  for (Index i = 0; i < n; ++i) result.body.push_back(i);
  result.surface = result.body;
  for (Index i = 0; i < n; ++i) result.surface.push_back(static_cast<Index>(layers) * n + i);
  return result;
}

Points targets(const FarField& field, const Motion& motion) {
  Points result = rows_of(field.mesh.points, field.surface);
  const auto count = static_cast<Index>(field.body.size());
  result.topRows(count) = mapped(Points(result.topRows(count)), motion);
  return result;
}

}  // namespace cadmorph::testing
