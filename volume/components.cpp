#include "volume/components.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

namespace cadmorph {
namespace {

class DisjointSets {
 public:
  explicit DisjointSets(Index count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }

  Index add() {
    parent_.push_back(std::ssize(parent_));
    return parent_.back();
  }

  Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

  void join(Index a, Index b) {
    a = find(a);
    b = find(b);
    if (a != b) parent_[a] = b;
  }

 private:
  std::vector<Index> parent_;
};

// The nodes of all cells, joined where a cell has both. A prescribed node joins cells of one region
// only: it counts once a region.
class JoinedNodes {
 public:
  JoinedNodes(const Mesh& mesh, const std::vector<char>& is_prescribed)
      : mesh_(mesh), is_prescribed_(is_prescribed), sets_(mesh.node_count()) {
    if (!mesh.regions.empty()) first_region_.assign(std::size_t(mesh.node_count()), kNoRegion);
    const int top = dimension(mesh);
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      if (dimension(mesh.types[c]) != top) continue;
      const auto nodes = mesh.cell(c);
      const Index first = id(nodes[0], c);
      for (const Index n : nodes.subspan(1)) sets_.join(id(n, c), first);
    }
  }

  // What all nodes of joined cells share.
  Index set_of(Index cell) { return sets_.find(id(mesh_.cell(cell)[0], cell)); }

 private:
  static constexpr int kNoRegion = std::numeric_limits<int>::min();

  Index id(Index node, Index cell) {
    if (first_region_.empty() || !is_prescribed_[node]) return node;
    const int region = mesh_.region(cell);
    int& first = first_region_[node];
    if (first == kNoRegion) first = region;
    if (first == region) return node;
    const auto [found, is_new] = other_ids_.try_emplace({node, region});
    if (is_new) found->second = sets_.add();
    return found->second;
  }

  const Mesh& mesh_;
  const std::vector<char>& is_prescribed_;
  DisjointSets sets_;
  std::vector<int> first_region_;  ///< of each prescribed node
  std::map<std::pair<Index, int>, Index> other_ids_;
};

}  // namespace

std::vector<Component> split_components(const Mesh& mesh, const std::vector<Index>& surface_nodes) {
  std::vector<char> is_prescribed(static_cast<std::size_t>(mesh.node_count()), 0);
  std::vector<Index> position(static_cast<std::size_t>(mesh.node_count()), -1);
  for (std::size_t i = 0; i < surface_nodes.size(); ++i) {
    is_prescribed[surface_nodes[i]] = 1;
    position[surface_nodes[i]] = static_cast<Index>(i);
  }
  JoinedNodes joined(mesh, is_prescribed);
  const int top = dimension(mesh);
  std::map<Index, std::size_t> component_of;
  std::vector<Component> components(1);
  std::vector<Index> taken_by(static_cast<std::size_t>(mesh.node_count()), -1);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != top) continue;
    const auto [it, is_new] = component_of.try_emplace(joined.set_of(c), component_of.size());
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
