#include "cad/match_side.h"

#include <bit>
#include <cmath>
#include <sstream>

namespace cadmorph {
namespace {

using Eigen::Vector2d;

// Forms are compared after rounding; no tidy number lies on the edge of a bin.
constexpr double kBin = 1.0373e-6, kBinOffset = 0.3719;

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
std::uint64_t use_form(const CadModel& model, int coedge, const Vector2d& unit) {
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

}  // namespace

std::vector<std::uint64_t> entity_forms(const CadModel& model, const EntityGraph& graph) {
  std::vector<std::uint64_t> forms(static_cast<std::size_t>(graph.size()), 0);
  const double length = total_length(model);
  for (int f = 0; f < graph.faces; ++f) {
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

MatchSide make_match_side(const CadModel& model, const GraphOptions& options) {
  MatchSide side{model, build_graph(model, options), entity_features(model), {}};
  side.forms = entity_forms(model, side.graph);
  return side;
}

std::string describe(const MatchSide& side, int node) {
  std::ostringstream text;
  text.precision(4);
  Eigen::Array3d c = side.features[node].centre;
  c = (c.abs() < 1e-9 * side.model.diagonal()).select(0, c);  // rounding
  if (node < side.graph.faces) {
    text << "face " << node + 1 << " (" << to_string(side.model.faces()[node].type);
    if (!side.model.faces()[node].name.empty())
      text << " '" << side.model.faces()[node].name << "'";
  } else if (node < side.graph.faces + side.graph.curves) {
    text << "edge " << node - side.graph.faces + 1 << " (length " << side.features[node].size
         << " mm";
  } else {
    text << "vertex " << node - side.graph.faces - side.graph.curves + 1 << " (point";
  }
  text << " at " << c.x() << ' ' << c.y() << ' ' << c.z() << " mm)";
  return text.str();
}

}  // namespace cadmorph
