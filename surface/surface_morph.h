#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cad/brep.h"
#include "cad/topology_match.h"
#include "core/boundary.h"
#include "core/mesh.h"
#include "surface/association.h"
#include "surface/group_constraints.h"
#include "surface/image_pairs.h"
#include "surface/joints.h"
#include "surface/patch_slide.h"

namespace cadmorph {

/// What to do with the part of the mesh's outside that lies on no CAD face (far field, symmetry
/// plane).
enum class UnmatchedPolicy {
  Auto,   ///< planar patches slide where they touch moved surface, all else stays fixed
  Error,  ///< refuse
  Fix,    ///< keep in place
  Slide,  ///< slide along their own surface, planar or not
};

struct SurfaceMorphOptions {
  AssociationOptions association;
  /// Puts nodes exactly on the variant CAD instead of carrying their offset from the base CAD.
  bool snap = false;
  UnmatchedPolicy unmatched = UnmatchedPolicy::Auto;
  /// Of named parts of the mesh; goes before `unmatched`.
  GroupConstraints groups = {};
};

/// The surface of one variant. Rows follow Boundary::nodes.
struct SurfaceMorphResult {
  Points positions;              ///< new node positions, in the mesh's unit (free nodes: old)
  IdVector<RowId, int> entity;   ///< variant face or edge that a node on one is put on; else -1
  Parameters uv;                 ///< there: face (u, v), edge (t, 0)
  Eigen::VectorXd distance;      ///< to its variant entity, millimetres; 0 where there is none
  Eigen::VectorXd beyond_wires;  ///< the part of it along a face's surface beyond the face's wires
  PartedJoints parted;
  Index dragged_patches = 0;  ///< on no CAD face, that stay fixed though what moves touches them
  std::vector<ImagePair> images;  ///< sides that are images of each other
  std::vector<RowId> periodic;  ///< nodes of those that are named, ascending: no repair moves them
  std::vector<RowId> crossing;  ///< nodes on CAD entities that cross without an imprint, ascending
  std::vector<RowId> jointed;   ///< all on entities that meet without one (Joints), ascending
  std::vector<FacetId> folded_facets;  ///< by face
  std::vector<std::string> warnings;   ///< other remarks: a line each
  std::vector<std::string> notes;      ///< remarks that ask for nothing: a line each
  /// What faces took that would fold else, and the faces; nothing to do about.
  std::map<std::string, std::vector<std::string>> remedies;
};

/// Moves the surface nodes of a mesh from a base CAD model to its variants (Sieger et al. 2013,
/// sect. 4). Holds everything that depends on the base alone: association, sampled wires, and the
/// factorisations of the parameter warps.
class SurfaceMorph {
 public:
  /// Associates the mesh's surface with the base CAD. Throws AssociationError when it does not lie
  /// on it.
  SurfaceMorph(const std::shared_ptr<const CadModel>& base, const Mesh& mesh,
               const Boundary& boundary, const SurfaceMorphOptions& options = {});

  /// With the association known: that of the same CAD, mesh and boundary.
  SurfaceMorph(std::shared_ptr<const CadModel> base, const Mesh& mesh, const Boundary& boundary,
               Association association, SurfaceMorphOptions options = {});
  ~SurfaceMorph();
  SurfaceMorph(SurfaceMorph&&) noexcept;
  SurfaceMorph& operator=(SurfaceMorph&&) noexcept;

  const Association& association() const;

  /// Computes the surface node positions on `variant`. `match` maps base to variant entities (see
  /// match_topology).
  SurfaceMorphResult morph(const CadModel& variant, const TopologyMatch& match) const;

  /// Those of `moved.folded_facets` and their faces' others that are folded where the nodes slid
  /// to since: `moved.uv` and `positions` (of all surface nodes, in the mesh's unit) are of there.
  std::vector<FacetId> folds_left(const CadModel& variant, const TopologyMatch& match,
                                  const SurfaceMorphResult& moved, const Points& positions) const;

  /// Moves the nodes on patches that slide with the others: `positions` of all surface nodes, in
  /// the mesh's unit.
  Points slide(const Points& positions) const;

  /// The inner nodes of each patch on no CAD face that slides.
  std::vector<std::vector<RowId>> nodes_of_sliding_patches() const;

  /// `to` with these nodes at the places of their patches nearest to it, as far off these as at
  /// `from`. Positions of all surface nodes, in the mesh's unit.
  Points onto_sliding_patches(const Points& from, const Points& to) const;

  /// The derivative of `slide` at these positions.
  SlideDerivative slide_derivative(const Points& positions) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
