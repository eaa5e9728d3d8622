#include "apps/report/morph_showing.h"

#include <nlohmann/json.hpp>

#include "apps/pipeline/output_file.h"
#include "apps/report/surface_data.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "core/length_units.h"

namespace cadmorph {
namespace {

std::string surface_note(const nlohmann::ordered_json& surface) {
  if (!surface["is_simplified"]) return "";
  return "Simplified for this page: " + with_commas(surface["facets"].get<Index>()) +
         " triangles of " + with_commas(surface["triangles"].get<Index>()) +
         ", their corners true nodes of the mesh.";
}

// Writes a file, or tells why not; returns whether it is there.
bool try_to_write(const std::filesystem::path& file, const std::string& text, ShowReport& result) {
  try {
    write_text(file, text);
    return true;
  } catch (const OutputError& error) {
    result.failures.emplace_back(error.what());
    return false;
  }
}

}  // namespace

void MorphShowing::collect(const MorphResult& result) {
  try {
    draw(result);
    if (!files_.report.empty()) describe(result);
  } catch (const std::exception& error) {
    failure_ = error.what();
  }
}

void MorphShowing::draw(const MorphResult& result) {
  const DrawnMesh drawn{.mesh = result.base->mesh(),
                        .neighbours = result.base->neighbours,
                        .before = result.base->quality,
                        .moved = &result.positions,
                        .after = &result.quality,
                        .unit = unit_name(result.report.mesh.unit_mm)};
  std::vector<Picture> pictures;
  if (!files_.picture.empty()) {
    pictures.push_back(overview(drawn));
    overview_ = pictures.back().output;
  }
  if (!files_.report.empty())
    for (Picture& picture : separate_pictures(drawn)) pictures.push_back(std::move(picture));
  drawing_.emplace(drawn, std::move(pictures));
}

void MorphShowing::describe(const MorphResult& result) {
  contents_.pictured_base = result.report.cad.base.file;
  contents_.pictured_move = result.report.max_displacement;
  contents_.details = gather_details(result);
  contents_.matches = match_tables(*result.base->cad, *result.variant, result.match);
  for (const CadFace& face : result.variant->faces())
    contents_.variant_face_types.emplace_back(to_string(face.type));
  const nlohmann::ordered_json surface = surface_data(result);
  contents_.surface = surface.dump();
  contents_.surface_note = surface_note(surface);
}

ShowReport MorphShowing::write(PipelineReport& report, int exit_code) {
  ShowReport result;
  if (!failure_.empty()) {
    result.failures.push_back("can't show the result: " + failure_);
    return result;
  }
  PhaseClock clock;
  clock.start("pictures");
  DrawnPictures drawn = drawing_->wait();
  report.run.phases.push_back(clock.phases().front());
  report.run.seconds += report.run.phases.back().seconds;
  contents_.pictures = std::move(drawn.bytes);
  contents_.no_picture = std::move(drawn.failure);
  if (!contents_.no_picture.empty())
    result.warnings.push_back("there is no picture: " + contents_.no_picture);
  else if (!files_.picture.empty() &&
           try_to_write(files_.picture, contents_.pictures[overview_], result))
    result.written.picture = files_.picture;
  if (!files_.report.empty() &&
      try_to_write(files_.report, report_page(report, contents_, exit_code), result))
    result.written.report = files_.report;
  return result;
}

}  // namespace cadmorph
