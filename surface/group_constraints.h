#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/boundary.h"
#include "core/mesh.h"
#include "surface/association.h"
#include "surface/free_patches.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// What parts of the surface do that the mesh file names (see Mesh::groups); the names of groups.
struct GroupConstraints {
  std::vector<std::string> held;       ///< all nodes stay, those on the CAD, too
  std::vector<std::string> rigid;      ///< all nodes move as one piece with the nearest part
  std::vector<std::string> sliding;    ///< nodes on no CAD face slide along their own surface
  std::vector<std::string> following;  ///< nodes on no CAD face follow the volume
  /// Two sides that are a period apart: the second moves as the first does, turned with it.
  std::vector<std::pair<std::string, std::string>> periodic;

  /// The groups whose nodes the surface prescribes, on the CAD or not.
  std::vector<std::string> prescribed() const {
    std::vector<std::string> names = held;
    names.insert(names.end(), rigid.begin(), rigid.end());
    names.insert(names.end(), sliding.begin(), sliding.end());
    return names;
  }
  bool is_empty() const {
    return held.empty() && rigid.empty() && sliding.empty() && following.empty() &&
           periodic.empty();
  }
};

enum class GroupConstraint : std::int8_t { None, Hold, Rigid, Slide, Follow };

/// Whether nodes with this constraint don't go with the CAD that they may lie on.
bool is_taken_from_cad(GroupConstraint constraint);

/// The constraint of each boundary node (rows as Boundary::nodes). Where groups share a node the
/// first that counts is: held, rigid, sliding, following. Throws InvalidInputError for a name that
/// no group has (it lists those there are), and for one that is to do two things.
IdVector<RowId, GroupConstraint> find_constraints(const Mesh& mesh, const Boundary& boundary,
                                                  const GroupConstraints& constraints);

/// The nodes of all groups that are named, ascending. Throws InvalidInputError for a name that no
/// group has.
std::vector<Index> named_nodes(const Mesh& mesh, const GroupConstraints& constraints);

/// The boundary nodes (rows, ascending) of the groups of this name. Throws InvalidInputError for a
/// name that no group has (it lists those there are).
std::vector<RowId> rows_of_group(const Mesh& mesh, const Boundary& boundary,
                                 const std::string& name);

/// Takes held and rigid nodes from the CAD, and marks following ones that are on no CAD face as
/// free, sliding ones as not free. Again applied, it changes nothing.
void apply_constraints(const IdVector<RowId, GroupConstraint>& constraints,
                       const Boundary& boundary, Association& association);

/// Marks the nodes of the groups that are to be held, rigid or to slide and have nodes inside of
/// the mesh, off its `boundary`; empty where there are none. See extract_boundary. Throws
/// InvalidInputError for a name that no group has.
std::vector<char> mark_parts_inside(const Mesh& mesh, const Boundary& boundary,
                                    const GroupConstraints& constraints);

/// Throws InvalidInputError for a group that is to be held, rigid or to slide but has no node on
/// the boundary: single nodes and lines inside of the mesh.
void require_groups_on_boundary(const Mesh& mesh, const Boundary& boundary,
                                const GroupConstraints& constraints);

/// Ascending, by the name of the group.
using BodiesInGroups = std::map<std::string, std::vector<RowId>>;

/// The nodes of bodies within each group that is to move as
/// one piece: of the pieces of the mesh's surface that lie on the CAD and hang together, those that
/// lie in the group whole, as a propeller does in its zone. The CAD moves these, and the rest of
/// the group with them. Throws InvalidInputError for a group that lies on the CAD for the most part
/// else: the CAD moves it. `association`: without the constraints.
BodiesInGroups find_bodies_in_rigid_groups(const Mesh& mesh, const Boundary& boundary,
                                           const SurfaceMesh& surface,
                                           const std::vector<std::string>& names,
                                           const Association& association);

/// A line for each group that does not do what it is to, or not with all of its nodes: they lie on
/// the CAD, which moves them, or nothing touches it, or some lie inside on no face of the group.
/// `association`: with the constraints applied.
std::vector<std::string> describe_idle_groups(const Mesh& mesh, const Boundary& boundary,
                                              const GroupConstraints& constraints,
                                              const Association& association,
                                              const std::vector<FreePatch>& patches);

/// Where the groups cut the surface into patches of their own, and which nodes move rigidly.
PatchMarks mark_patches(const Mesh& mesh, const Boundary& boundary,
                        const GroupConstraints& constraints,
                        const IdVector<RowId, GroupConstraint>& of_row);

/// Nodes that move as one piece, and those of the part of the CAD's surface that they go with.
struct RigidGroup {
  std::string name;
  std::vector<RowId> nodes, part;
  RowId nearest;  ///< the part's node that is nearest to the group
};

/// A group's part: the bodies in it, or of the pieces of the mesh's surface that lie on the CAD and
/// hang together the one with the node nearest to one of the group's.
std::vector<RigidGroup> find_rigid_groups(const Mesh& mesh, const Boundary& boundary,
                                          const SurfaceMesh& surface,
                                          const Association& association,
                                          const std::vector<std::string>& names,
                                          const BodiesInGroups& bodies);

/// Moves rigid groups by the turn and shift that fit their parts' motion best (least squares);
/// `moved`: all surface nodes, millimetres. Returns a line for each group: what it goes with, how,
/// and how far the part's own nodes leave that motion.
std::vector<std::string> move_rigid_groups(const SurfaceMesh& surface,
                                           const std::vector<RigidGroup>& groups, Points& moved);

}  // namespace cadmorph
