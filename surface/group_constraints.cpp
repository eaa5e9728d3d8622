#include "surface/group_constraints.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/errors.h"

namespace cadmorph {
namespace {

std::string list_groups(const Mesh& mesh) {
  if (mesh.groups.empty()) return "the mesh has no named groups";
  std::string names;
  for (const NodeGroup& group : mesh.groups) names += (names.empty() ? "" : ", ") + group.name;
  return "the mesh has " + names;
}

void mark(const Mesh& mesh, const std::string& name, GroupConstraint constraint,
          std::vector<GroupConstraint>& of_node) {
  bool is_found = false;
  for (const NodeGroup& group : mesh.groups) {
    if (group.name != name) continue;
    is_found = true;
    for (const Index node : group.nodes) {
      GroupConstraint& known = of_node[static_cast<std::size_t>(node)];
      if (known == GroupConstraint::Hold || known == constraint) continue;
      if (known != GroupConstraint::None)
        throw InvalidInputError("node " + std::to_string(node) + " of the group '" + name +
                                "' is in another group that is to do something else");
      known = constraint;
    }
  }
  if (!is_found)
    throw InvalidInputError("no group of the mesh is named '" + name + "'; " + list_groups(mesh));
}

Index& count_of(CadDimension dimension, Association& association) {
  switch (dimension) {
    case CadDimension::Vertex:
      return association.vertex_nodes;
    case CadDimension::Edge:
      return association.edge_nodes;
    case CadDimension::Face:
      return association.face_nodes;
    case CadDimension::None:
      break;
  }
  return association.unmatched_nodes;
}

void take_from_cad(std::size_t row, Association& association) {
  if (association.is_free[row]) {
    association.is_free[row] = 0;
  } else if (association.is_amid[row]) {
    association.is_amid[row] = 0;
    --association.amid_nodes;
  } else {
    --count_of(association.dimension[row], association);
  }
  ++association.unmatched_nodes;
  association.dimension[row] = CadDimension::None;
  association.entity[row] = -1;
  association.distance[static_cast<Index>(row)] = 0;
}

}  // namespace

std::vector<GroupConstraint> find_constraints(const Mesh& mesh, const Boundary& boundary,
                                              const GroupConstraints& constraints) {
  std::vector<GroupConstraint> of_node(static_cast<std::size_t>(mesh.node_count()),
                                       GroupConstraint::None);
  for (const std::string& name : constraints.held) mark(mesh, name, GroupConstraint::Hold, of_node);
  for (const std::string& name : constraints.sliding)
    mark(mesh, name, GroupConstraint::Slide, of_node);
  for (const std::string& name : constraints.following)
    mark(mesh, name, GroupConstraint::Follow, of_node);
  std::vector<GroupConstraint> result;
  for (const Index node : boundary.nodes) result.push_back(of_node[static_cast<std::size_t>(node)]);
  return result;
}

void apply_constraints(const std::vector<GroupConstraint>& constraints, const Boundary& boundary,
                       Association& association) {
  for (std::size_t row = 0; row < constraints.size(); ++row) {
    const bool is_on_cad = association.dimension[row] != CadDimension::None;
    if (constraints[row] == GroupConstraint::Hold) take_from_cad(row, association);
    if (constraints[row] != GroupConstraint::Follow || is_on_cad || association.is_free[row] ||
        association.is_amid[row])
      continue;
    association.is_free[row] = 1;
    --association.unmatched_nodes;
  }
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    const auto is_held = [&](Index node) {
      const auto place = std::ranges::lower_bound(boundary.nodes, node);
      return constraints[static_cast<std::size_t>(place - boundary.nodes.begin())] ==
             GroupConstraint::Hold;
    };
    if (std::ranges::any_of(boundary.facet(f), is_held)) association.facet_face[f] = -1;
  }
}

}  // namespace cadmorph
