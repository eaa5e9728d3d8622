#include "surface/node_slide.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "cad/projector.h"
#include "core/kd_tree.h"
#include "core/parallel.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Tangents = Eigen::Matrix<double, 3, 2>;

// Of the diagonal: nodes at one place. Bodies that gmsh meshed each for itself had nodes of their
// interface up to 4e-9 apart.
constexpr double kTwin = 1e-7;
// Cosine: coarse facets of curved faces may stand steep. With 0.8 not all facets that nodes slide
// over each other are counted, with 0.25 they are.
constexpr double kTurned = 0.5;
constexpr double kDegenerate = 1e-6;  // of the larger tangent: a pole

// A node on its edge or face of the variant.
struct Slider {
  bool is_on_face;
  int entity;
  Vector2d uv;      ///< where it starts; on an edge (t, 0)
  Matrix2d to_uv;   ///< parameters a millimetre along orthonormal tangents
  Vector3d offset;  ///< from the CAD, millimetres
};

struct Place {
  Vector3d point;
  Tangents tangents;  ///< by the parameters
};

bool is_closed(const CadEdge& edge) { return edge.start == edge.end; }

// Round a closed edge there is no end.
double wrapped(const CadEdge& edge, double t) {
  if (!is_closed(edge)) return t;
  const double period = edge.last - edge.first;
  return t - period * std::floor((t - edge.first) / period);
}

Place evaluate(const CadModel& variant, const Slider& slider, const Vector2d& uv) {
  Place result;
  if (slider.is_on_face) {
    const SurfacePoint s = variant.evaluate(FaceId(slider.entity), uv);
    result.point = s.point;
    result.tangents << s.du, s.dv;
  } else {
    const CadEdge& edge = variant.edges()[EdgeId(slider.entity)];
    const CurvePoint c = variant.evaluate_edge(EdgeId(slider.entity), wrapped(edge, uv[0]));
    result.point = c.point;
    result.tangents << c.dt, Vector3d::Zero();
  }
  return result;
}

bool is_on_entity(const CadModel& variant, const Slider& slider, const Vector2d& uv) {
  if (slider.is_on_face)
    return distance_to_trimmed(variant, FaceId(slider.entity), uv) <=
           variant.faces()[FaceId(slider.entity)].tolerance;
  const CadEdge& edge = variant.edges()[EdgeId(slider.entity)];
  return is_closed(edge) || (uv[0] >= edge.first && uv[0] <= edge.last);
}

// Neighbours along the variant's edges, each pair once, with their distance.
std::vector<EdgeSegment> segments_of_edges(const CadModel& variant, const Association& association,
                                           const Boundary& boundary,
                                           const SurfaceMorphResult& moved) {
  const auto is_on = [&](RowId row, EdgeId edge) {
    if (association.dimension[row] == CadDimension::Edge) return moved.entity[row] == edge;
    if (association.dimension[row] != CadDimension::Vertex) return false;
    const Vector3d place = association.mesh_unit_mm * moved.positions.row(row).transpose();
    const CadEdge& ends = variant.edges()[edge];
    return std::ranges::any_of(std::array{ends.start, ends.end}, [&](VertexId vertex) {
      return vertex >= 0 &&
             (variant.vertices()[vertex].point - place).norm() <= kTwin * variant.diagonal();
    });
  };
  std::vector<EdgeSegment> result;
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    const auto facet = boundary.facet(f);
    const Index corners = corner_count(boundary.types[f], std::ssize(facet));
    for (Index i = 0; i < corners; ++i) {
      RowId a = row_of(boundary, facet[i]), b = row_of(boundary, facet[(i + 1) % corners]);
      if (association.dimension[a] != CadDimension::Edge) std::swap(a, b);
      if (association.dimension[a] == CadDimension::Edge && is_on(b, EdgeId(moved.entity[a])))
        result.push_back({std::min(boundary.nodes[a], boundary.nodes[b]),
                          std::max(boundary.nodes[a], boundary.nodes[b]),
                          (moved.positions.row(a) - moved.positions.row(b)).norm()});
    }
  }
  const auto ends = [](const EdgeSegment& segment) { return std::pair(segment.a, segment.b); };
  std::ranges::sort(result, {}, ends);
  result.erase(std::ranges::unique(result, {}, ends).begin(), result.end());
  return result;
}

std::vector<std::array<Index, 3>> triangles_with(const std::vector<Index>& sliding,
                                                 const Boundary& boundary) {
  std::vector<std::array<Index, 3>> result;
  const auto slides = [&](Index node) { return std::ranges::binary_search(sliding, node); };
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    const auto facet = boundary.facet(f);
    if (corner_count(boundary.types[f], std::ssize(facet)) != 3) continue;
    if (std::ranges::any_of(facet.first(3), slides))
      result.push_back({facet[0], facet[1], facet[2]});
  }
  return result;
}

IdVector<RowId, char> marks_of_bound_nodes(const Association& association, const Boundary& boundary,
                                           const CadModel& variant, const Points& positions) {
  IdVector<RowId, char> is_bound(boundary.nodes.size(), 0);
  std::vector<RowId> rows;
  for (const FacetId f : association.facet_face.ids()) {
    rows.clear();
    for (const Index node : boundary.facet(f)) rows.push_back(row_of(boundary, node));
    const bool is_on_cad = std::ranges::all_of(rows, [&](RowId row) {
      return association.dimension[row] != CadDimension::None && !association.is_amid[row];
    });
    if (is_on_cad && association.facet_face[f] >= 0) continue;
    for (const RowId row : rows) is_bound[row] = 1;
  }
  const KdTree tree(positions);
  const double reach = kTwin * variant.diagonal() / association.mesh_unit_mm;
  parallel_for(positions.rows(), 1024, [&](Index begin, Index end) {
    for (RowId row(begin); row < end; ++row)
      if (tree.within(positions.row(row).data(), reach).size() > 1) is_bound[row] = 1;
  });
  return is_bound;
}

// False at a pole.
bool set_up(const CadModel& variant, const Vector3d& position, Slider& slider) {
  const Place start = evaluate(variant, slider, slider.uv);
  const Tangents& j = start.tangents;
  slider.offset = position - start.point;
  if (!slider.is_on_face) {
    const double speed = j.col(0).norm();
    slider.to_uv = Vector2d(speed > 0 ? 1 / speed : 0, 0).asDiagonal();
    return speed > 0;
  }
  const double most = j.colwise().norm().maxCoeff();
  if (j.col(0).cross(j.col(1)).norm() <= kDegenerate * most * most) return false;
  slider.to_uv = Eigen::SelfAdjointEigenSolver<Matrix2d>(j.transpose() * j).operatorInverseSqrt();
  return true;
}

}  // namespace

SlidingNodes slide_on_cad(const CadModel& variant, const Association& association,
                          const Boundary& boundary, const SurfaceMorphResult& moved,
                          bool on_edges_alone) {
  const double unit = association.mesh_unit_mm;
  const IdVector<RowId, char> is_bound =
      marks_of_bound_nodes(association, boundary, variant, moved.positions);
  SlidingNodes result;
  const auto sliders = std::make_shared<std::vector<Slider>>();
  for (const RowId row : is_bound.ids()) {
    const CadDimension dimension = association.dimension[row];
    if (on_edges_alone && dimension != CadDimension::Edge) continue;
    if ((dimension != CadDimension::Face && dimension != CadDimension::Edge) ||
        association.is_free[row] || is_bound[row] ||
        std::ranges::binary_search(moved.crossing, row) ||
        std::ranges::binary_search(moved.periodic, row))
      continue;
    Slider slider{dimension == CadDimension::Face, moved.entity[row], moved.uv.row(row), {}, {}};
    if (!set_up(variant, unit * moved.positions.row(row).transpose(), slider)) continue;
    result.nodes.push_back(boundary.nodes[row]);
    sliders->push_back(std::move(slider));
  }
  result.segments = segments_of_edges(variant, association, boundary, moved);
  result.triangles = triangles_with(result.nodes, boundary);
  result.slides = RowMatrix::Zero(static_cast<Index>(result.nodes.size()), 2);
  const auto uv_at = [sliders, unit](Index i, const Vector2d& slide) -> Vector2d {
    const Slider& slider = (*sliders)[i];
    return slider.uv + slider.to_uv * (unit * slide);
  };
  result.at = [sliders, variant, unit, uv_at](Index i, const Vector2d& slide) {
    const Slider& slider = (*sliders)[i];
    const Place place = evaluate(variant, slider, uv_at(i, slide));
    return SlidePlace{(place.point + slider.offset) / unit, place.tangents * slider.to_uv};
  };
  result.parameters = uv_at;
  result.is_within = [sliders, variant, uv_at](Index i, const Vector2d& slide) {
    return is_on_entity(variant, (*sliders)[i], uv_at(i, slide));
  };
  return result;
}

Index count_turned_facets(const Mesh& mesh, const Association& association,
                          const Boundary& boundary, const SlidingNodes& sliding,
                          const Points& positions, const RowMatrix& slides) {
  const SurfaceMesh surface = make_surface_mesh(mesh, boundary, association.mesh_unit_mm);
  const Points moved = positions(boundary.nodes, Eigen::all);
  // Of a facet with the normal of its CAD face at a node that slides, if there is one.
  const auto cosine_of = [&](FacetId f) -> std::optional<double> {
    for (const RowId row : surface.facets[f]) {
      const Index i = sliding.find(boundary.nodes[row]);
      if (i < 0 || association.dimension[row] != CadDimension::Face) continue;
      const Tangents t = sliding.at(i, slides.row(i).transpose()).tangents;
      return area_vector(surface, moved, f).normalized().dot(t.col(0).cross(t.col(1)).normalized());
    }
    return {};
  };
  IdVector<FacetId, std::optional<double>> of_facet(boundary.facet_count());
  parallel_for(boundary.facet_count(), 1024, [&](Index begin, Index end) {
    for (FacetId f(begin); f < end; ++f) of_facet[f] = cosine_of(f);
  });
  std::map<FaceId, std::vector<double>> cosines;
  for (const FacetId f : of_facet.ids())
    if (of_facet[f]) cosines[association.facet_face[f]].push_back(*of_facet[f]);
  Index count = 0;
  for (const auto& [face, of_face] : cosines) {
    const auto up = std::ranges::count_if(of_face, [](double cosine) { return cosine > 0; });
    const double sign = 2 * up < std::ssize(of_face) ? -1 : 1;
    count += std::ranges::count_if(of_face, [&](double c) { return sign * c < -kTurned; });
  }
  return count;
}

}  // namespace cadmorph
