#pragma once

#include <algorithm>
#include <functional>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "cad/match_side.h"

namespace cadmorph::testing {

using GraphEdges = std::vector<std::pair<int, int>>;
using Permutation = std::vector<int>;

/// Stands for a model while it is matched: nodes ("faces") at points, joined by edges of one kind.
/// Of `model` the bounds alone count.
inline MatchSide point_graph(const CadModel& model, const GraphEdges& edges,
                             const std::vector<Eigen::Vector3d>& points,
                             const std::vector<double>& sizes = {}) {
  MatchSide side{model, {}, {}, {}, {}};
  side.graph.faces = static_cast<int>(points.size());
  side.graph.kind.assign(points.size(), 0);
  side.graph.arcs.resize(points.size());
  for (const auto& [a, b] : edges) {
    side.graph.arcs[a].push_back({0, b});
    side.graph.arcs[b].push_back({0, a});
  }
  for (std::size_t n = 0; n < points.size(); ++n)
    side.features.push_back({points[n], sizes.empty() ? 1 : sizes[n]});
  return side;
}

inline Permutation any_permutation(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  Permutation p(count);
  std::iota(p.begin(), p.end(), 0);
  std::ranges::shuffle(p, random);
  return p;
}

/// The edges with node n called p[n].
inline GraphEdges renamed(const GraphEdges& edges, const Permutation& p) {
  GraphEdges result;
  for (const auto& [a, b] : edges) result.emplace_back(p[a], p[b]);
  return result;
}

/// The items with that of n at p[n].
template <class T>
std::vector<T> rearranged(const std::vector<T>& items, const Permutation& p) {
  std::vector<T> result(items.size());
  for (std::size_t n = 0; n < items.size(); ++n) result[p[n]] = items[n];
  return result;
}

/// All one-to-one maps of `count` nodes that carry `from` onto `to`, by trying them all.
inline std::vector<Permutation> isomorphisms(int count, const GraphEdges& from,
                                             const GraphEdges& to) {
  const auto table = [&](const GraphEdges& edges) {
    std::vector<char> is_edge(static_cast<std::size_t>(count * count), 0);
    for (const auto& [a, b] : edges) is_edge[a * count + b] = is_edge[b * count + a] = 1;
    return is_edge;
  };
  const auto a = table(from), b = table(to);
  std::vector<Permutation> all;
  Permutation images;
  const std::function<void()> extend = [&] {
    const int n = static_cast<int>(images.size());
    if (n == count) all.push_back(images);
    for (int v = 0; v < count && n < count; ++v) {
      if (std::ranges::find(images, v) != images.end()) continue;
      bool fits = true;
      for (int m = 0; m < n && fits; ++m) fits = a[n * count + m] == b[v * count + images[m]];
      if (!fits) continue;
      images.push_back(v);
      extend();
      images.pop_back();
    }
  };
  extend();
  return all;
}

}  // namespace cadmorph::testing
