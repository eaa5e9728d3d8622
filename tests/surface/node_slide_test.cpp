#include "surface/node_slide.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>

#include "cad/projector.h"
#include "cad/topology_match.h"
#include "morph_case.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector2d;
using Eigen::Vector3d;

struct Slide {
  explicit Slide(const std::string& shape, const SurfaceMorphOptions& options = {})
      : c(shape_case(shape)),
        surface(c.base, c.mesh, c.boundary, options),
        moved(surface.morph(*c.base, match_topology(*c.base, *c.base))),
        nodes(slide_on_cad(*c.base, surface.association(), c.boundary, moved)) {}

  RowId row(Index i) const { return row_of(c.boundary, nodes.nodes[i]); }

  // Of a node's foot on the CAD, moved by `way` (millimetres), from the node's face or edge.
  double distance(RowId row, const Vector3d& way) const {
    const int entity = moved.entity[row];
    const Vector2d uv = moved.uv.row(row);
    if (surface.association().dimension[row] == CadDimension::Face)
      return project_on_face(*c.base, FaceId(entity),
                             c.base->evaluate(FaceId(entity), uv).point + way, uv)
          .distance;
    return project_on_edge(*c.base, EdgeId(entity),
                           c.base->evaluate_edge(EdgeId(entity), uv[0]).point + way, uv[0])
        .distance;
  }

  MorphCase c;
  SurfaceMorph surface;
  SurfaceMorphResult moved;
  SlidingNodes nodes;
};

}  // namespace

TEST_CASE("Nodes slide on the CAD from where they are", "[surface][slide]") {
  for (const std::string& shape : all_shapes()) {
    const Slide s(shape);
    INFO(shape);
    const Association& association = s.surface.association();
    CHECK(std::ranges::is_sorted(s.nodes.nodes));
    CHECK(static_cast<Index>(s.nodes.nodes.size()) <=
          association.edge_nodes + association.face_nodes);
    const double unit = association.mesh_unit_mm, way = 1e-3 * s.c.diagonal / unit;
    Index within = 0;
    for (Index i = 0; i < static_cast<Index>(s.nodes.nodes.size()); ++i) {
      const RowId row = s.row(i);
      const bool is_on_face = association.dimension[row] == CadDimension::Face;
      const SlidePlace start = s.nodes.at(i, Vector2d::Zero());
      CHECK((start.point.transpose() - s.moved.positions.row(row)).norm() <
            1e-12 * s.c.diagonal / unit);
      CHECK(s.nodes.is_within(i, Vector2d::Zero()));
      const Eigen::Matrix2d metric = start.tangents.transpose() * start.tangents;
      const Eigen::Matrix2d expected = Vector2d(1, is_on_face ? 1 : 0).asDiagonal();
      CHECK((metric - expected).norm() < 1e-9);
      // On its way: on the CAD, along the tangents.
      const Vector2d slide(0.6 * way, is_on_face ? -0.8 * way : 0);
      const SlidePlace there = s.nodes.at(i, slide);
      if (s.nodes.is_within(i, slide)) {
        ++within;
        CHECK(s.distance(row, unit * (there.point - start.point)) < 1e-9 * s.c.diagonal);
      }
      const double h = 1e-3 * way;
      const SlidePlace near = s.nodes.at(i, Vector2d(slide[0] + h, slide[1]));
      CHECK(((near.point - there.point) / h - there.tangents.col(0)).norm() < 1e-3);
    }
    CHECK(within == std::ssize(s.nodes.nodes));
  }
}

TEST_CASE("Neighbours along an edge and triangles round nodes are known", "[surface][slide]") {
  Index all_triangles = 0;
  for (const std::string& shape : all_shapes()) {
    const Slide s(shape);
    INFO(shape);
    const Association& association = s.surface.association();
    std::map<Index, int> of_node;
    Index other_curves = 0;
    for (const EdgeSegment& segment : s.nodes.segments) {
      CHECK(segment.a < segment.b);
      CHECK(segment.length ==
            Approx((s.c.mesh.points.row(segment.a) - s.c.mesh.points.row(segment.b)).norm()));
      ++of_node[segment.a];
      ++of_node[segment.b];
      const RowId a = row_of(s.c.boundary, segment.a), b = row_of(s.c.boundary, segment.b);
      if (association.dimension[a] == CadDimension::Edge &&
          association.dimension[b] == CadDimension::Edge)
        other_curves += association.entity[a] != association.entity[b];
    }
    CHECK(other_curves == 0);
    // Of one that slides along its edge both nodes beside it.
    std::set<Index> corners;
    for (Index f = 0; f < s.c.boundary.facet_count(); ++f) {
      const auto facet = s.c.boundary.facet(f);
      corners.insert(facet.begin(),
                     facet.begin() + corner_count(s.c.boundary.types[f], std::ssize(facet)));
    }
    Index count = 0;
    for (const Index node : s.nodes.nodes) {
      const RowId row = row_of(s.c.boundary, node);
      if (association.dimension[row] != CadDimension::Edge) continue;
      ++count;
      CHECK(of_node[node] == (corners.contains(node) ? 2 : 0));
    }
    Index triangles = 0;
    for (Index f = 0; f < s.c.boundary.facet_count(); ++f) {
      const auto facet = s.c.boundary.facet(f);
      const auto own = facet.first(corner_count(s.c.boundary.types[f], std::ssize(facet)));
      triangles += own.size() == 3 &&
                   std::ranges::any_of(own, [&](Index n) { return s.nodes.find(n) >= 0; });
    }
    CHECK(std::ssize(s.nodes.triangles) == triangles);
    all_triangles += triangles;
    for (const auto& nodes : s.nodes.triangles)
      CHECK(std::ranges::all_of(nodes, [&](Index n) { return corners.contains(n); }));
    const SlidingNodes on_edges = slide_on_cad(*s.c.base, association, s.c.boundary, s.moved, true);
    CHECK(std::ssize(on_edges.nodes) == count);
    CHECK(on_edges.segments.size() == s.nodes.segments.size());
  }
  CHECK(all_triangles > 0);
}

TEST_CASE("Nodes that slide off their edge or face are seen", "[surface][slide]") {
  const Slide s("plate_4_holes");
  const double far = 2 * s.c.diagonal / s.surface.association().mesh_unit_mm;
  Index flat = 0, open = 0;
  for (Index i = 0; i < static_cast<Index>(s.nodes.nodes.size()); ++i) {
    const int entity = s.moved.entity[s.row(i)];
    const bool is_on_edge = s.surface.association().dimension[s.row(i)] == CadDimension::Edge;
    const bool is_flat =
        !is_on_edge && s.c.base->faces()[FaceId(entity)].type == SurfaceType::Plane;
    const bool is_open = is_on_edge && s.c.base->edges()[EdgeId(entity)].start !=
                                           s.c.base->edges()[EdgeId(entity)].end;
    flat += is_flat;
    open += is_open;
    if (is_flat || is_open) CHECK_FALSE(s.nodes.is_within(i, Vector2d(far, 0)));
  }
  CHECK(flat == 299);
  CHECK(open == 76);
}

TEST_CASE("Facets that nodes slide over each other are counted", "[surface][slide]") {
  const std::pair<const char*, int> shapes[] = {
      {"plate_4_holes", 58}, {"sphere_in_box", 78}, {"stepped_shaft", 75}, {"torus", 103}};
  for (const auto& [shape, expected] : shapes) {
    const Slide s(shape);
    INFO(shape);
    const Association& association = s.surface.association();
    const auto turned = [&](const Points& positions, const RowMatrix& slides) {
      return count_turned_facets(s.c.mesh, association, s.c.boundary, s.nodes, positions, slides);
    };
    CHECK(turned(s.c.mesh.points, s.nodes.slides) == 0);
    Index beyond = 0;
    for (Index i = 0; i < static_cast<Index>(s.nodes.nodes.size()); i += 7) {
      if (association.dimension[s.row(i)] != CadDimension::Face) continue;
      // Beyond the facets round about, along the surface.
      const double far = 0.1 * s.c.diagonal / association.mesh_unit_mm;
      Points positions = s.c.mesh.points;
      RowMatrix slides = s.nodes.slides;
      slides(i, 0) = far;
      positions.row(s.nodes.nodes[i]) = s.nodes.at(i, Vector2d(far, 0)).point.transpose();
      const Incidence facets = node_facets(s.c.boundary, s.c.mesh.node_count());
      double reach = 0;
      for (const Index f : facets.at(s.nodes.nodes[i]))
        for (const Index node : s.c.boundary.facet(f))
          reach = std::max(
              reach, (s.c.mesh.points.row(node) - s.c.mesh.points.row(s.nodes.nodes[i])).norm());
      if (far <= 1.2 * reach) continue;
      ++beyond;
      CHECK(turned(positions, slides) > 0);
    }
    CHECK(beyond == expected);
  }
}

TEST_CASE("Folds are those where the nodes are, not where they were", "[surface][slide][fold]") {
  const Slide s("stepped_shaft");
  const TopologyMatch match = match_topology(*s.c.base, *s.c.base);
  Index slid = 0;
  for (Index i = 0; i < std::ssize(s.nodes.nodes); i += 7) {
    const RowId row = s.row(i);
    if (s.surface.association().dimension[row] != CadDimension::Face) continue;
    SurfaceMorphResult there = s.moved;
    for (FacetId f(0); f < s.c.boundary.facet_count(); ++f) there.folded_facets.push_back(f);
    CHECK(s.surface.folds_left(*s.c.base, match, there, there.positions).empty());
    // Over the facets round about, along the surface.
    const Vector2d far(0.1 * s.c.diagonal / s.surface.association().mesh_unit_mm, 0);
    there.positions.row(row) = s.nodes.at(i, far).point.transpose();
    there.uv.row(row) = s.nodes.parameters(i, far).transpose();
    const auto left = s.surface.folds_left(*s.c.base, match, there, there.positions);
    ++slid;
    CHECK_FALSE(left.empty());
    for (const FacetId f : left)
      CHECK(std::ranges::count(s.c.boundary.facet(f), s.nodes.nodes[i]) == 1);
  }
  CHECK(slid == 75);
}

TEST_CASE("Nodes stay that others depend on", "[surface][slide]") {
  Slide s("box");
  const auto slides = [&](const SlidingNodes& nodes, RowId row) {
    return std::ranges::binary_search(nodes.nodes, s.c.boundary.nodes[row]);
  };
  std::vector<RowId> rows;
  for (Index i = 0; i < static_cast<Index>(s.nodes.nodes.size()); ++i)
    if (s.moved.entity[s.row(i)] == 0) rows.push_back(s.row(i));
  REQUIRE(rows.size() > 2);
  // Two at one place: the sides of a slit.
  const RowId a = rows.front(), b = rows.back();
  SurfaceMorphResult slit = s.moved;
  slit.positions.row(a) = slit.positions.row(b);
  slit.positions.row(a).x() += GENERATE(0, 5e-9) * s.c.diagonal;
  const SlidingNodes beside = slide_on_cad(*s.c.base, s.surface.association(), s.c.boundary, slit);
  CHECK(beside.nodes.size() == s.nodes.nodes.size() - 2);
  CHECK_FALSE((slides(beside, a) || slides(beside, b)));
  // One amid a straight edge, and those on its facets.
  Association amid = s.surface.association();
  amid.is_amid[a] = 1;
  const SlidingNodes around = slide_on_cad(*s.c.base, amid, s.c.boundary, s.moved);
  CHECK(around.nodes.size() < s.nodes.nodes.size() - 2);
  CHECK_FALSE(slides(around, a));
}

}  // namespace cadmorph
