#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/kd_tree.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// The surface that a part of the mesh's outside lies on where no CAD tells of it: a sphere, a
/// cylinder or a cone through its nodes, or else its own facets.
class OwnSurface {
 public:
  /// Finds the surface of some facets: an analytic one that all their corners lie on within
  /// `tolerance` (millimetres), or the facets themselves.
  OwnSurface(const SurfaceMesh& surface, const std::vector<FacetId>& facets, double tolerance);

  struct Foot {
    Eigen::Vector3d point;  ///< on the surface, millimetres
    Eigen::Matrix3d slope;  ///< its derivative by the place it was sought from
  };

  /// The point of the surface that is nearest to `x`. On facets: near the one that a walk from
  /// `node` (a row of the surface mesh) comes to downhill, that which `x` lies over along the
  /// normals interpolated between their nodes, so that no stretch before an edge falls onto it;
  /// beyond their border the surface goes on as a quadric. For any number of threads at once.
  Foot foot(const Eigen::Vector3d& x, RowId node) const;

  /// "sphere", "cylinder", "cone" or "facets".
  std::string kind() const;

 private:
  struct Sphere {
    Eigen::Vector3d centre;
    double radius;
  };
  /// Radius and its growth along the axis.
  struct Cone {
    Eigen::Vector3d origin, axis;
    double radius, growth;
  };
  /// Triangles of the facets, and those at each node.
  struct Facets {
    std::optional<Foot> over(int triangle, const Eigen::Vector3d& x) const;
    std::vector<RowId> around(const Eigen::Vector3d& from, const Eigen::Vector3d& normal,
                              double distance) const;
    Foot beyond(int triangle, const Eigen::Vector3d& weights, const Eigen::Vector3d& x) const;

    Points points, normals;
    std::vector<std::array<RowId, 3>> triangles;
    IdVector<RowId, std::vector<int>> at_node;
    std::vector<RowId> nodes;            // corners
    std::shared_ptr<const KdTree> tree;  // of these
  };

  static Foot foot_on(const Sphere& sphere, const Eigen::Vector3d& x, RowId node);
  static Foot foot_on(const Cone& cone, const Eigen::Vector3d& x, RowId node);
  static Foot foot_on(const Facets& facets, const Eigen::Vector3d& x, RowId node);

  std::variant<Sphere, Cone, Facets> form_;
};

}  // namespace cadmorph
