#include "volume/components.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <unordered_map>

namespace cadmorph {
namespace {

class DisjointSets {
 public:
  explicit DisjointSets(Index count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }

  Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

  void join(Index a, Index b) { parent_[find(a)] = find(b); }

 private:
  std::vector<Index> parent_;
};

// Joins cells that share a node: any node in the same region, a free one in different regions.
DisjointSets join_cells(const Mesh& mesh, const std::vector<char>& is_prescribed) {
  DisjointSets sets(mesh.cell_count());
  std::vector<Index> last_at(static_cast<std::size_t>(mesh.node_count()), -1);
  std::unordered_map<Index, std::map<int, Index>> last_in_region;  // of prescribed nodes, by region
  const bool has_regions = !mesh.regions.empty();
  const int top = dimension(mesh);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != top) continue;
    for (const Index n : mesh.cell(c)) {
      Index& last = has_regions && is_prescribed[n]
                        ? last_in_region[n].try_emplace(mesh.region(c), -1).first->second
                        : last_at[n];
      if (last >= 0) sets.join(c, last);
      last = c;
    }
  }
  return sets;
}

}  // namespace

std::vector<Component> split_components(const Mesh& mesh, const std::vector<Index>& surface_nodes) {
  std::vector<char> is_prescribed(static_cast<std::size_t>(mesh.node_count()), 0);
  std::vector<Index> position(static_cast<std::size_t>(mesh.node_count()), -1);
  for (std::size_t i = 0; i < surface_nodes.size(); ++i) {
    is_prescribed[surface_nodes[i]] = 1;
    position[surface_nodes[i]] = static_cast<Index>(i);
  }
  DisjointSets sets = join_cells(mesh, is_prescribed);
  const int top = dimension(mesh);
  std::map<Index, std::size_t> component_of;
  std::vector<Component> components(1);
  std::vector<Index> taken_by(static_cast<std::size_t>(mesh.node_count()), -1);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != top) continue;
    const auto [it, is_new] = component_of.try_emplace(sets.find(c), component_of.size());
    if (is_new && it->second == components.size()) components.emplace_back();
    for (const Index n : mesh.cell(c)) {
      const auto id = static_cast<Index>(it->second);
      if (taken_by[n] == id) continue;
      taken_by[n] = id;  // a free node lies in one component only
      if (is_prescribed[n])
        components[it->second].surface.push_back(position[n]);
      else
        components[it->second].volume.push_back(n);
    }
  }
  for (Index n = 0; n < mesh.node_count(); ++n)
    if (taken_by[n] < 0)
      (is_prescribed[n] ? components.front().surface : components.front().volume)
          .push_back(is_prescribed[n] ? position[n] : n);
  for (Component& component : components) {
    std::sort(component.surface.begin(), component.surface.end());
    const auto end = std::unique(component.surface.begin(), component.surface.end());
    component.surface.erase(end, component.surface.end());
  }
  return components;
}

}  // namespace cadmorph
