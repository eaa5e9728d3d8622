#include "cad/match_side.h"

#include <bit>
#include <cmath>
#include <sstream>
#include <utility>

#include "cad/face_sampler.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Forms are compared after rounding to bins ten times as wide as what files keep. The odd digits
// keep tidy numbers off the bounds of bins, where rounding would part them.
constexpr double kBin = 1.0373e-6, kBinOffset = 0.3719;
constexpr int kBulgeGrid = 12;  // samples in each direction: only the sign of the bulge counts
// Mean normal of a face that is more of a disk than of a sleeve: between the cones of chamfers
// (0.71) and of drill tips (0.86).
constexpr double kFlat = 0.8;

std::uint64_t combine(std::uint64_t seed, std::uint64_t value) {
  seed ^= value + 0x9e3779b97f4a7c15ull + (seed << 6) + (seed >> 2);
  seed = (seed ^ (seed >> 31)) * 0xbf58476d1ce4e5b9ull;
  return seed ^ (seed >> 29);
}

std::uint64_t rounded(double x) {
  return std::bit_cast<std::uint64_t>(std::floor(x / kBin + kBinOffset));
}

double total_length(const CadModel& model) {
  double sum = 0;
  for (const CadCurve& curve : model.skeleton().curves) sum += curve.length;
  return sum > 0 ? sum : model.diagonal();
}

// Millimetres in parameters become parts of the model's size, so that scaling changes nothing.
Vector2d parameter_unit(const CadFace& face, double length) {
  switch (face.type) {
    case SurfaceType::Plane:
      return {length, length};
    case SurfaceType::Cylinder:
    case SurfaceType::Cone:
      return {1, length};
    default:
      return {1, 1};
  }
}

// Of a pcurve's ends, in either order, and its middle.
std::uint64_t use_form(const CadModel& model, CoedgeId coedge, const Vector2d& unit) {
  const CadEdge& edge = model.edges()[model.coedges()[coedge].edge];
  const auto at = [&](double s) -> Vector2d {
    return model.pcurve(coedge, edge.first + s * (edge.last - edge.first)).cwiseQuotient(unit);
  };
  const Vector2d middle = at(0.5), ends = at(0) + at(1);
  std::uint64_t form = 1;
  for (const double x : {middle.x(), middle.y(), ends.x(), ends.y()})
    form = combine(form, rounded(x));
  return form;
}

// See face_bulges. The integral of n (x - centroid) over a sleeve is twice what it encloses.
std::uint64_t bulge(const CadModel& model, FaceId face) {
  const CadFace& f = model.faces()[face];
  if (f.solid < 0 || f.period.isZero(0)) return 0;
  Vector3d centroid = Vector3d::Zero(), normals = centroid;
  double area = 0, sum = 0;
  std::vector<std::pair<Vector3d, Vector3d>> samples;  // point, normal times area
  for (const Vector2d& uv : sample_domain(model, face, kBulgeGrid)) {
    const SurfacePoint s = model.evaluate(face, uv);
    const double weight = s.du.cross(s.dv).norm();
    samples.emplace_back(s.point, weight * model.normal(face, uv));
    area += weight;
    centroid += weight * s.point;
    normals += samples.back().second;
  }
  if (area == 0 || normals.norm() > kFlat * area) return 0;
  centroid /= area;
  for (const auto& [point, normal] : samples) sum += normal.dot(point - centroid);
  return sum > 0 ? 1 : 2;
}

}  // namespace

std::vector<std::uint64_t> entity_forms(const CadModel& model, const EntityGraph& graph) {
  std::vector<std::uint64_t> forms(static_cast<std::size_t>(graph.size()), 0);
  const double length = total_length(model);
  for (const FaceId f : model.faces().ids()) {
    const SurfaceType type = model.faces()[f].type;
    if (type != SurfaceType::BSpline && type != SurfaceType::Other)
      forms[f] = 1 + static_cast<std::uint64_t>(type);
  }
  for (const EntityGraph::Use& use : graph.uses) {
    const CadFace& face = model.faces()[model.coedges()[use.coedge].face];
    const bool is_whole = model.skeleton().curves[use.curve].links.size() == 1;
    if (is_whole) forms[use.node] = use_form(model, use.coedge, parameter_unit(face, length));
  }
  return forms;
}

std::vector<std::uint64_t> face_bulges(const CadModel& model) {
  std::vector<std::uint64_t> bulges;
  for (const FaceId f : model.faces().ids()) bulges.push_back(bulge(model, f));
  return bulges;
}

MatchSide make_match_side(const CadModel& model, const GraphOptions& options) {
  MatchSide side{model, build_graph(model, options), entity_features(model), {}, {}};
  side.forms = entity_forms(model, side.graph);
  side.bulges = face_bulges(model);
  return side;
}

std::string describe(const MatchSide& side, int node) {
  std::ostringstream text;
  text.precision(4);
  Eigen::Array3d c = side.features[node].centre;
  c = (c.abs() < 1e-9 * side.model.diagonal()).select(0, c);  // rounding
  if (node < side.graph.faces) {
    const CadFace& face = side.model.faces()[side.graph.face(node)];
    text << "face " << node + 1 << " (" << to_string(face.type);
    if (!face.name.empty()) text << " '" << face.name << "'";
  } else if (node < side.graph.faces + side.graph.curves) {
    text << "edge " << side.graph.curve(node) + 1 << " (length " << side.features[node].size
         << " mm";
  } else {
    text << "vertex " << side.graph.corner(node) + 1 << " (point";
  }
  text << " at " << c.x() << ' ' << c.y() << ' ' << c.z() << " mm)";
  return text.str();
}

}  // namespace cadmorph
