#include "surface/surface_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace cadmorph {
namespace {

void add_incidence(SurfaceMesh& surface) {
  const auto nodes = static_cast<std::size_t>(surface.points.rows());
  surface.incident_offsets.assign(nodes + 1, 0);
  for (const auto& facet : surface.facets)
    for (const RowId n : facet) ++surface.incident_offsets[n + 1];
  for (std::size_t n = 0; n < nodes; ++n)
    surface.incident_offsets[n + 1] += surface.incident_offsets[n];
  surface.incident_facets.resize(static_cast<std::size_t>(surface.incident_offsets.back()));
  std::vector<int> next(surface.incident_offsets.begin(), surface.incident_offsets.end() - 1);
  for (const FacetId f : surface.facets.ids())
    for (const RowId n : surface.facets[f]) surface.incident_facets[next[n]++] = f;
}

// Mid-side nodes get the shortest corner edge of their facets.
void add_local_lengths(SurfaceMesh& surface) {
  surface.local_length.setConstant(surface.points.rows(), std::numeric_limits<double>::infinity());
  for (const FacetId f : surface.facets.ids()) {
    const auto& facet = surface.facets[f];
    const int corners = surface.corners[f];
    double shortest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < corners; ++i) {
      const RowId a = facet[i], b = facet[(i + 1) % corners];
      const double length = (surface.points.row(a) - surface.points.row(b)).norm();
      if (length > 0) shortest = std::min(shortest, length);
    }
    for (const RowId n : facet)
      surface.local_length[n] = std::min(surface.local_length[n], shortest);
  }
}

// Of a facet's edges, the one whose middle is nearest to x: its first corner's position.
int nearest_edge(const SurfaceMesh& surface, FacetId facet, const Eigen::Vector3d& x) {
  const auto& nodes = surface.facets[facet];
  const int corners = surface.corners[facet];
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < corners; ++i) {
    const Eigen::Vector3d middle =
        0.5 * (surface.points.row(nodes[i]) + surface.points.row(nodes[(i + 1) % corners]));
    if (const double d = (middle - x).squaredNorm(); d < least) {
      least = d;
      best = i;
    }
  }
  return best;
}

// Nodes behind the corners and mid-side nodes lie in the middle of the facet.
void add_middles(SurfaceMesh& surface) {
  surface.between.resize(static_cast<std::size_t>(surface.points.rows()));
  surface.own_length = surface.local_length;
  for (const FacetId f : surface.facets.ids()) {
    const auto& nodes = surface.facets[f];
    const int corners = surface.corners[f];
    for (int i = corners; i < static_cast<int>(nodes.size()); ++i) {
      auto& between = surface.between[nodes[i]];
      if (i >= 2 * corners) {
        std::copy_n(nodes.begin(), std::min(corners, 4), between.begin());
        continue;
      }
      const int edge = nearest_edge(surface, f, surface.points.row(nodes[i]));
      between = {nodes[edge], nodes[(edge + 1) % corners]};
      surface.own_length[nodes[i]] =
          (surface.points.row(between[0]) - surface.points.row(between[1])).norm();
    }
  }
  for (const FacetId f : surface.facets.ids())
    for (int i = 0; i < surface.corners[f]; ++i) {
      surface.between[surface.facets[f][i]].fill({});
      surface.own_length[surface.facets[f][i]] = surface.local_length[surface.facets[f][i]];
    }
}

}  // namespace

Eigen::Vector3d SurfaceMesh::middle(RowId node, const Points& at) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const RowId other : between[node]) {
    if (other < 0) break;
    sum += at.row(other).transpose();
    ++count;
  }
  return sum / count;
}

SurfaceMesh make_surface_mesh(const Mesh& mesh, const Boundary& boundary, double unit_mm) {
  SurfaceMesh surface;
  std::vector<RowId> row(static_cast<std::size_t>(mesh.node_count()));
  surface.points.resize(static_cast<Index>(boundary.nodes.size()), 3);
  for (std::size_t i = 0; i < boundary.nodes.size(); ++i) {
    row[boundary.nodes[i]] = RowId(i);
    surface.points.row(static_cast<Index>(i)) = unit_mm * mesh.points.row(boundary.nodes[i]);
  }
  surface.facets.resize(static_cast<std::size_t>(boundary.facet_count()));
  surface.corners.resize(surface.facets.size());
  for (const FacetId f : surface.facets.ids()) {
    const auto nodes = boundary.facet(f);
    for (const Index n : nodes) surface.facets[f].push_back(row[n]);
    surface.corners[f] = corner_count(boundary.types[f], static_cast<Index>(nodes.size()));
  }
  add_incidence(surface);
  add_local_lengths(surface);
  add_middles(surface);
  return surface;
}

RowId row_of(const Boundary& boundary, Index node) {
  return RowId(std::ranges::lower_bound(boundary.nodes, node) - boundary.nodes.begin());
}

Eigen::Vector3d area_vector(const SurfaceMesh& surface, const Points& points, FacetId facet) {
  const auto& nodes = surface.facets[facet];
  const int corners = surface.corners[facet];
  const Eigen::Vector3d origin = points.row(nodes[0]);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 1; i + 1 < corners; ++i) {
    const Eigen::Vector3d a = points.row(nodes[i]).transpose() - origin;
    const Eigen::Vector3d b = points.row(nodes[i + 1]).transpose() - origin;
    sum += 0.5 * a.cross(b);
  }
  return sum;
}

int inward_corners(const SurfaceMesh& surface, const Points& points, FacetId facet, double sine) {
  const auto& nodes = surface.facets[facet];
  const int corners = surface.corners[facet];
  const Eigen::Vector3d normal = area_vector(surface, points, facet);
  int count = 0;
  for (int i = 0; i < corners; ++i) {
    const Eigen::Vector3d here = points.row(nodes[i]);
    const Eigen::Vector3d next = points.row(nodes[(i + 1) % corners]).transpose() - here;
    const Eigen::Vector3d last = points.row(nodes[(i + corners - 1) % corners]).transpose() - here;
    count += next.cross(last).dot(normal) <= sine * next.norm() * last.norm() * normal.norm();
  }
  return count;
}

Eigen::Vector3d centroid(const SurfaceMesh& surface, const Points& points, FacetId facet) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const int corners = surface.corners[facet];
  for (int i = 0; i < corners; ++i) sum += points.row(surface.facets[facet][i]).transpose();
  return sum / corners;
}

}  // namespace cadmorph
