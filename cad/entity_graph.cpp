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
    for (const CurveId c : skeleton.curves.ids()) add_uses(c, skeleton.curves[c]);
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
    for (const FaceId f : model_.faces().ids())
      for (const int solid : {model_.faces()[f].solid, model_.faces()[f].other_solid})
        if (solid >= 0) connect(first + solid, f, kSolidFace);
  }

  bool is_seen_from_inside(FaceId face) const {
    if (options_.seen_along.isZero(0)) return false;
    const CadFace& of = model_.faces()[face];
    return model_.normal(face, (of.lower + of.upper) / 2).dot(options_.seen_along) < 0;
  }

  // All links of a chain have the same faces: the first one stands for them.
  void add_uses(CurveId id, const CadCurve& curve) {
    const CurveLink& link = curve.links.front();
    for (const CoedgeId c : model_.edges()[link.edge].coedges) {
      const CadCoedge& coedge = model_.coedges()[c];
      const int use = graph_.size();
      add_nodes(kUse, 1);
      graph_.uses.push_back({use, id, c});
      connect(use, coedge.face, kUseFace);
      connect(use, graph_.curve_node(id), kUseCurve);
      if (curve.start < 0) continue;
      const bool runs_back =
          (coedge.is_reversed != link.is_reversed) != is_seen_from_inside(coedge.face);
      const CornerId tail = runs_back ? curve.end : curve.start;
      const CornerId head = runs_back ? curve.start : curve.end;
      connect(use, graph_.corner_node(tail), kUseTail);
      const bool has_outside = model_.faces()[coedge.face].other_solid < 0;
      connect(use, graph_.corner_node(head),
              options_.is_oriented && has_outside ? kUseHead : kUseTail);
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
    : graphs_{&base, &variant}, colours_{base.kind, variant.kind} {
  for (int g = 0; g < 2; ++g)
    for (int n = 0; n < graphs_[g]->size(); ++n) {
      const auto kind = static_cast<std::size_t>(colours_[g][n]);
      if (kind >= classes_.size()) classes_.resize(kind + 1);
      enter(classes_[kind], g, +1);
      changed_.push_back({g, n});
    }
}

void ColourRefinement::enter(Class& members, int graph, int count) {
  unbalanced_ -= members.excess != 0;
  members.size += count;
  members.excess += graph == 0 ? count : -count;
  unbalanced_ += members.excess != 0;
}

int ColourRefinement::fresh_colour() {
  classes_.emplace_back();
  return static_cast<int>(classes_.size()) - 1;
}

void ColourRefinement::recolour(Node node, int colour) {
  int& current = colours_[node.graph][node.number];
  enter(classes_[current], node.graph, -1);
  enter(classes_[colour], node.graph, +1);
  current = colour;
  changed_.push_back(node);
}

void ColourRefinement::hint(const std::vector<std::uint64_t>& base,
                            const std::vector<std::uint64_t>& variant) {
  const std::vector<std::uint64_t>* labels[2] = {&base, &variant};
  std::map<std::pair<int, std::uint64_t>, std::vector<Node>> labelled;
  std::map<std::pair<int, std::uint64_t>, int> excess;
  for (int g = 0; g < 2; ++g)
    for (int n = 0; n < static_cast<int>(labels[g]->size()); ++n) {
      if ((*labels[g])[n] == 0) continue;
      const std::pair key{colours_[g][n], (*labels[g])[n]};
      labelled[key].push_back({g, n});
      excess[key] += g == 0 ? 1 : -1;
    }
  for (const auto& [key, nodes] : labelled) {
    if (excess[key] != 0) continue;
    const int colour = fresh_colour();
    for (const Node& node : nodes) recolour(node, colour);
  }
}

void ColourRefinement::individualise(int b, int v) {
  const int colour = fresh_colour();
  recolour({0, b}, colour);
  recolour({1, v}, colour);
}

Index ColourRefinement::count() const {
  return std::ranges::count_if(classes_, [](const Class& members) { return members.size > 0; });
}

std::vector<ColourRefinement::Node> ColourRefinement::take_neighbours_of_changed() {
  std::vector<Node> result;
  for (const Node& node : changed_)
    for (const auto& arc : graphs_[node.graph]->arcs[node.number])
      result.push_back({node.graph, arc.to});
  changed_.clear();
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

std::uint64_t ColourRefinement::neighbourhood(Node node) const {
  std::uint64_t sum = 0;
  for (const auto& arc : graphs_[node.graph]->arcs[node.number])
    sum += mix(static_cast<std::uint64_t>(arc.label) << 32 |
               static_cast<std::uint32_t>(colours_[node.graph][arc.to]));
  return mix(sum);
}

// Nodes of one colour that stayed aside have neighbours that did not change: they keep it. Without
// any, the most numerous of the neighbourhoods does.
void ColourRefinement::split(std::span<const Seen> one_colour) {
  std::vector<std::span<const Seen>> groups;
  for (auto rest = one_colour; !rest.empty(); rest = rest.subspan(groups.back().size())) {
    const auto end = std::find_if(rest.begin(), rest.end(), [&](const Seen& s) {
      return s.neighbourhood != rest.front().neighbourhood;
    });
    groups.push_back(rest.first(static_cast<std::size_t>(end - rest.begin())));
  }
  const int nodes = classes_[static_cast<std::size_t>(one_colour.front().colour)].size;
  if (static_cast<int>(one_colour.size()) == nodes)
    groups.erase(std::max_element(groups.begin(), groups.end(),
                                  [](auto& a, auto& b) { return a.size() < b.size(); }));
  for (const auto& group : groups) {
    const int colour = fresh_colour();
    for (const Seen& s : group) recolour(s.node, colour);
  }
}

bool ColourRefinement::refine() {
  while (!changed_.empty() && is_balanced()) {
    std::vector<Seen> seen;
    for (const Node& node : take_neighbours_of_changed())
      seen.push_back({colours_[node.graph][node.number], neighbourhood(node), node});
    std::sort(seen.begin(), seen.end());
    for (auto first = seen.begin(); first != seen.end();) {
      const auto end =
          std::find_if(first, seen.end(), [&](const Seen& s) { return s.colour != first->colour; });
      split({first, end});
      first = end;
    }
  }
  return is_balanced();
}

}  // namespace cadmorph
