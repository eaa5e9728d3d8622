#include "models/hex_builder.h"

#include <cmath>

namespace cadmorph::models {

namespace {

constexpr double merge_distance = 1e-6;  // mm; node spacings are above 1e-1

}  // namespace

Index HexBuilder::node(const Point& position) {
  // Half a spacing off the round values that models are made of, where rounding could fall apart.
  const auto quantise = [](double value) {
    return static_cast<std::int64_t>(std::floor(value / merge_distance + 0.5));
  };
  const auto [entry, is_new] =
      ids_.try_emplace({quantise(position[0]), quantise(position[1]), quantise(position[2])},
                       static_cast<Index>(points_.size()));
  if (is_new) points_.push_back(position);
  return entry->second;
}

void HexBuilder::add(const std::array<Point, 8>& corners) {
  for (const Point& corner : corners) connectivity_.push_back(node(corner));
}

Mesh HexBuilder::mesh() const { return make_mesh(points_, CellType::Hexahedron, 8, connectivity_); }

Mesh make_mesh(const std::vector<Eigen::Vector3d>& points, CellType type, int nodes_per_cell,
               const std::vector<Index>& connectivity) {
  Mesh mesh;
  mesh.points.resize(static_cast<Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    mesh.points.row(static_cast<Index>(i)) = points[i].transpose();
  }
  const std::size_t cells = connectivity.size() / nodes_per_cell;
  mesh.types.assign(cells, type);
  mesh.offsets.resize(cells + 1);
  for (std::size_t c = 0; c <= cells; ++c) mesh.offsets[c] = static_cast<Index>(c) * nodes_per_cell;
  mesh.connectivity = connectivity;
  return mesh;
}

}  // namespace cadmorph::models
