#include "apps/report/surface_data.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "apps/report/base64.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "the page reads little-endian arrays");

/// Polygons between rows of Boundary::nodes.
struct Polygons {
  std::vector<std::uint8_t> sizes;
  std::vector<std::uint32_t> corners;
};

template <class Value>
std::string encoded(const std::vector<Value>& values) {
  return base64({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value)});
}

Json quantised(const RowMatrix& values) {
  constexpr double steps = std::numeric_limits<std::uint16_t>::max();
  const Eigen::RowVectorXd low = values.colwise().minCoeff();
  const Eigen::RowVectorXd size = values.colwise().maxCoeff() - low;
  std::vector<std::uint16_t> data(values.size());
  for (Index i = 0, k = 0; i < values.rows(); ++i)
    for (Index j = 0; j < values.cols(); ++j, ++k)
      data[k] =
          size[j] > 0
              ? static_cast<std::uint16_t>(std::lround(steps * (values(i, j) - low[j]) / size[j]))
              : 0;
  return {{"low", std::vector<double>(low.begin(), low.end())},
          {"size", std::vector<double>(size.begin(), size.end())},
          {"data", encoded(data)}};
}

Polygons polygons_of(const Boundary& boundary) {
  constexpr std::size_t most = std::numeric_limits<std::uint8_t>::max();
  Polygons result;
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    const auto nodes = boundary.facet(f);
    const std::size_t corners = std::min<std::size_t>(
        corner_count(boundary.types[f], static_cast<Index>(nodes.size())), most);
    result.sizes.push_back(static_cast<std::uint8_t>(corners));
    for (const Index node : nodes.first(corners))
      result.corners.push_back(static_cast<std::uint32_t>(row_of(boundary, node)));
  }
  return result;
}

std::vector<std::uint32_t> triangles_of(const Polygons& polygons) {
  std::vector<std::uint32_t> result;
  std::size_t first = 0;
  for (const std::uint8_t size : polygons.sizes) {
    for (std::size_t i = 2; i < size; ++i)
      for (const std::size_t corner : {first, first + i - 1, first + i})
        result.push_back(polygons.corners[corner]);
    first += size;
  }
  return result;
}

Polygons simplified(const std::vector<std::uint32_t>& triangles, const Points& points,
                    Index most_triangles) {
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> positions = points.cast<float>();
  constexpr float any_error = 1;  // the count alone decides
  std::vector<std::uint32_t> kept(triangles.size());
  kept.resize(meshopt_simplify(kept.data(), triangles.data(), triangles.size(), positions.data(),
                               static_cast<std::size_t>(positions.rows()), 3 * sizeof(float),
                               static_cast<std::size_t>(3 * most_triangles), any_error, 0,
                               nullptr));
  return {std::vector<std::uint8_t>(kept.size() / 3, 3), std::move(kept)};
}

// The smallest value of the measured cells at each node of the mesh; 1 where there is none.
Eigen::VectorXd least_at_nodes(const Mesh& mesh, const std::vector<double>& values) {
  Eigen::VectorXd result = Eigen::VectorXd::Ones(mesh.node_count());
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (std::isnan(values[c])) continue;
    for (const Index node : mesh.cell(c)) result[node] = std::min(result[node], values[c]);
  }
  return result;
}

// Numbers the rows in use anew; returns them.
std::vector<RowId> compact(Polygons& polygons, std::size_t row_count) {
  std::vector<std::uint32_t> number(row_count, 0);
  for (const std::uint32_t corner : polygons.corners) number[corner] = 1;
  std::vector<RowId> rows;
  for (std::size_t row = 0; row < row_count; ++row)
    if (number[row] != 0) {
      number[row] = static_cast<std::uint32_t>(rows.size());
      rows.push_back(RowId(row));
    }
  for (std::uint32_t& corner : polygons.corners) corner = number[corner];
  return rows;
}

std::vector<float> deviations(const Association& association, const Eigen::VectorXd& after,
                              const std::vector<RowId>& rows) {
  std::vector<float> result;
  for (const RowId row : rows) {
    const bool is_on_cad = association.dimension[row] != CadDimension::None;
    constexpr float none = std::numeric_limits<float>::quiet_NaN();
    result.push_back(is_on_cad ? static_cast<float>(association.distance[row]) : none);
    result.push_back(is_on_cad ? static_cast<float>(after[row]) : none);
  }
  return result;
}

}  // namespace

Json surface_data(const MorphResult& result, Index most_triangles) {
  const BaseSide& base = *result.base;
  const Mesh& mesh = base.mesh();
  const Boundary& boundary = base.boundary;
  Polygons polygons = polygons_of(boundary);
  const std::vector<std::uint32_t> triangles = triangles_of(polygons);
  const auto triangle_count = static_cast<Index>(triangles.size() / 3);
  const bool is_simplified = triangle_count > most_triangles;
  if (is_simplified)
    polygons = simplified(triangles, mesh.points(boundary.nodes, Eigen::all), most_triangles);
  const std::vector<RowId> rows = compact(polygons, boundary.nodes.size());
  std::vector<Index> nodes;
  for (const RowId row : rows) nodes.push_back(boundary.nodes[row]);
  const Points before = mesh.points(nodes, Eigen::all);
  const Points after = result.positions(nodes, Eigen::all);
  RowMatrix jacobian(nodes.size(), 2);
  jacobian.col(0) = least_at_nodes(mesh, base.quality.values)(nodes);
  jacobian.col(1) = least_at_nodes(mesh, result.quality.values)(nodes);
  return {{"nodes", nodes.size()},
          {"facets", polygons.sizes.size()},
          {"triangles", triangle_count},
          {"is_simplified", is_simplified},
          {"unit_mm", result.report.mesh.unit_mm},
          {"position", quantised(before)},
          {"displacement", quantised(after - before)},
          {"jacobian", quantised(jacobian)},
          {"deviation", encoded(deviations(base.association(), result.surface.distance, rows))},
          {"sizes", encoded(polygons.sizes)},
          {"corners", encoded(polygons.corners)}};
}

}  // namespace cadmorph
