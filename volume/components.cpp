#include "volume/components.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "core/kd_tree.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

// Cells that a thread takes at a time.
constexpr Index kGrain = 16'384;

// Sets that all threads join at once; the least of its items stands for a set (Anderson, Woll
// 1991).
class DisjointSets {
 public:
  explicit DisjointSets(Index count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }

  Index find(Index i) {
    for (;;) {
      const Index parent = at(i).load(std::memory_order_relaxed);
      const Index grandparent = at(parent).load(std::memory_order_relaxed);
      if (parent == grandparent) return parent;
      at(i).store(grandparent, std::memory_order_relaxed);
      i = grandparent;
    }
  }

  void join(Index a, Index b) {
    for (;;) {
      a = find(a);
      b = find(b);
      if (a == b) return;
      if (a > b) std::swap(a, b);
      if (at(b).compare_exchange_strong(b, a, std::memory_order_relaxed)) return;
    }
  }

 private:
  std::atomic_ref<Index> at(Index i) { return std::atomic_ref<Index>(parent_[i]); }

  std::vector<Index> parent_;
};

// The nodes of all cells of the highest dimension. A prescribed node joins cells of one region
// only: it counts once a region.
class NodesOfRegions {
 public:
  NodesOfRegions(const Mesh& mesh, const std::vector<char>& is_prescribed)
      : mesh_(mesh), is_prescribed_(is_prescribed), count_(mesh.node_count()) {
    if (mesh.regions.empty()) return;
    first_region_.assign(std::size_t(mesh.node_count()), kNoRegion);
    for_cells(0, mesh.cell_count(), [&](Index c) {
      for (const Index n : mesh.cell(c)) {
        if (!is_prescribed[n]) continue;
        int& first = first_region_[n];
        if (first == kNoRegion) first = mesh.region(c);
        if (first != mesh.region(c) && other_ids_.try_emplace({n, mesh.region(c)}, count_).second)
          ++count_;
      }
    });
  }

  /// Ids of nodes: their own in their first region.
  Index count() const { return count_; }
  const std::map<std::pair<Index, int>, Index>& in_other_regions() const { return other_ids_; }

  DisjointSets joined_by_cells() const {
    DisjointSets sets(count_);
    parallel_for(mesh_.cell_count(), kGrain, [&](Index begin, Index end) {
      for_cells(begin, end, [&](Index c) {
        const auto nodes = mesh_.cell(c);
        const Index first = id(nodes[0], c);
        for (const Index n : nodes.subspan(1)) sets.join(id(n, c), first);
      });
    });
    return sets;
  }

 private:
  static constexpr int kNoRegion = std::numeric_limits<int>::min();

  template <class Visit>
  void for_cells(Index begin, Index end, Visit&& visit) const {
    for (Index c = begin; c < end; ++c)
      if (dimension(mesh_.types[c]) == top_) visit(c);
  }

  Index id(Index node, Index cell) const {
    if (first_region_.empty() || !is_prescribed_[node]) return node;
    const int region = mesh_.region(cell);
    return first_region_[node] == region ? node : other_ids_.at({node, region});
  }

  const Mesh& mesh_;
  const std::vector<char>& is_prescribed_;
  int top_ = dimension(mesh_);
  Index count_;
  std::vector<int> first_region_;  ///< of each prescribed node
  std::map<std::pair<Index, int>, Index> other_ids_;
};

// Joins free nodes of the surface with what lies at their places: the two sides of a crack, or of
// an interface between parts that share no node, stay together.
void join_twins(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                const std::vector<Index>& free_surface, DisjointSets& sets) {
  if (free_surface.empty()) return;
  std::vector<std::pair<Index, bool>> nodes;  // and whether it is free
  for (const Index n : surface_nodes) nodes.emplace_back(n, false);
  for (const Index n : free_surface) nodes.emplace_back(n, true);
  const auto place = [&](const std::pair<Index, bool>& node) {
    const auto x = mesh.points.row(node.first);
    return std::array{x[0], x[1], x[2]};
  };
  std::ranges::sort(nodes, {}, place);
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    const auto &a = nodes[i - 1], &b = nodes[i];
    if ((a.second || b.second) && place(a) == place(b)) sets.join(a.first, b.first);
  }
}

}  // namespace

std::vector<Component> split_components(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                                        const std::vector<Index>& free_surface) {
  std::vector<char> is_prescribed(static_cast<std::size_t>(mesh.node_count()), 0);
  std::vector<Index> position(static_cast<std::size_t>(mesh.node_count()), -1);
  for (std::size_t i = 0; i < surface_nodes.size(); ++i) {
    is_prescribed[surface_nodes[i]] = 1;
    position[surface_nodes[i]] = static_cast<Index>(i);
  }
  const NodesOfRegions nodes(mesh, is_prescribed);
  DisjointSets sets = nodes.joined_by_cells();
  join_twins(mesh, surface_nodes, free_surface, sets);
  std::vector<Index> size(nodes.count(), 0), component(nodes.count(), 0);
  for (Index id = 0; id < nodes.count(); ++id) ++size[sets.find(id)];
  std::size_t count = 0;
  for (Index id = 0; id < nodes.count(); ++id)
    if (size[id] > 1) component[id] = static_cast<Index>(count++);  // alone: of no cell

  std::vector<Component> components(std::max<std::size_t>(count, 1));
  Component sheets;
  const auto component_of = [&](Index id) -> Component& {
    const Index set = sets.find(id);
    return size[set] == 1 ? sheets : components[component[set]];
  };
  std::vector<Index> loose;
  const auto add = [&](Index node, Index id) {
    if (is_prescribed[node])
      component_of(id).surface.push_back(position[node]);
    else if (size[sets.find(id)] == 1)
      loose.push_back(node);
    else
      component_of(id).volume.push_back(node);
  };
  for (Index node = 0; node < mesh.node_count(); ++node) add(node, node);
  for (const auto& [place, id] : nodes.in_other_regions()) add(place.first, id);
  for (Component& one : components) {
    std::ranges::sort(one.surface);
    one.surface.erase(std::ranges::unique(one.surface).begin(), one.surface.end());
  }
  if (!loose.empty() && !surface_nodes.empty()) {
    const KdTree tree(Points(mesh.points(surface_nodes, Eigen::all)));
    for (const Index node : loose) {
      const Index nearest = surface_nodes[tree.nearest(mesh.points.row(node).data(), 1)[0].index];
      Component& to = component_of(nearest);
      to.volume.push_back(node);
      ++to.loose;
    }
  }
  if (!sheets.surface.empty()) components.push_back(std::move(sheets));
  return components;
}

}  // namespace cadmorph
