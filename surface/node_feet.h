#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "cad/brep.h"
#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "surface/spaced_samples.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// A node off the CAD may go to a curve within this distance, in units of its shortest mesh edge:
/// farther off, the node beside it may be the curve's.
inline constexpr double kVotedCurve = 0.5;

/// A node belongs to a corner or curve when it is nearer than this part of its shortest mesh edge:
/// far above the digits that exchange formats cut, far below any mesh size.
inline constexpr double kOnEntity = 1e-3;

/// A face that a node may lie on.
struct FaceCandidate {
  FaceId face;
  Eigen::Vector2d uv;
  double distance;  ///< to the surface, which may reach beyond the wires; millimetres
  double gap;       ///< to the trimmed face
};

/// What is near a node.
struct NodeFeet {
  std::vector<FaceCandidate> faces;  ///< nearest first
  std::vector<EdgeFoot> edges;       ///< physical edges, nearest first
};

/// Projects the nodes of a surface mesh onto the faces and edges near them: dense samples in
/// kd-trees give seeds, Newton steps the feet. Both model and mesh must outlive it.
class FootFinder {
 public:
  /// `tolerance`: largest distance from a face, in units of a node's shortest mesh edge; of a
  /// mid-side node's own.
  FootFinder(const CadModel& model, const SurfaceMesh& surface, double tolerance);

  /// Faces and edges near a node. Thread-safe.
  NodeFeet find(RowId node) const { return find(node, reach(node)); }
  /// The same with the largest distance from a face in millimetres.
  NodeFeet find(RowId node, double reach) const;

  /// Parameters on `face` of a point near x: of a sample within `radius` (and two spacings), else
  /// by a global search. Thread-safe.
  Eigen::Vector2d seed(FaceId face, const Eigen::Vector3d& x, double radius) const;

  /// Largest distance of a node from a curve that it may go to, millimetres.
  double edge_reach(RowId node) const { return edge_reach(node, reach(node)); }

 private:
  void spread_faces();
  void sample_edges();
  double reach(RowId node) const { return tolerance_ * surface_.own_length[node]; }
  double edge_reach(RowId node, double reach) const {
    return std::max(reach, kVotedCurve * surface_.local_length[node]);
  }
  void find_edge_feet(const Eigen::Vector3d& x, double reach, NodeFeet& feet) const;
  void drop_outside(double edge_reach, NodeFeet& feet) const;

  const CadModel& model_;
  const SurfaceMesh& surface_;
  double tolerance_;
  FaceSamples faces_;
  SpacedSamples near_faces_, near_edges_;
  RowMatrix edge_points_;                              // samples
  std::vector<std::pair<EdgeId, double>> edge_seeds_;  // edge and parameter of each
};

}  // namespace cadmorph
