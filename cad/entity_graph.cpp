#include "cad/entity_graph.h"

#include <algorithm>
#include <cstdint>
#include <map>

namespace cadmorph {
namespace {

enum Kind { kFace, kCurve, kCorner, kSolid, kUse };
enum Label { kUseFace = 1, kUseCurve, kUseTail, kUseHead, kSolidFace };
constexpr int kReverse = 8;  // label of the arc back

std::uint64_t mix(std::uint64_t x) {  // splitmix64 finaliser
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

class GraphBuilder {
 public:
  GraphBuilder(const CadModel& model, const GraphOptions& options)
      : model_(model), options_(options) {}

  EntityGraph build() {
    const CadSkeleton& skeleton = model_.skeleton();
    graph_.faces = add_nodes(kFace, model_.faces().size());
    graph_.curves = add_nodes(kCurve, skeleton.curves.size());
    graph_.corners = add_nodes(kCorner, skeleton.corners.size());
    if (options_.has_solids) add_solids();
    for (int c = 0; c < graph_.curves; ++c) add_uses(c, skeleton.curves[c]);
    return std::move(graph_);
  }

 private:
  int add_nodes(Kind kind, std::size_t count) {
    graph_.kind.insert(graph_.kind.end(), count, kind);
    graph_.arcs.resize(graph_.kind.size());
    return static_cast<int>(count);
  }

  void connect(int from, int to, int label) {
    graph_.arcs[from].push_back({label, to});
    graph_.arcs[to].push_back({label + kReverse, from});
  }

  void add_solids() {
    const int first = graph_.size();
    add_nodes(kSolid, static_cast<std::size_t>(model_.solid_count()));
    for (int f = 0; f < graph_.faces; ++f)
      if (model_.faces()[f].solid >= 0) connect(first + model_.faces()[f].solid, f, kSolidFace);
  }

  // All links of a chain have the same faces: the first one stands for them.
  void add_uses(int id, const CadCurve& curve) {
    const CurveLink& link = curve.links.front();
    for (const int c : model_.edges()[link.edge].coedges) {
      const CadCoedge& coedge = model_.coedges()[c];
      const int use = graph_.size();
      add_nodes(kUse, 1);
      graph_.uses.push_back({use, id, c});
      connect(use, coedge.face, kUseFace);
      connect(use, graph_.curve_node(id), kUseCurve);
      if (curve.start < 0) continue;
      const bool runs_back = coedge.is_reversed != link.is_reversed;
      const int tail = runs_back ? curve.end : curve.start;
      const int head = runs_back ? curve.start : curve.end;
      connect(use, graph_.corner_node(tail), kUseTail);
      connect(use, graph_.corner_node(head), options_.is_oriented ? kUseHead : kUseTail);
    }
  }

  const CadModel& model_;
  GraphOptions options_;
  EntityGraph graph_;
};

}  // namespace

EntityGraph build_graph(const CadModel& model, const GraphOptions& options) {
  return GraphBuilder(model, options).build();
}

ColourRefinement::ColourRefinement(const EntityGraph& base, const EntityGraph& variant)
    : graphs_{&base, &variant}, colours_{base.kind, variant.kind}, colour_count_(kUse + 1) {}

void ColourRefinement::hint(const std::vector<std::uint64_t>& base,
                            const std::vector<std::uint64_t>& variant) {
  struct Count {
    int excess = 0, colour = 0;
  };
  const std::vector<std::uint64_t>* labels[2] = {&base, &variant};
  std::map<std::pair<int, std::uint64_t>, Count> counts;
  for (int g = 0; g < 2; ++g)
    for (std::size_t n = 0; n < labels[g]->size(); ++n)
      if ((*labels[g])[n] != 0) counts[{colours_[g][n], (*labels[g])[n]}].excess += g == 0 ? 1 : -1;
  for (auto& [key, count] : counts)
    if (count.excess == 0) count.colour = colour_count_++;
  for (int g = 0; g < 2; ++g)
    for (std::size_t n = 0; n < labels[g]->size(); ++n) {
      if ((*labels[g])[n] == 0) continue;
      const Count& count = counts.at({colours_[g][n], (*labels[g])[n]});
      if (count.excess == 0) colours_[g][n] = count.colour;
    }
}

void ColourRefinement::individualise(int b, int v) {
  colours_[0][b] = colours_[1][v] = colour_count_++;
}

bool ColourRefinement::is_balanced() const {
  std::vector<int> excess(static_cast<std::size_t>(colour_count_), 0);
  for (const int c : colours_[0]) ++excess[c];
  for (const int c : colours_[1]) --excess[c];
  return std::all_of(excess.begin(), excess.end(), [](int e) { return e == 0; });
}

bool ColourRefinement::refine() {
  for (int before = -1;;) {
    std::vector<std::uint64_t> signature[2], all;
    for (int g = 0; g < 2; ++g) {
      const auto& arcs = graphs_[g]->arcs;
      signature[g].resize(arcs.size());
      for (std::size_t n = 0; n < arcs.size(); ++n) {
        std::uint64_t sum = 0;
        for (const auto& arc : arcs[n])
          sum += mix(static_cast<std::uint64_t>(arc.label) << 32 |
                     static_cast<std::uint32_t>(colours_[g][arc.to]));
        signature[g][n] = mix(sum + mix(static_cast<std::uint64_t>(colours_[g][n])));
      }
      all.insert(all.end(), signature[g].begin(), signature[g].end());
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    for (int g = 0; g < 2; ++g)
      for (std::size_t n = 0; n < signature[g].size(); ++n)
        colours_[g][n] = static_cast<int>(
            std::lower_bound(all.begin(), all.end(), signature[g][n]) - all.begin());
    colour_count_ = static_cast<int>(all.size());
    if (!is_balanced()) return false;
    if (colour_count_ == before) return true;
    before = colour_count_;
  }
}

}  // namespace cadmorph
