#pragma once

#include <vector>

#include "cad/brep.h"
#include "core/boundary.h"
#include "core/mesh.h"
#include "core/progress.h"
#include "surface/ids.h"

namespace cadmorph {

/// (u, v), a row each.
using Parameters = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

struct AssociationOptions {
  /// Largest distance of a surface node from the CAD, in units of its shortest incident mesh edge,
  /// of a mid-side node in units of its own. Nodes amid straight edges may be further off.
  double tolerance = 0.1;
  /// Millimetres per mesh unit; 0: detect (mm, m, cm, inch, foot).
  double mesh_unit_mm = 0;
  /// Nodes of the mesh that are known to be off the CAD or not to matter, ascending: nothing is
  /// refused for them alone.
  std::vector<Index> expected_off = {};
  bool expects_any_off = false;  ///< the same of all nodes
  bool takes_strays = true;      ///< see Association::stray_nodes, stranded
  Progress progress = {};
};

/// The kind of CAD entity a surface node lies on.
enum class CadDimension : std::int8_t { None = -1, Vertex = 0, Edge = 1, Face = 2 };

/// Where each surface node lies on the base CAD, and how well. Rows follow Boundary::nodes.
struct Association {
  IdVector<RowId, CadDimension> dimension;
  IdVector<RowId, int> entity;    ///< vertex, edge or face id of the base model; -1
  Parameters uv;                  ///< face: (u, v); edge: (t, 0)
  Eigen::VectorXd distance;       ///< to that entity, millimetres; 0 for unmatched nodes
  IdVector<RowId, char> is_free;  ///< on an interface that is not in the CAD: follows the volume
  IdVector<RowId, char> is_amid;  ///< off the CAD, in the middle of a straight edge or facet: stays
  IdVector<FacetId, FaceId> facet_face;  ///< CAD face of each boundary facet, -1
  Index vertex_nodes = 0, edge_nodes = 0, face_nodes = 0;
  Index unmatched_nodes = 0;  ///< on the outside but on no CAD face
  Index amid_nodes = 0;
  /// Of the nodes on an entity: farther off than the tolerance, few amid nodes that are not.
  Index stray_nodes = 0;
  RowId farthest_stray;
  /// Few on no entity amid others that are on one, in small clusters, as where a mesher bridged a
  /// gap: they follow the volume.
  std::vector<RowId> stranded;
  std::vector<FaceId> held_faces;  ///< whose facets are held, ascending: facet_face is -1 there
  double max_distance = 0;         ///< millimetres
  double mean_distance = 0;
  double mesh_unit_mm = 1;  ///< millimetres per mesh unit, given or detected

  /// The entity of a node that lies on one of that kind.
  VertexId vertex(RowId row) const { return VertexId(entity[row]); }
  EdgeId edge(RowId row) const { return EdgeId(entity[row]); }
  FaceId face(RowId row) const { return FaceId(entity[row]); }
  double t(RowId row) const { return uv.coeff(row, 0); }  ///< on its edge
  /// Of the nodes whose positions the surface morph prescribes to the volume: all that are not
  /// free.
  std::vector<RowId> prescribed_rows() const;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(dimension, entity, uv, distance, is_free, is_amid, facet_face, vertex_nodes, edge_nodes,
            face_nodes, unmatched_nodes, amid_nodes, stray_nodes, farthest_stray, stranded,
            held_faces, max_distance, mean_distance, mesh_unit_mm);
  }
};

/// Finds the CAD vertex, edge or face of each surface node and its parameters (Sieger et al. 2013,
/// sect. 4): dense samples of the faces give seeds, Newton steps the foot; nodes on a corner or a
/// curve to within its tolerance belong to it, facets vote for the rest. Few nodes farther off,
/// amid others that are not, belong to what is next to them. Throws AssociationError where the
/// unmatched outside can be no far field or symmetry plane (check_unmatched). Parallel; about 10 us
/// a node and core.
Association associate(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                      const AssociationOptions& options = {});

}  // namespace cadmorph
