#include "apps/report/morph_showing.h"

#include <nlohmann/json.hpp>

#include "apps/pipeline/output_file.h"
#include "apps/report/surface_data.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"

namespace cadmorph {
namespace {

std::string surface_note(const nlohmann::ordered_json& surface) {
  if (!surface["is_simplified"]) return "";
  return "Simplified for this page: " + with_commas(surface["facets"].get<Index>()) +
         " triangles of " + with_commas(surface["triangles"].get<Index>()) +
         ", their corners true nodes of the mesh.";
}

}  // namespace

void MorphShowing::collect(const MorphJob& job, const CadModel& variant,
                           const MorphResult& result) {
  const DrawnMesh drawn{.mesh = job.mesh(),
                        .neighbours = job.neighbours(),
                        .before = job.base_quality(),
                        .moved = &result.positions,
                        .after = &result.quality,
                        .unit = unit_name(result.report.mesh_unit_mm)};
  std::vector<Picture> pictures;
  if (!files_.picture.empty()) pictures.push_back(overview(drawn));
  if (!files_.report.empty())
    for (Picture& picture : separate_pictures(drawn)) pictures.push_back(std::move(picture));
  for (const Picture& picture : pictures) names_.push_back(picture.output);
  drawing_.emplace(drawn, std::move(pictures));
  if (files_.report.empty()) return;
  contents_.details = gather_details(job, result);
  contents_.matches = match_tables(job.base(), variant, result.match);
  for (const CadFace& face : variant.faces())
    contents_.variant_face_types.emplace_back(to_string(face.type));
  const nlohmann::ordered_json surface = surface_data(job, result);
  contents_.surface = surface.dump();
  contents_.surface_note = surface_note(surface);
}

ShowReport MorphShowing::write(const PipelineReport& report, int exit_code) {
  ShowReport result;
  contents_.no_picture = drawing_->wait();
  if (contents_.no_picture.empty())
    for (const std::string& name : names_) contents_.pictures[name] = drawing_->png(name);
  else
    result.warnings.push_back("there is no picture: " + contents_.no_picture);
  if (!files_.picture.empty() && contents_.no_picture.empty()) {
    write_text(files_.picture, contents_.pictures[names_.front()]);
    result.written.picture = files_.picture;
  }
  if (!files_.report.empty()) {
    write_text(files_.report, report_page(report, contents_, exit_code));
    result.written.report = files_.report;
  }
  return result;
}

}  // namespace cadmorph
