#pragma once

#include <vector>

#include "surface/association.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// Where parts of the CAD meet and no edge says so, as a rib on a plate, or a sheet through another
/// one, without an imprint: nodes that lie on entities of which none bounds the other.
struct Joints {
  /// A node within a face that moves with something else.
  struct OnFace {
    RowId node;
    Eigen::Vector2d uv;
  };
  /// A node on an edge, between its ends, that moves with something else.
  struct OnEdge {
    RowId node;
    EdgeId edge;
    double t;
  };
  /// A node where entities pass through each other; it stays on all of them.
  struct Crossing {
    RowId node;
    std::vector<FaceId> faces;
    std::vector<EdgeId> edges;
  };

  IdVector<FaceId, std::vector<OnFace>> of_face;  ///< by face; of very many, some spread evenly
  std::vector<OnEdge> on_edges;
  std::vector<Crossing> crossings;
  std::vector<RowId> nodes;  ///< of all of these, ascending
};

/// Joints that a variant parts: nodes that went off a face or an edge on which they lay.
struct PartedJoints {
  Index nodes = 0;
  double distance = 0;  ///< the largest, millimetres, of a node from what it left
};

/// The joints of a mesh on its base CAD, by the facets around each node. `surface` in millimetres;
/// rows as in `association`.
Joints find_joints(const CadModel& base, const SurfaceMesh& surface,
                   const Association& association);

}  // namespace cadmorph
