#pragma once

#include <string>
#include <vector>

#include "cad/brep.h"
#include "cad/topology_match.h"
#include "core/boundary.h"
#include "core/mesh.h"
#include "surface/association.h"
#include "surface/joints.h"

// What to tell users of a surface's morph: a line each.

namespace cadmorph {

/// A face's numbers in both models, from 1, and its type.
std::string name_of(const CadModel& base, const TopologyMatch& match, FaceId face);

std::string describe_strays(const Mesh& mesh, const Boundary& boundary, const Association& found);
std::string describe_stranded(const Mesh& mesh, const Boundary& boundary, const Association& found);

/// Of nodes that lie on one of two parts only, which met in the base.
std::string describe_parted_joints(const PartedJoints& parted);

/// Of nodes that went with the CAD and off a part that slides.
std::string describe_left_patches(const PartedJoints& left);

/// Of the first face between two solids that no facet of the mesh lies on; empty where there is
/// none.
std::string describe_face_off_mesh(const CadModel& base, const Association& association);

/// A line for each base face with folded facets.
std::vector<std::string> describe_folds(const CadModel& base, const TopologyMatch& match,
                                        const Association& association,
                                        const std::vector<FacetId>& folded);

/// A line for each base face with nodes beyond the wires of its variant.
std::vector<std::string> describe_beyond_wires(const CadModel& base, const TopologyMatch& match,
                                               const Association& association,
                                               const Eigen::VectorXd& beyond_wires);

}  // namespace cadmorph
