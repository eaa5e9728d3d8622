#include "core/formats/periodic_links.h"

#include <algorithm>
#include <map>

#include "core/cell_topology.h"

namespace cadmorph {
namespace {

// Some files link corners alone.
std::vector<char> corner_marks(const Mesh& mesh) {
  std::vector<char> is_corner(std::size_t(mesh.node_count()), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const CellInfo& info = info_of(mesh.types[c]);
    const auto nodes = mesh.cell(c);
    for (const Index n : info.corners > 0 ? nodes.first(std::size_t(info.corners)) : nodes)
      is_corner[n] = 1;
  }
  return is_corner;
}

void tidy(std::vector<Index>& nodes) {
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
}

}  // namespace

void set_partners(const std::vector<PeriodicLink>& links, Mesh& mesh) {
  if (links.empty()) return;
  const std::vector<char> is_corner = corner_marks(mesh);
  const auto corners = [&](auto nodes) {
    std::erase_if(nodes, [&](Index n) { return !is_corner[n]; });
    tidy(nodes);
    return nodes;
  };
  std::vector<std::pair<std::vector<Index>, std::vector<Index>>> sides;
  for (const PeriodicLink& link : links) {
    std::vector<Index> from, to;
    for (const auto& [node, image] : link) {
      from.push_back(node);
      to.push_back(image);
    }
    sides.emplace_back(corners(std::move(from)), corners(std::move(to)));
  }
  std::map<std::vector<Index>, const NodeGroup*> groups;
  for (const NodeGroup& group : mesh.groups) groups.try_emplace(corners(group.nodes), &group);
  for (NodeGroup& group : mesh.groups) {
    const std::vector<Index> own = corners(group.nodes);
    std::vector<Index> linked, images;
    for (const auto& [from, to] : sides)
      if (!from.empty() && std::ranges::includes(own, from)) {
        linked.insert(linked.end(), from.begin(), from.end());
        images.insert(images.end(), to.begin(), to.end());
      }
    tidy(linked);
    if (linked.empty() || linked != own) continue;
    tidy(images);
    if (const auto other = groups.find(images); other != groups.end() && other->second != &group)
      group.partner = other->second->name;
  }
}

}  // namespace cadmorph
