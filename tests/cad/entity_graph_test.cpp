#include "cad/entity_graph.h"

#include <BRepBuilderAPI_Transform.hxx>
#include <catch2/catch.hpp>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "cad_variants.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

/// Nodes of one kind joined by arcs of one label, both ways.
EntityGraph graph(int nodes, const std::vector<std::pair<int, int>>& edges) {
  EntityGraph g;
  g.faces = nodes;
  g.kind.assign(nodes, 0);
  g.arcs.resize(nodes);
  for (const auto& [a, b] : edges) {
    g.arcs[a].push_back({0, b});
    g.arcs[b].push_back({0, a});
  }
  return g;
}

std::size_t colours(const std::vector<int>& of_nodes) {
  return std::set<int>(of_nodes.begin(), of_nodes.end()).size();
}

using Partition = std::vector<int>;

/// Splits a partition by how often each part is among a node's neighbours, until nothing changes.
Partition coarsest_stable(const EntityGraph& graph, Partition parts) {
  for (std::size_t count = 0;;) {
    std::map<std::pair<int, std::multiset<int>>, int> number;
    Partition next;
    for (int n = 0; n < graph.size(); ++n) {
      std::multiset<int> around;
      for (const auto& arc : graph.arcs[n]) around.insert(parts[arc.to]);
      next.push_back(number.emplace(std::pair(parts[n], around), static_cast<int>(number.size()))
                         .first->second);
    }
    if (number.size() == count) return next;
    count = number.size();
    parts = next;
  }
}

/// The numbers of the parts in the order of their first nodes.
Partition renumbered(const Partition& parts) {
  std::map<int, int> number;
  Partition result;
  for (const int part : parts)
    result.push_back(number.emplace(part, static_cast<int>(number.size())).first->second);
  return result;
}

const std::vector<std::pair<int, int>> kPath{{0, 1}, {1, 2}, {2, 3}, {3, 4}};
const std::vector<std::pair<int, int>> kHexagon{{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}, {5, 0}};
const std::vector<std::pair<int, int>> kTriangles{{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}};

}  // namespace

TEST_CASE("refinement finds the orbits of a path", "[cad][colours]") {
  const EntityGraph path = graph(5, kPath);
  ColourRefinement refinement(path, path);
  CHECK(refinement.refine());
  const auto& c = refinement.base_colours();
  CHECK(colours(c) == 3);  // ends, their neighbours, the middle
  CHECK(c[0] == c[4]);
  CHECK(c[1] == c[3]);
  CHECK(c == refinement.variant_colours());
}

TEST_CASE("refinement names a node the same whatever its number", "[cad][colours]") {
  // The path with its nodes renumbered: 2-0-4-1-3.
  const EntityGraph path = graph(5, kPath);
  const EntityGraph other = graph(5, {{2, 0}, {0, 4}, {4, 1}, {1, 3}});
  ColourRefinement refinement(path, other);
  REQUIRE(refinement.refine());
  CHECK(refinement.base_colours()[2] == refinement.variant_colours()[4]);
  CHECK(refinement.base_colours()[0] == refinement.variant_colours()[3]);
  refinement.individualise(0, 3);
  REQUIRE(refinement.refine());
  CHECK(colours(refinement.base_colours()) == 5);
  const std::vector<int> expected{3, 1, 4, 0, 2};  // base node -> variant node
  for (int n = 0; n < 5; ++n)
    CHECK(refinement.base_colours()[n] == refinement.variant_colours()[expected[n]]);
}

TEST_CASE("refinement is the coarsest stable partition, after each singled-out node too",
          "[cad][colours]") {
  std::mt19937 random(5);
  for (int trial = 0; trial < 200; ++trial) {
    const int nodes = 4 + static_cast<int>(random() % 30);
    std::vector<std::pair<int, int>> edges;
    for (int n = 1; n < nodes; ++n) edges.emplace_back(n, (n - 1) / 2);  // a tree is symmetric
    for (int n = static_cast<int>(random() % 4); n > 0; --n)
      edges.emplace_back(static_cast<int>(random()) & 3, nodes - 1 - n);
    const EntityGraph g = graph(nodes, edges);
    ColourRefinement refinement(g, g);
    Partition expected(static_cast<std::size_t>(nodes), 0);
    for (int singled = 0; singled < 4; ++singled) {
      REQUIRE(refinement.refine());
      expected = coarsest_stable(g, expected);
      CHECK(renumbered(refinement.base_colours()) == renumbered(expected));
      CHECK(refinement.base_colours() == refinement.variant_colours());
      const int one = static_cast<int>(random() % static_cast<unsigned>(nodes));
      refinement.individualise(one, one);
      expected[one] = nodes + singled;
    }
  }
}

TEST_CASE("graphs of different degrees are told apart", "[cad][colours]") {
  const EntityGraph path = graph(5, kPath);
  const EntityGraph star = graph(5, {{0, 1}, {0, 2}, {0, 3}, {0, 4}});
  ColourRefinement refinement(path, star);
  CHECK(!refinement.refine());
  CHECK(!refinement.is_balanced());
}

TEST_CASE("two triangles pass for a hexagon until one node is singled out", "[cad][colours]") {
  // The known limit of colour refinement: regular graphs of one degree look alike.
  const EntityGraph hexagon = graph(6, kHexagon), triangles = graph(6, kTriangles);
  ColourRefinement refinement(hexagon, triangles);
  CHECK(refinement.refine());
  CHECK(colours(refinement.base_colours()) == 1);
  refinement.individualise(0, 0);
  CHECK(!refinement.refine());
}

TEST_CASE("kinds and labels count", "[cad][colours]") {
  const EntityGraph plain = graph(6, kHexagon);
  EntityGraph marked = plain;
  marked.kind[2] = 1;
  CHECK(!ColourRefinement(plain, marked).refine());
  EntityGraph labelled = plain;
  labelled.arcs[0][0].label = 7;
  CHECK(!ColourRefinement(plain, labelled).refine());
}

TEST_CASE("the graph of a box has 6 faces, 12 curves, 8 corners, all alike", "[cad][colours]") {
  const CadModel box = to_model(read_shape(model_file("shapes/box.step")));
  const EntityGraph g = build_graph(box, {});
  CHECK(g.faces == 6);
  CHECK(g.curves == 12);
  CHECK(g.corners == 8);
  ColourRefinement refinement(g, g);
  REQUIRE(refinement.refine());
  const auto& c = refinement.base_colours();
  CHECK(colours({c.begin(), c.begin() + 6}) == 1);
  CHECK(colours({c.begin() + 6, c.begin() + 18}) == 1);
  CHECK(colours({c.begin() + 18, c.begin() + 26}) == 1);
  for (std::size_t n = 0; n < g.arcs.size(); ++n)
    for (const auto& arc : g.arcs[n]) CHECK(arc.to < g.size());
}

TEST_CASE("an oriented graph tells a chiral part from its mirror image", "[cad][colours]") {
  // Three holes of a plate's corner at unequal places on three faces: no mirror symmetry of the
  // adjacency remains once all faces differ.
  const TopoDS_Shape part = read_shape(model_file("bore/base.step"));
  gp_Trsf mirror;
  mirror.SetMirror(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(1, 0, 0)));
  const CadModel base = to_model(part);
  const CadModel mirrored = to_model(BRepBuilderAPI_Transform(part, mirror, true).Shape());
  const EntityGraph unoriented = build_graph(base, {.is_oriented = false}),
                    other = build_graph(mirrored, {.is_oriented = false});
  CHECK(ColourRefinement(unoriented, other).refine());
  const EntityGraph itself = build_graph(base, {});
  CHECK(ColourRefinement(itself, itself).refine());
}
