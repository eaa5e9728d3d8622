#pragma once

#include <string>
#include <utility>
#include <vector>

#include "surface/association.h"
#include "surface/group_constraints.h"
#include "surface/image_pairs.h"

namespace cadmorph {

/// Two named sides of a mesh that are a period apart: by a translation or a rotation.
struct PeriodicSides {
  std::string first, second;      ///< names of groups
  ImagePair pair;                 ///< all nodes of the first side, and their images
  std::vector<double> tolerance;  ///< of each image's place, millimetres
  std::vector<char> is_given;     ///< images that the CAD, or what holds them, has a place for
  Eigen::Vector3d normal;         ///< of a mesh in a plane; else zero
  bool is_by_file = false;        ///< the mesh file says that they are a pair; nobody asked for it
};

/// A mesh and where its surface lies on the CAD.
struct MeshOnCad {
  const Mesh& mesh;
  const Boundary& boundary;
  const SurfaceMesh& surface;
  const Association& association;
  const IdVector<RowId, char>& is_held;  ///< nodes that something else than the CAD has a place for
};

/// Finds by the nodes the translation or rotation that carries one named side onto the other: every
/// node of the first (of those on the mesh's surface) to one of its own of the second, within 1e-6
/// of the extent or a hundredth of the shortest mesh edge there. Where several do, as in regular
/// meshes, those count that leave the inside of the mesh on opposite sides, of these a translation,
/// else the least turn. Throws InvalidInputError for a name that no group has, a side without
/// nodes, sides that are no images of each other, and nodes that follow the volume.
std::vector<PeriodicSides> find_periodic_sides(
    const MeshOnCad& on_cad, const std::vector<std::pair<std::string, std::string>>& names);

/// Finds those that the mesh file says are pairs (NodeGroup::partner), where no group of a pair is
/// held, rigid, following or paired by `constraints`. What is none is left as it is: a line in
/// `remarks` says why.
std::vector<PeriodicSides> find_sides_of_file(const MeshOnCad& on_cad,
                                              const GroupConstraints& constraints,
                                              std::vector<std::string>& remarks);

/// The pair with the period that the sides have at `moved` (all surface nodes, millimetres): that
/// of before, or where the CAD's corners on both sides (else its edges, else its faces) went apart
/// otherwise, the one that fits these best.
ImagePair with_period_at(const PeriodicSides& sides, const SurfaceMesh& surface,
                         const Association& association, const Points& moved);

/// Puts the nodes of the second side where the first's say. Where one that is given has another
/// place: throws InvalidInputError; of sides that only the file pairs, returns what is wrong, and
/// moves nothing.
std::string place_second_side(const PeriodicSides& sides, const ImagePair& pair,
                              const SurfaceMesh& surface, Points& moved);

/// What the period is: "turned by 30 degrees about ...".
std::string describe(const PeriodicSides& sides, const ImagePair& pair);

}  // namespace cadmorph
