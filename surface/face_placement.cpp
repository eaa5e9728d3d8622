#include "surface/face_placement.h"

#include <functional>
#include <iterator>
#include <utility>

#include "cad/projector.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "surface/face_unfold.h"
#include "surface/surface_remarks.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Steps of the wires' motion are doubled up to here. With half or twice of this or of kRefinement,
// or with 8 to 64 rings, 14 pairs come out the same; with half the tests of folds pass. With 1 for
// both, parts that stand on each other no longer move alike.
constexpr int kMostSteps = 8;
// Rings of facets round folded ones that are laid out anew, before the whole face is. With 8, cells
// behind facets that are no longer folded were (bore hex at 150 %).
constexpr int kLeastRings = 16, kMostRings = 32;
// Of the samples of a wire, where too few were why a map folded.
constexpr int kRefinement = 4;

// Where the warp puts a node, unless it has its place already.
Vector2d place_on_face(const CadModel& variant, FaceId face, const Placement& placed, RowId row,
                       const Vector2d& warped) {
  if (!placed.is_crossing[row]) return warped;
  return project_on_face(variant, face, placed.feet.row(row), warped).uv;
}

// Whether the outside of a face is that of another solid than in the base: between two solids.
bool is_seen_from_the_other(const ModelPair& pair, FaceId face) {
  const CadFace& shared = pair.base.faces()[face];
  if (shared.other_solid < 0) return false;
  for (const FaceId f : pair.match.faces.ids()) {
    const CadFace& own = pair.base.faces()[f];
    if (own.solid == shared.solid && own.other_solid < 0)
      return pair.variant.faces()[pair.match.faces[f]].solid !=
             pair.variant.faces()[pair.match.faces[face]].solid;
  }
  return false;
}

}  // namespace

// The edges of quadratic cells that are straight within a plane face stay so; `mapped` takes that.
void FacePlacement::place(FaceId face, FaceMapResult& mapped, Placement& placed) const {
  const FaceNodes& nodes = nodes_.faces[face];
  const FaceId variant = pair_.match.faces[face];
  const bool is_turned_over =
      (nodes_.base.faces()[face].is_reversed != pair_.variant.faces()[variant].is_reversed) !=
      is_seen_from_the_other(pair_, face);
  parallel_for(nodes.uv.rows(), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const RowId n = nodes.rows[static_cast<std::size_t>(i)];
      const Vector2d uv = place_on_face(pair_.variant, variant, placed, n, mapped.uv.row(i));
      const SurfacePoint to = pair_.variant.evaluate(variant, uv);
      Vector3d offset = nodes_.offsets.row(n);
      if (is_turned_over) offset.tail<2>() *= -1;
      placed.feet.row(n) = to.point;
      placed.offsets.row(n) = surface_frame(to) * offset;
      placed.uv.row(n) = uv;
      placed.entity[n] = variant;
    }
  });
  if (pair_.variant.faces()[variant].type != SurfaceType::Plane) return;
  for (const Index i : nodes.straight) {
    const RowId n = nodes.rows[i];
    if (placed.is_crossing[n]) continue;
    // What the file's digits leave between node and middle stays.
    const Vector3d off = nodes_.feet.row(n).transpose() - nodes_.surface.middle(n, nodes_.feet);
    const Vector3d middle = nodes_.surface.middle(n, placed.feet);
    const FaceFoot foot = project_on_face(
        pair_.variant, variant, middle + pair_.match.alignment.rotation * off, placed.uv.row(n));
    placed.feet.row(n) = foot.point;
    placed.uv.row(n) = mapped.uv.row(i) = foot.uv;
  }
}

// Once corners and edges are placed.
FaceMotion FacePlacement::motion_of(const FaceNodes& nodes, const Placement& placed) const {
  return {maps_, nodes_.feet(nodes.joints, Eigen::all), placed.feet(nodes.joints, Eigen::all),
          nodes.border};
}

// Replaces a folded map by a finer one, or by projection, where that folds less.
void FacePlacement::unfold(FaceId face, const FaceMapResult& mapped, Placement& placed,
                           PlacedFaces& result) const {
  const FaceNodes& nodes = nodes_.faces[face];
  const FaceMotion motion = motion_of(nodes, placed);
  const FaceId variant = pair_.match.faces[face];
  std::string note = mapped.note;
  const auto find = [&](const Parameters& uv) {
    return nodes.folds.find(nodes_.surface, {pair_.variant, variant, uv, placed.feet});
  };
  std::vector<FacetId> folds = find(mapped.uv);
  // Keeps the other map where it folds less. One that fails leaves what is there.
  const auto improve = [&](const std::function<FaceMapResult()>& map, const char* how) {
    try {
      FaceMapResult other = map();
      const Placement kept = placed.rows(nodes.rows);
      place(face, other, placed);
      auto remaining = find(other.uv);
      if (remaining.size() < folds.size()) {
        folds = std::move(remaining);
        note = how;
      } else {
        placed.set_rows(nodes.rows, kept);
      }
    } catch (const SolverError&) {  // wires that pass through each other on their way, many samples
    }
  };
  if (!folds.empty())
    improve(
        [&] {
          const FaceDomain fine(nodes_.base, face, kRefinement * nodes.samples_per_curve,
                                nodes.joint_uv, nodes.uv);
          return map_face(fine, pair_, motion, nodes.uv, nodes.points);
        },
        "wires sampled finer");
  const auto lay_out = [&](int rings) {
    const Parameters start = placed.uv(nodes.rows, Eigen::all);
    const FaceSide folded{pair_.variant, variant, start, placed.feet};
    return FaceMapResult{
        .uv = rings > 0
                  ? unfold_face(nodes_.surface, nodes.facets, nodes.rows, folded, folds, rings)
                  : unfold_face(nodes_.surface, nodes.facets, nodes.rows, folded)};
  };
  const char* const laid_out = "facets of a folded map laid out anew";
  for (int steps = 2; !folds.empty() && steps <= kMostSteps && !nodes.domain->is_closed();
       steps *= 2)
    improve([&] { return map_face(*nodes.domain, pair_, motion, nodes.uv, nodes.points, steps); },
            "motion of the wires split into steps");
  for (int rings = kLeastRings; !folds.empty() && rings <= kMostRings && !nodes.domain->is_closed();
       rings *= 2)
    improve([&] { return lay_out(rings); }, laid_out);
  if (!folds.empty() && !mapped.is_projected)
    improve([&] { return project_face(*nodes.domain, pair_, motion, nodes.points); },
            "parameter warp folded, predicted positions projected instead");
  if (!folds.empty() && !nodes.domain->is_closed()) improve([&] { return lay_out(0); }, laid_out);
  result.folded.insert(result.folded.end(), folds.begin(), folds.end());
  if (folds.empty() && !note.empty())
    result.remedies[note].push_back(name_of(pair_.base, pair_.match, face));
}

// All faces are placed before any is judged: a facet may have nodes of several.
PlacedFaces FacePlacement::place_all(Placement& placed) const {
  const IdVector<FaceId, FaceNodes>& faces = nodes_.faces;
  PlacedFaces result;
  IdVector<FaceId, FaceMapResult> mapped(faces.size());
  parallel_for(std::ssize(faces), 1, [&](Index begin, Index end) {
    for (FaceId f(begin); f < end; ++f)
      if (const FaceNodes& nodes = faces[f]; !nodes.rows.empty())
        mapped[f] =
            map_face(*nodes.domain, pair_, motion_of(nodes, placed), nodes.uv, nodes.points);
  });
  for (const FaceId f : faces.ids())
    if (!faces[f].rows.empty()) place(f, mapped[f], placed);
  for (const FaceId f : faces.ids())
    if (!faces[f].rows.empty()) unfold(f, mapped[f], placed, result);
  return result;
}

}  // namespace cadmorph
