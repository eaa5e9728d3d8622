#include "volume/baselines/simplex_linear.h"

#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_cell_base_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

#include <Eigen/LU>
#include <array>
#include <utility>

#include "core/errors.h"

namespace cadmorph {
namespace {

using Geometry = CGAL::Exact_predicates_inexact_constructions_kernel;
using Vertex = CGAL::Triangulation_vertex_base_with_info_3<int, Geometry>;
using Cell = CGAL::Delaunay_triangulation_cell_base_3<Geometry>;
using Delaunay =
    CGAL::Delaunay_triangulation_3<Geometry, CGAL::Triangulation_data_structure_3<Vertex, Cell>>;

// A free node as a weighted sum of surface nodes.
struct Follower {
  Index node;
  std::array<int, 4> corners;  // positions in the list of surface nodes
  Eigen::Vector4d weights;
};

Geometry::Point_3 to_point(const Mesh& mesh, Index node) {
  const auto x = mesh.points.row(node);
  return {x[0], x[1], x[2]};
}

Delaunay tetrahedralise(const Mesh& mesh, const std::vector<Index>& surface_nodes) {
  std::vector<std::pair<Geometry::Point_3, int>> points;
  for (std::size_t i = 0; i < surface_nodes.size(); ++i)
    points.emplace_back(to_point(mesh, surface_nodes[i]), static_cast<int>(i));
  Delaunay result(points.begin(), points.end());
  if (result.dimension() < 3)
    throw SolverError("simplex-linear: all surface nodes lie in a plane; use another method");
  return result;
}

class SimplexLinear final : public Baseline {
 public:
  SimplexLinear(const Mesh& mesh, const std::vector<Index>& surface_nodes)
      : surface_nodes_(surface_nodes), node_count_(mesh.node_count()) {
    const Delaunay delaunay = tetrahedralise(mesh, surface_nodes);
    std::vector<char> is_surface(node_count_, 0);
    for (const Index node : surface_nodes) is_surface[node] = 1;
    Delaunay::Cell_handle hint;
    for (Index node = 0; node < node_count_; ++node)
      if (!is_surface[node]) followers_.push_back(place(delaunay, mesh, node, hint));
  }

  Points displacements(const Points& surface) const override {
    Points result(node_count_, 3);
    for (std::size_t i = 0; i < surface_nodes_.size(); ++i)
      result.row(surface_nodes_[i]) = surface.row(i);
    for (const Follower& f : followers_) {
      result.row(f.node).setZero();
      for (int k = 0; k < 4; ++k) result.row(f.node) += f.weights[k] * surface.row(f.corners[k]);
    }
    return result;
  }

 private:
  Follower place(const Delaunay& delaunay, const Mesh& mesh, Index node,
                 Delaunay::Cell_handle& hint) const {
    Delaunay::Cell_handle cell = delaunay.locate(to_point(mesh, node), hint);
    if (delaunay.is_infinite(cell)) cell = cell->neighbor(cell->index(delaunay.infinite_vertex()));
    hint = cell;
    Follower result{.node = node, .corners = {}, .weights = {}};
    Eigen::Matrix<double, 3, 4> corners;
    for (int k = 0; k < 4; ++k) {
      result.corners[k] = cell->vertex(k)->info();
      corners.col(k) = mesh.points.row(surface_nodes_[result.corners[k]]).transpose();
    }
    // Relative to the first corner: sums to one to rounding.
    const Eigen::Matrix3d edges = corners.rightCols<3>().colwise() - corners.col(0);
    const Eigen::Vector3d from_first = mesh.points.row(node).transpose() - corners.col(0);
    result.weights.tail<3>() = edges.fullPivLu().solve(from_first);
    result.weights[0] = 1 - result.weights.tail<3>().sum();
    return result;
  }

  std::vector<Index> surface_nodes_;
  Index node_count_;
  std::vector<Follower> followers_;
};

}  // namespace

std::unique_ptr<Baseline> make_simplex_linear(const Mesh& mesh,
                                              const std::vector<Index>& surface_nodes) {
  return std::make_unique<SimplexLinear>(mesh, surface_nodes);
}

bool has_simplex_linear() { return true; }

}  // namespace cadmorph
