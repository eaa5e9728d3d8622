#include "apps/pipeline/surface_stage.h"

#include <algorithm>
#include <sstream>
#include <utility>

#include "core/remedies.h"

namespace cadmorph {
namespace {

// A file may name another unit than its numbers are in.
void check_unit(const CadModel& base, const CadModel& variant, PipelineReport& figures) {
  constexpr double kOtherUnit = 5, kFarOff = 9;  // cm for mm and the like; no design grows so
  const double ratio = variant.diagonal() / base.diagonal();
  const double least = base.file_unit() == variant.file_unit() ? kFarOff : kOtherUnit;
  if (ratio < least && ratio * least > 1) return;
  std::ostringstream text;
  text << variant.file_name() << " (unit " << variant.file_unit() << ") is " << ratio
       << " times the size of " << base.file_name() << " (unit " << base.file_unit()
       << "): if that is not meant, one of them names the wrong unit";
  figures.run.warnings.push_back(text.str());
}

void warn_of_merge(const CadModel& model, PipelineReport& figures) {
  if (model.merged_face_count() == 0) return;
  const int count = model.merged_face_count();
  figures.run.warnings.push_back(
      model.file_name() + ": " + std::to_string(count) +
      (count == 1 ? " face was" : " faces were") +
      " merged with others of the same surface, which the other model has in one piece, or cut "
      "elsewhere");
}

void tell_of_merges(const CadModel& base, const CadModel& variant, PipelineReport& figures) {
  const int count = base.merged_face_count();
  if (count == 0 || count != variant.merged_face_count()) {
    warn_of_merge(base, figures);
    warn_of_merge(variant, figures);
    return;
  }
  figures.run.notes.push_back(
      std::to_string(count) +
      (count == 1 ? " face of both models counts" : " faces of both models count") +
      " as one with others of the same surface: where it is cut is no place of the part");
}

void warn_of_slivers(const CadModel& variant, PipelineReport& figures) {
  const int count = variant.edges_as_points();
  if (count == 0) return;
  const std::string what =
      count == 1 ? " edge was taken for a point" : " edges were taken for points";
  figures.run.warnings.push_back(variant.file_name() + ": " + std::to_string(count) + what +
                                 ": slivers between fillets and cuts, shorter than a thousandth of "
                                 "the part, which the base does not have");
}

// A match that costs as much may be the right one, though cells need not invert where it is.
void warn_of_unclear_match(const CadModel& base, const CadModel& variant,
                           const TopologyMatch& match, PipelineReport& figures) {
  constexpr double kUnclear = 1;  // bit: half as likely
  if (lead(match) >= kUnclear) return;
  std::ostringstream text;
  text.precision(3);
  const std::string others = paired_otherwise(match);
  text << (others.empty() ? "the edges of " : "the faces of ") << variant.file_name()
       << " are paired with those of " << base.file_name() << " in one of two ways that fit alike ("
       << match.cost.sum() << " against " << match.runner_up->cost.sum()
       << " bits speak against them";
  if (!others.empty()) text << "; the other pairs " << others << " of the base otherwise";
  text << "): look at the pairs (" << words_for(Remedy::ListPairs) << ')';
  if (!others.empty())
    text << ", set them by " << words_for(Remedy::FaceMap) << " where they are wrong";
  figures.run.warnings.push_back(text.str());
}

}  // namespace

MorphResult begin_result(std::shared_ptr<const BaseSide> base, const CadModel& variant,
                         TopologyMatch match) {
  MorphResult result;
  result.report = base->report;
  PipelineReport& figures = result.report;
  figures.cad.variant = figures_of(variant);
  check_unit(*base->cad, variant, figures);
  tell_of_merges(*base->cad, variant, figures);
  warn_of_slivers(variant, figures);
  warn_of_unclear_match(*base->cad, variant, match, figures);
  figures.cad.matched_by = match.how;
  figures.cad.alignment = match.alignment;
  if (!match.face_confidence.empty())
    figures.cad.least_confidence = std::ranges::min(match.face_confidence);
  result.base = std::move(base);
  result.variant = variant;
  result.match = std::move(match);
  return result;
}

void move_surface(MorphResult& result) {
  result.surface = result.base->surface->morph(*result.variant, result.match);
  result.surface_positions = result.base->prescribed(result.surface.positions);
  result.report.run.warnings.insert(result.report.run.warnings.end(),
                                    result.surface.warnings.begin(), result.surface.warnings.end());
  result.report.run.notes.insert(result.report.run.notes.end(), result.surface.notes.begin(),
                                 result.surface.notes.end());
  for (const auto& [what, faces] : result.surface.remedies) {
    std::string note = what + ": ";
    for (const std::string& face : faces) note += (face == faces.front() ? "" : "; ") + face;
    result.report.run.notes.push_back(std::move(note));
  }
}

}  // namespace cadmorph
