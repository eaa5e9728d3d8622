#include "surface/group_constraints.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numbers>
#include <set>
#include <sstream>
#include <utility>

#include "core/errors.h"
#include "core/kd_tree.h"
#include "surface/image_pairs.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

std::string list_groups(const Mesh& mesh) {
  if (mesh.groups.empty()) return "the mesh has no named groups";
  std::string names;
  for (const NodeGroup& group : mesh.groups) names += (names.empty() ? "" : ", ") + group.name;
  return "the mesh has " + names;
}

std::vector<Index> nodes_of(const Mesh& mesh, const std::string& name) {
  std::vector<Index> nodes;
  for (const NodeGroup& group : mesh.groups)
    if (group.name == name) nodes.insert(nodes.end(), group.nodes.begin(), group.nodes.end());
  return nodes;
}

void check_name(const Mesh& mesh, const std::string& name) {
  if (std::ranges::find(mesh.groups, name, &NodeGroup::name) == mesh.groups.end())
    throw InvalidInputError("no group of the mesh is named '" + name + "'; " + list_groups(mesh));
}

void mark(const Mesh& mesh, const std::vector<std::string>& names, GroupConstraint constraint,
          std::vector<GroupConstraint>& of_node) {
  for (const std::string& name : names) {
    check_name(mesh, name);
    for (const Index node : nodes_of(mesh, name))
      of_node[static_cast<std::size_t>(node)] = constraint;
  }
}

// A group can't be told to do two things.
void refuse_doubles(const GroupConstraints& constraints) {
  std::vector<std::string> all;
  for (const auto* names :
       {&constraints.held, &constraints.rigid, &constraints.sliding, &constraints.following}) {
    const std::set<std::string> once(names->begin(), names->end());
    all.insert(all.end(), once.begin(), once.end());
  }
  std::ranges::sort(all);
  if (const auto twice = std::ranges::adjacent_find(all); twice != all.end())
    throw InvalidInputError("the group '" + *twice + "' of the mesh is to do two things at once");
}

// Nodes of the facets on the CAD, by pieces that hang together.
std::vector<std::vector<RowId>> parts_on_cad(const SurfaceMesh& surface,
                                             const Association& association) {
  std::vector<std::vector<RowId>> parts;
  IdVector<FacetId, char> is_seen(surface.facets.size(), 0);
  for (const FacetId seed : surface.facets.ids()) {
    std::vector<FacetId> facets;
    const auto take = [&](FacetId f) {
      if (association.facet_face[f] >= 0 && !std::exchange(is_seen[f], 1)) facets.push_back(f);
    };
    take(seed);
    if (facets.empty()) continue;
    std::vector<RowId> nodes;
    for (std::size_t k = 0; k < facets.size(); ++k)
      for (const RowId n : surface.facets[facets[k]]) {
        nodes.push_back(n);
        std::ranges::for_each(surface.facets_at(n), take);
      }
    std::ranges::sort(nodes);
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    parts.push_back(std::move(nodes));
  }
  return parts;
}

// Nodes that are corners of solid cells.
std::vector<char> mark_corners(const Mesh& mesh) {
  std::vector<char> is_corner(static_cast<std::size_t>(mesh.node_count()), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 3) continue;
    const auto nodes = mesh.cell(c);
    for (const Index node :
         nodes.first(static_cast<std::size_t>(corner_count(mesh.types[c], std::ssize(nodes)))))
      is_corner[node] = 1;
  }
  return is_corner;
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

void take_from_cad(RowId row, Association& association) {
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
  association.distance[row] = 0;
}

std::string describe(const RigidGroup& group, const Isometry& motion, const SurfaceMesh& surface,
                     const Points& moved) {
  const Eigen::IOFormat inline_format(6, Eigen::DontAlignCols, " ", " ");
  const Vector3d centre = surface.points(group.nodes, Eigen::all).colwise().mean();
  std::ostringstream text;
  text.precision(6);
  text << "the group '" << group.name << "' moves as the part of the surface near "
       << surface.points.row(group.nearest).format(inline_format) << " mm does: turned by "
       << Eigen::AngleAxisd(motion.linear).angle() * 180 / std::numbers::pi
       << " degrees, its centre shifted by " << (motion(centre) - centre).norm() << " mm";
  double most = 0;
  for (const RowId n : group.part)
    most = std::max(most,
                    (moved.row(n).transpose() - motion(surface.points.row(n).transpose())).norm());
  text << "; the part itself leaves that motion by up to " << most << " mm";
  return text.str();
}

}  // namespace

bool is_taken_from_cad(GroupConstraint constraint) {
  return constraint == GroupConstraint::Hold || constraint == GroupConstraint::Rigid;
}

IdVector<RowId, GroupConstraint> find_constraints(const Mesh& mesh, const Boundary& boundary,
                                                  const GroupConstraints& constraints) {
  std::vector<GroupConstraint> of_node(static_cast<std::size_t>(mesh.node_count()),
                                       GroupConstraint::None);
  refuse_doubles(constraints);
  // The strongest last: it has the nodes that groups share.
  mark(mesh, constraints.following, GroupConstraint::Follow, of_node);
  mark(mesh, constraints.sliding, GroupConstraint::Slide, of_node);
  mark(mesh, constraints.rigid, GroupConstraint::Rigid, of_node);
  mark(mesh, constraints.held, GroupConstraint::Hold, of_node);
  IdVector<RowId, GroupConstraint> result;
  for (const Index node : boundary.nodes) result.push_back(of_node[static_cast<std::size_t>(node)]);
  return result;
}

std::vector<Index> named_nodes(const Mesh& mesh, const GroupConstraints& constraints) {
  std::vector<Index> result;
  const auto add = [&](const std::string& name) {
    check_name(mesh, name);
    const std::vector<Index> nodes = nodes_of(mesh, name);
    result.insert(result.end(), nodes.begin(), nodes.end());
  };
  for (const auto* names :
       {&constraints.held, &constraints.rigid, &constraints.sliding, &constraints.following})
    std::ranges::for_each(*names, add);
  for (const auto& [first, second] : constraints.periodic) add(first), add(second);
  std::ranges::sort(result);
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

std::vector<RowId> rows_of_group(const Mesh& mesh, const Boundary& boundary,
                                 const std::string& name) {
  check_name(mesh, name);
  std::vector<RowId> rows;
  for (const Index node : nodes_of(mesh, name))
    if (std::ranges::binary_search(boundary.nodes, node)) rows.push_back(row_of(boundary, node));
  std::ranges::sort(rows);
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

void apply_constraints(const IdVector<RowId, GroupConstraint>& constraints,
                       const Boundary& boundary, Association& association) {
  for (const RowId row : constraints.ids()) {
    const bool is_on_cad = association.dimension[row] != CadDimension::None;
    if (is_taken_from_cad(constraints[row])) take_from_cad(row, association);
    if (is_on_cad || association.is_amid[row]) continue;
    if (constraints[row] == GroupConstraint::Follow && !association.is_free[row]) {
      association.is_free[row] = 1;
      --association.unmatched_nodes;
    } else if (constraints[row] == GroupConstraint::Slide && association.is_free[row]) {
      association.is_free[row] = 0;
      ++association.unmatched_nodes;
    }
  }
  for (const FacetId f : association.facet_face.ids()) {
    const auto is_taken = [&](Index node) {
      return is_taken_from_cad(constraints[row_of(boundary, node)]);
    };
    if (association.facet_face[f] < 0 || std::ranges::none_of(boundary.facet(f), is_taken))
      continue;
    association.held_faces.push_back(std::exchange(association.facet_face[f], FaceId()));
  }
  std::ranges::sort(association.held_faces);
  const auto doubled = std::ranges::unique(association.held_faces);
  association.held_faces.erase(doubled.begin(), doubled.end());
}

std::vector<char> mark_parts_inside(const Mesh& mesh, const Boundary& boundary,
                                    const GroupConstraints& constraints) {
  std::vector<char> marks;
  for (const std::string& name : constraints.prescribed()) {
    check_name(mesh, name);
    const std::vector<Index> nodes = nodes_of(mesh, name);
    if (std::ranges::all_of(
            nodes, [&](Index node) { return std::ranges::binary_search(boundary.nodes, node); }))
      continue;
    marks.resize(static_cast<std::size_t>(mesh.node_count()), 0);
    for (const Index node : nodes) marks[static_cast<std::size_t>(node)] = 1;
  }
  return marks;
}

void require_groups_on_boundary(const Mesh& mesh, const Boundary& boundary,
                                const GroupConstraints& constraints) {
  for (const std::string& name : constraints.prescribed())
    if (rows_of_group(mesh, boundary, name).empty())
      throw InvalidInputError("the group '" + name +
                              "' lies inside of the mesh and has no face of a cell, but single "
                              "nodes or lines. What lies inside can be held, moved or slid only as "
                              "a surface or a zone; these nodes follow the volume without it");
}

BodiesInGroups find_bodies_in_rigid_groups(const Mesh& mesh, const Boundary& boundary,
                                           const SurfaceMesh& surface,
                                           const std::vector<std::string>& names,
                                           const Association& association) {
  BodiesInGroups result;
  if (names.empty()) return result;
  const std::vector<std::vector<RowId>> parts = parts_on_cad(surface, association);
  for (const std::string& name : names) {
    const std::vector<RowId> rows = rows_of_group(mesh, boundary, name);
    std::vector<RowId>& bodies = result[name];
    for (const std::vector<RowId>& part : parts)
      if (std::ranges::includes(rows, part)) bodies.insert(bodies.end(), part.begin(), part.end());
    std::ranges::sort(bodies);
    const auto on_cad = std::ranges::count_if(
        rows, [&](RowId row) { return association.dimension[row] != CadDimension::None; });
    if (bodies.size() == rows.size() || (bodies.empty() && 2 * on_cad > std::ssize(rows)))
      throw InvalidInputError("the group '" + name +
                              "' lies on the CAD, which moves it: only what the CAD does not tell "
                              "of, as the interface round a rotor, can move with the part nearest "
                              "to it. Leave it out: a part that only turns or shifts keeps its "
                              "shape");
  }
  return result;
}

std::vector<std::string> describe_idle_groups(const Mesh& mesh, const Boundary& boundary,
                                              const GroupConstraints& constraints,
                                              const Association& association,
                                              const std::vector<FreePatch>& patches) {
  std::vector<std::string> lines;
  const auto describe = [&](const std::string& name, const char* what, const std::string& but) {
    lines.push_back("the group '" + name + "' is to " + what + ", but " + but);
  };
  const auto is_all = [&](const std::vector<RowId>& rows, const auto& is) {
    return !rows.empty() && std::ranges::all_of(rows, is);
  };
  const auto is_on_cad = [&](RowId row) {
    return association.dimension[row] != CadDimension::None || association.is_amid[row];
  };
  constexpr const char* kOnCad =
      "all of its nodes lie on the CAD, which moves them: that changes nothing";
  for (const std::string& name : constraints.following)
    if (is_all(rows_of_group(mesh, boundary, name), is_on_cad))
      describe(name, "follow the volume", kOnCad);
  // Patches that slide are moved by what touches them.
  IdVector<RowId, char> is_moved(association.dimension.size(), 0);
  for (const FreePatch& patch : patches)  // what it shares with others tells nothing of it
    if (!patch.touched.empty())
      for (const RowId n : patch.inner.empty() ? patch.border : patch.inner) is_moved[n] = 1;
  for (const std::string& name : constraints.sliding) {
    const std::vector<RowId> rows = rows_of_group(mesh, boundary, name);
    if (is_all(rows, is_on_cad))
      describe(name, "slide", kOnCad);
    else if (is_all(rows, [&](RowId n) { return !is_moved[n]; }))
      describe(name, "slide", "nothing that lies on the CAD touches it: it stays as it is");
  }
  if (constraints.prescribed().empty()) return lines;
  const std::vector<char> is_corner = mark_corners(mesh);
  for (const auto& [names, what] : {std::pair{&constraints.held, "stay"},
                                    {&constraints.rigid, "move as one piece"},
                                    {&constraints.sliding, "slide"}})
    for (const std::string& name : *names) {
      const auto left = std::ranges::count_if(nodes_of(mesh, name), [&](Index node) {
        return is_corner[node] && !std::ranges::binary_search(boundary.nodes, node);
      });
      if (left > 0)
        describe(name, what,
                 std::to_string(left) +
                     " of its nodes lie inside of the mesh on no face of a cell whose corners are "
                     "all in the group: they follow the volume");
    }
  return lines;
}

PatchMarks mark_patches(const Mesh& mesh, const Boundary& boundary,
                        const GroupConstraints& constraints,
                        const IdVector<RowId, GroupConstraint>& of_row) {
  PatchMarks marks;
  for (const GroupConstraint constraint : of_row)
    marks.is_moved.push_back(constraint == GroupConstraint::Rigid);
  marks.is_inner.assign(static_cast<std::size_t>(boundary.facet_count()), 0);
  marks.group.assign(static_cast<std::size_t>(boundary.facet_count()), -1);
  int id = 0;
  for (const auto* names : {&constraints.sliding, &constraints.rigid, &constraints.held})
    for (const std::string& name : *names) {
      std::vector<char> is_in(static_cast<std::size_t>(mesh.node_count()), 0);
      for (const Index node : nodes_of(mesh, name)) is_in[static_cast<std::size_t>(node)] = 1;
      for (const FacetId f : marks.group.ids())
        if (std::ranges::all_of(boundary.facet(f), [&](Index node) { return is_in[node]; })) {
          marks.group[f] = id;
          marks.is_inner[f] |= names == &constraints.sliding && boundary.neighbour[f] >= 0;
        }
      ++id;
    }
  return marks;
}

std::vector<RigidGroup> find_rigid_groups(const Mesh& mesh, const Boundary& boundary,
                                          const SurfaceMesh& surface,
                                          const Association& association,
                                          const std::vector<std::string>& names,
                                          const BodiesInGroups& bodies) {
  if (names.empty()) return {};
  const std::vector<std::vector<RowId>> parts = parts_on_cad(surface, association);
  if (parts.empty())
    throw InvalidInputError(
        "group '" + names.front() +
        "' is to move with the nearest part, but no surface of the mesh lies on "
        "the CAD that is not held or rigid itself");
  std::vector<RowId> nodes;
  std::vector<int> part_of;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    nodes.insert(nodes.end(), parts[p].begin(), parts[p].end());
    part_of.insert(part_of.end(), parts[p].size(), static_cast<int>(p));
  }
  const KdTree tree(surface.points(nodes, Eigen::all));
  std::vector<RigidGroup> result;
  for (const std::string& name : names) {
    RigidGroup group{
        .name = name, .nodes = rows_of_group(mesh, boundary, name), .part = {}, .nearest = {}};
    if (const std::vector<RowId>& inside = bodies.at(name); !inside.empty()) {
      std::erase_if(group.nodes,
                    [&](RowId row) { return std::ranges::binary_search(inside, row); });
      group.part = inside;
      group.nearest = inside.front();
      result.push_back(std::move(group));
      continue;
    }
    Neighbour nearest{0, std::numeric_limits<double>::infinity()};
    for (const RowId row : group.nodes) {
      const Vector3d x = surface.points.row(row);
      const Neighbour near = tree.nearest(x.data(), 1).front();
      if (near.squared_distance < nearest.squared_distance) nearest = near;
    }
    group.part = parts[part_of[nearest.index]];
    group.nearest = nodes[nearest.index];
    result.push_back(std::move(group));
  }
  return result;
}

std::vector<std::string> move_rigid_groups(const SurfaceMesh& surface,
                                           const std::vector<RigidGroup>& groups, Points& moved) {
  std::vector<std::string> lines;
  for (const RigidGroup& group : groups) {
    const Isometry motion =
        fit_motion(surface.points(group.part, Eigen::all), moved(group.part, Eigen::all));
    for (const RowId n : group.nodes) moved.row(n) = motion(surface.points.row(n));
    lines.push_back(describe(group, motion, surface, moved));
  }
  return lines;
}

}  // namespace cadmorph
