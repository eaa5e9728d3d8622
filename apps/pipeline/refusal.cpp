#include "apps/pipeline/refusal.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "apps/pipeline/nearest_face.h"
#include "core/plane_mesh.h"
#include "core/remedies.h"
#include "volume/held_cells.h"

namespace cadmorph {
namespace {

constexpr double kWrongPairs = 0.05;  // of all cells: more than a large change inverts as a rule
constexpr double kHardlyMore = 3;     // bits: a match that costs no more is an eighth as likely
constexpr double kCollapsed = 0.1;    // what is kept of the worst elements' quality, at most

std::vector<Index> sorted_union(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> result;
  std::ranges::set_union(a, b, std::back_inserter(result));
  return result;
}

std::vector<Index> sorted_difference(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> result;
  std::ranges::set_difference(a, b, std::back_inserter(result));
  return result;
}

std::string short_number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string percent(double share) {
  return std::to_string(std::max(1, static_cast<int>(std::floor(100 * share)))) + " %";
}

// A mesh in the plane that was turned over within it: all cells run the other way round.
bool is_turned_over(const MorphResult& result) {
  const Mesh& mesh = result.base->mesh();
  const Eigen::Vector3d normal = plane_normal(mesh, mesh.points);
  return !normal.isZero(0) && plane_normal(mesh, result.positions) == -normal;
}

std::vector<Index> inverted_in_base(const BaseSide& base) {
  return sorted_union(base.validity.invalid_cells, base.quality.inverted_cells);
}

// Shell cells that the surface folds: what inverts a cell between solids.
std::vector<Index> folded_shells(const MorphResult& result) {
  const BaseSide& base = *result.base;
  std::vector<Index> cells;
  if (is_turned_over(result)) {
    for (Index c = 0; c < base.mesh().cell_count(); ++c)
      if (dimension(base.mesh().types[c]) == 2) cells.push_back(c);
    return cells;
  }
  for (const FacetId f : result.surface.folded_facets)
    if (const Index c = base.boundary.cell[f]; dimension(base.mesh().types[c]) == 2)
      cells.push_back(c);
  std::ranges::sort(cells);
  return cells;
}

// Cells the result is refused for: invalid ones, and those whose corners inverted on the way.
std::vector<Index> inverted_cells(const MorphResult& result) {
  const BaseSide& base = *result.base;
  const auto corners =
      sorted_difference(result.quality.inverted_cells, base.quality.inverted_cells);
  const auto invalid =
      base.options.accept_inverted_input
          ? sorted_difference(result.validity.invalid_cells, inverted_in_base(base))
          : result.validity.invalid_cells;
  return sorted_union(sorted_union(invalid, corners), folded_shells(result));
}

// What an accepted result has of inverted elements.
void tell_of_inverted(MorphResult& result) {
  const Index count = std::ssize(result.validity.invalid_cells);
  if (count == 0) return;
  result.report.run.warnings.push_back(
      std::to_string(count) + (count == 1 ? " element is" : " elements are") +
      " inverted, as in the input mesh (" + words_for(Remedy::InvertedInput) + ")");
}

// A valid mesh may be as useless to a solver as an inverted one.
void tell_of_collapse(MorphResult& result) {
  const MeshFigures &before = result.report.before, &after = result.report.after;
  if (!(after.worst_twentieth < kCollapsed * before.worst_twentieth)) return;
  result.report.run.warnings.push_back(
      "the mesh is valid, but hardly of use: the scaled Jacobian of its worst 5 % fell from " +
      short_number(before.worst_twentieth) + " to " + short_number(after.worst_twentieth) +
      " on the mean, " + std::to_string(after.poor) + " elements are below " + short_number(kPoor) +
      " (" + std::to_string(before.poor) + " in the input): go there by CAD models between (" +
      words_for(Remedy::Via) + "), or mesh the variant anew");
}

std::vector<Index> poor_cells(const MorphResult& result) {
  const auto& asked = result.base->options.min_scaled_jacobian;
  if (!asked) return {};
  return cells_below(*asked, result.quality);
}

Index worst_of(const std::vector<Index>& cells, const QualityReport& quality) {
  return *std::ranges::min_element(
      cells, {}, [&](Index c) { return std::isnan(quality.values[c]) ? 1.0 : quality.values[c]; });
}

// Those of the inverted cells that no move of the inner nodes can help.
Index held_among(const std::vector<Index>& inverted, const BaseSide& base, const Points& full) {
  const std::vector<char> is_fixed = base.fixed_nodes();
  return std::ranges::count_if(inverted, [&](Index c) {
    return dimension(base.mesh().types[c]) == 3 &&
           is_held(base.mesh(), full, is_fixed, base.orientation, c);
  });
}

std::vector<std::string> advice(const MorphResult& result) {
  const PipelineOptions& options = result.base->options;
  const PipelineReport& figures = result.report;
  std::vector<std::string> lines;
  const Diagnosis& found = *figures.diagnosis;
  const bool is_inverted = figures.outcome == Outcome::Inverted;
  const Index made = found.bad_cells - found.bad_in_base;
  const bool are_many =
      static_cast<double>(made) > kWrongPairs * static_cast<double>(figures.mesh.cells);
  const bool is_unclear = made > 0 && lead(result.match) < kHardlyMore;
  if (is_inverted && (are_many || is_unclear))
    lines.push_back("look at the pairs of faces (" + words_for(Remedy::ListPairs) + "): " +
                    std::string(is_unclear
                                    ? "others fit hardly worse"
                                    : "so many cells invert where faces are paired wrongly") +
                    " (set pairs by " + words_for(Remedy::FaceMap) +
                    (are_many ? "), or the variant is a mirror image" : ")"));
  if (found.misordered > 0)
    lines.push_back(
        "put the nodes of cells in the order of their type where the mesh comes from: " +
        std::to_string(found.misordered) + " are inverted in the input by their order alone");
  if (found.bad_in_base > found.misordered)
    lines.push_back(
        "repair the input mesh: " + std::to_string(found.bad_in_base - found.misordered) +
        " of these cells are inverted in it already" +
        (made == 0 ? ", and no others here: accept them by " + words_for(Remedy::InvertedInput)
                   : ""));
  if (!is_inverted && found.poor_in_base > 0)
    lines.push_back(
        "ask for less, or better the input mesh: " + std::to_string(found.poor_in_base) +
        " of these cells are below in it already, whose smallest scaled Jacobian is " +
        short_number(figures.before.min_scaled_jacobian));
  if (is_inverted && made > 0 && found.dragged_patches > 0)
    lines.push_back("let parts on no CAD face slide with what moves along them (" +
                    words_for(Remedy::SlideUnmatched) + "): it touches " +
                    std::to_string(found.dragged_patches) + " that stay fixed");
  if (found.parted_nodes > 0)
    lines.push_back("look whether parts still meet in the variant as they do in the base: " +
                    std::to_string(found.parted_nodes) +
                    " nodes left one of two parts, as where a foot outgrows what it stands on");
  else if (found.held_cells > 0)
    lines.push_back(
        "refine the mesh: " + std::to_string(found.held_cells) +
        " of these cells are held inverted by their surface nodes alone (all nodes lie on "
        "the surface, or facets on it turn an edge or a corner inwards)");
  if (found.folded_shells > 0 && found.folded_shells < figures.mesh.cells)
    lines.push_back("go there by CAD models between (" + words_for(Remedy::Via) +
                    "), and look whether all sheets still meet where they did");
  if (figures.outcome == Outcome::PoorQuality && options.can_repair && !options.improve_below)
    lines.push_back("raise the poor cells: " + words_for(Remedy::Improve) + " " +
                    short_number(*options.min_scaled_jacobian));
  if (is_inverted && made > 0 && options.can_repair && options.untangle == UntangleMode::Never)
    lines.push_back("let the inverted cells be repaired: " +
                    words_for(Remedy::AutomaticUntangling));
  if (is_inverted && made > 0 && options.stepping.steps > 0)
    lines.push_back("let the number of steps grow: " + words_for(Remedy::AutomaticSteps));
  const double share = found.first_inversion;
  if (share > 0 && share < 1)
    lines.push_back("morph to a smaller change (below " + percent(share) +
                    " of this one), go there by CAD models between (" + words_for(Remedy::Via) +
                    "), or remesh there with more elements across the moved gap");
  return lines;
}

}  // namespace

std::vector<Index> cells_below(double limit, const QualityReport& quality) {
  std::vector<Index> result;
  for (Index c = 0; c < static_cast<Index>(quality.values.size()); ++c)
    if (quality.values[c] < limit) result.push_back(c);
  return result;
}

std::vector<Index> bad_cells(const MorphResult& result) {
  return sorted_union(inverted_cells(result), poor_cells(result));
}

void judge(MorphResult& result) {
  const BaseSide& base = *result.base;
  const auto inverted = inverted_cells(result);
  const auto poor = poor_cells(result);
  const auto bad = sorted_union(inverted, poor);
  if (inverted.empty()) tell_of_inverted(result);
  if (inverted.empty()) tell_of_collapse(result);
  if (bad.empty()) return;
  PipelineReport& figures = result.report;
  figures.min_asked = base.options.min_scaled_jacobian.value_or(0);
  figures.outcome = inverted.empty() ? Outcome::PoorQuality : Outcome::Inverted;
  const Points full = base.volume->morph(result.surface_positions);
  const auto positions_at = [&](double share) -> Points {
    return base.mesh().points + share * (full - base.mesh().points);
  };
  figures.diagnosis = diagnose(base, bad, positions_at);
  figures.diagnosis->folded_shells = static_cast<Index>(folded_shells(result).size());
  figures.after.invalid += figures.diagnosis->folded_shells;
  figures.diagnosis->poor_in_base = std::ranges::count_if(
      poor, [&](Index c) { return base.quality.values[c] < *base.options.min_scaled_jacobian; });
  figures.diagnosis->misordered = std::ssize(base.misordered);
  figures.diagnosis->parted_nodes = result.surface.parted.nodes;
  figures.diagnosis->dragged_patches = result.surface.dragged_patches;
  figures.diagnosis->held_cells =
      held_among(sorted_difference(inverted, base.validity.invalid_cells), base, full);
  figures.diagnosis->worst_cell = worst_of(bad, result.quality);
  figures.diagnosis->worst_name = cell_name(base.mesh(), figures.diagnosis->worst_cell);
  figures.diagnosis->location =
      centre_of(base.mesh().cell(figures.diagnosis->worst_cell), result.positions);
  figures.diagnosis->advice = advice(result);
}

}  // namespace cadmorph
