#include "apps/report/report_page.h"

#include <cmath>
#include <kainjow/mustache.hpp>
#include <nlohmann/json.hpp>

#include "apps/report/base64.h"
#include "apps/report/report_assets.h"
#include "apps/summary/json_report.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "apps/version.h"
#include "core/length_units.h"

namespace cadmorph {
namespace {

using kainjow::mustache::data;
using kainjow::mustache::list;
using kainjow::mustache::mustache;
using kainjow::mustache::partial;
using Json = nlohmann::ordered_json;

data row(std::initializer_list<std::pair<const char*, std::string>> fields) {
  data result;
  for (const auto& [name, value] : fields) result.set(name, value);
  return result;
}

std::string arrow(const std::string& before, const std::string& after) {
  return before + " → " + after;
}

list cards(const PipelineReport& report) {
  const MeshFigures &before = report.before, &after = report.after;
  const auto card = [](const char* label, const std::string& value, const std::string& note) {
    return row({{"label", label}, {"value", value}, {"note", note}});
  };
  std::string beside = with_commas(report.mesh.nodes) + " nodes";
  if (report.mesh.other_cells > 0)
    beside += ", " + with_commas(report.mesh.other_cells) + " of lower dimension";
  return {card("Elements", with_commas(report.mesh.cells - report.mesh.other_cells), beside),
          card("Largest move", millimetres(report.max_displacement),
               format("%.2g of the diagonal", report.max_displacement / report.cad.base.diagonal)),
          card("Least scaled Jacobian",
               arrow(format("%.3f", before.min_scaled_jacobian),
                     format("%.3f", after.min_scaled_jacobian)),
               "mean " + arrow(format("%.3f", before.mean_scaled_jacobian),
                               format("%.3f", after.mean_scaled_jacobian))),
          card("Inverted elements", with_commas(after.invalid),
               with_commas(before.invalid) + " before (exact test)"),
          card("Largest deviation", millimetres(after.max_distance),
               millimetres(before.max_distance) + " before"),
          card("Time", format("%.2f s", report.run.seconds),
               format("%d thread%s", report.run.threads, report.run.threads == 1 ? "" : "s"))};
}

list before_after(const std::vector<std::vector<std::string>>& rows) {
  list result;
  for (const auto& cells : rows)
    result.push_back(row({{"name", cells[0]}, {"before", cells[1]}, {"after", cells[2]}}));
  return result;
}

data bins(const Histogram& histogram, const char* pattern, bool is_logarithm) {
  const std::size_t count = histogram.before.size();
  const auto edge = [&](std::size_t i) {
    const double share = static_cast<double>(i) / static_cast<double>(count);
    const double value = histogram.low + share * (histogram.high - histogram.low);
    char text[32];
    std::snprintf(text, sizeof text, pattern, is_logarithm ? std::pow(10, value) : value);
    return std::string(text);
  };
  list rows;
  for (std::size_t i = 0; i < count; ++i)
    if (histogram.before[i] + histogram.after[i] > 0)
      rows.push_back(row({{"from", edge(i)},
                          {"to", edge(i + 1)},
                          {"before", with_commas(histogram.before[i])},
                          {"after", with_commas(histogram.after[i])}}));
  data result;
  result.set("bins", rows);
  return result;
}

list worst_rows(const PageContents& contents) {
  list result;
  for (const WorstElement& element : contents.details.worst) {
    std::string face = "none";
    if (element.face >= 0)
      face = std::to_string(element.face + 1) + " " + contents.variant_face_types[element.face];
    result.push_back(row({{"row", std::to_string(result.size())},
                          {"cell", element.name.substr(element.name.find(' ') + 1)},
                          {"before", format("%.4f", element.before)},
                          {"after", format("%.4f", element.after)},
                          {"x", format("%.5g", element.centre[0])},
                          {"y", format("%.5g", element.centre[1])},
                          {"z", format("%.5g", element.centre[2])},
                          {"face", face}}));
  }
  return result;
}

list match_lists(const std::vector<MatchTable>& tables) {
  list result;
  for (const MatchTable& table : tables) {
    list rows;
    for (const MatchTable::Row& pair : table.rows)
      rows.push_back(row({{"base", pair.base},
                          {"variant", pair.variant},
                          {"confidence", pair.confidence},
                          {"name", pair.name}}));
    data entry = row({{"title", table.kind + " (" + with_commas(table.rows.size()) + ")"}});
    entry.set("rows", rows);
    entry.set("is_open", result.empty());
    result.push_back(entry);
  }
  return result;
}

list phase_rows(const PipelineReport& report) {
  double longest = 0;
  for (const PhaseTime& phase : report.run.phases) longest = std::max(longest, phase.seconds);
  list result;
  for (const PhaseTime& phase : report.run.phases)
    result.push_back(row({{"name", phase.name},
                          {"seconds", format("%.2f", phase.seconds)},
                          {"percent", format("%.1f", 100 * phase.seconds / longest)}}));
  return result;
}

list group_rows(const PipelineReport& report) {
  list result;
  for (const GroupFigures& group : report.mesh.groups)
    result.push_back(row({{"name", group.name},
                          {"kind", group.kind},
                          {"nodes", with_commas(group.nodes)},
                          {"move", millimetres(group.max_displacement)}}));
  return result;
}

list picture_list(const PipelineReport& report, const PageContents& contents) {
  struct Caption {
    const char *file, *title;
    std::string note;
  };
  list result;
  for (const Caption& caption :
       {Caption{"base.png", "Base", contents.pictured_base.filename().string()},
        Caption{"variant.png", "Variant", report.cad.variant.file.filename().string()},
        Caption{"displacement.png", "Displacement",
                "light: 0, dark blue: " + millimetres(contents.pictured_move)},
        Caption{"cut.png", "Cut open", "the worst 5 % of the elements in red"}}) {
    const auto bytes = contents.pictures.find(caption.file);
    if (bytes == contents.pictures.end()) continue;
    result.push_back(
        row({{"title", caption.title}, {"note", caption.note}, {"data", base64(bytes->second)}}));
  }
  return result;
}

Json to_json(const Histogram& histogram) {
  return {{"low", histogram.low},
          {"high", histogram.high},
          {"before", histogram.before},
          {"after", histogram.after}};
}

Json to_json(const MorphDetails& details) {
  Json worst = Json::array();
  for (const WorstElement& element : details.worst)
    worst.push_back({{"cell", element.cell},
                     {"before", element.before},
                     {"after", element.after},
                     {"centre", std::vector<double>(element.centre.begin(), element.centre.end())},
                     {"face", element.face + 1}});
  return {{"scaled_jacobian", to_json(details.scaled_jacobian)},
          {"deviation", to_json(details.deviation)},
          {"worst", worst}};
}

// The page's data as a script element holds it: a closing tag in a name must not end it.
std::string page_json(const PipelineReport& report, const PageContents& contents, int exit_code) {
  std::string json = R"({"report":)" + to_json(report, exit_code) + R"(,"details":)" +
                     to_json(contents.details).dump() + R"(,"surface":)" + contents.surface + "}";
  for (std::size_t i = json.find("</"); i != std::string::npos; i = json.find("</", i))
    json.replace(i, 2, "<\\/");
  return json;
}

std::string outcome_text(const PipelineReport& report) {
  switch (report.outcome) {
    case Outcome::Done:
      return "Done";
    case Outcome::Inverted:
      return "Refused: inverted elements remain";
    case Outcome::PoorQuality:
      return "Refused: the quality is below what was asked";
  }
  return "";
}

std::string deviation_note(const MorphDetails& details) {
  if (details.exact_before + details.exact_after == 0) return "";
  if (details.deviation.is_empty())
    return "All surface nodes lie on their CAD entities, before and after: no chart is drawn.";
  return "Nearer than " + format("%.0e", std::pow(10, details.deviation.low)) +
         " mm, and not counted above: " + with_commas(details.exact_before) + " nodes before, " +
         with_commas(details.exact_after) + " after.";
}

std::string match_note(const PipelineReport& report) {
  std::string text = "Matched by " + report.cad.matched_by +
                     format(
                         "; least confidence of a face %.2f. Seams, and vertices that only "
                         "cut a smooth edge, are no matter of matching and not counted here.",
                         report.cad.least_confidence);
  if (!report.legs.empty())
    text = "Of the last of " + std::to_string(report.legs.size()) +
           " morphs in series, as the 3D view, the pictures and the charts are. " + text;
  return text;
}

void set_words(data& page, const PipelineReport& report) {
  page.set("version", kVersion);
  page.set("title", report.mesh.file.filename().string() + " onto " +
                        report.cad.variant.file.filename().string());
  page.set("subtitle", "from " + report.cad.base.file.string() + " to " +
                           report.cad.variant.file.string() +
                           "; written: " + report.run.written.string());
  page.set("is_good", report.outcome == Outcome::Done);
  page.set("outcome", outcome_text(report));
  list warnings;
  for (const std::string& warning : report.run.warnings) warnings.push_back(warning);
  page.set("has_warnings", !warnings.empty());
  page.set("warnings", warnings);
  if (report.diagnosis)
    page.set("diagnosis", bad_cells_text(report) + "\n" + diagnosis_text(*report.diagnosis));
  list notes;
  for (const std::string& note : report.run.notes) notes.push_back(note);
  page.set("has_notes", !notes.empty());
  page.set("notes", notes);
  page.set("unit", unit_name(report.mesh.unit_mm));
  page.set("match_note", match_note(report));
  page.set("seconds", format("%.2f", report.run.seconds));
  page.set("summary", summary_text(report));
}

}  // namespace

std::vector<MatchTable> match_tables(const CadModel& base, const CadModel& variant,
                                     const TopologyMatch& match) {
  MatchTable faces{.kind = "Faces", .rows = {}}, edges{.kind = "Edges", .rows = {}},
      vertices{.kind = "Vertices", .rows = {}};
  const auto face = [](const CadModel& model, FaceId f) {
    return std::to_string(f + 1) + " " + to_string(model.faces()[f].type);
  };
  for (const FaceId f : match.faces.ids())
    faces.rows.push_back({face(base, f), face(variant, match.faces[f]),
                          format("%.2f", match.face_confidence[f]), base.faces()[f].name});
  for (const CurveId c : match.curves.ids())
    edges.rows.push_back({std::to_string(c + 1), std::to_string(match.curves[c] + 1),
                          format("%.2f", match.curve_confidence[c]), ""});
  for (const CornerId v : match.corners.ids())
    vertices.rows.push_back({std::to_string(v + 1), std::to_string(match.corners[v] + 1),
                             format("%.2f", match.corner_confidence[v]), ""});
  return {std::move(faces), std::move(edges), std::move(vertices)};
}

std::string report_page(const PipelineReport& report, const PageContents& contents, int exit_code) {
  data page;
  set_words(page, report);
  page.set("cards", cards(report));
  page.set("has_viewer", !kPageScript.empty());
  page.set("surface_note",
           contents.surface_note.empty() ? data(false) : data(contents.surface_note));
  page.set("no_picture", contents.no_picture.empty() ? data(false) : data(contents.no_picture));
  page.set("pictures", picture_list(report, contents));
  auto quality = quality_rows(report.before, report.after);
  for (auto& cells : layer_rows(report.layers)) quality.push_back(std::move(cells));
  page.set("quality", before_after(quality));
  page.set("distances", before_after(distance_rows(report)));
  page.set("jacobian", bins(contents.details.scaled_jacobian, "%.2f", false));
  page.set("has_deviation", !contents.details.deviation.is_empty());
  page.set("deviation", bins(contents.details.deviation, "%.1e", true));
  page.set("deviation_note", deviation_note(contents.details));
  page.set("bin_table", partial([] { return std::string(kBinTableTemplate); }));
  page.set("worst", worst_rows(contents));
  page.set("matches", match_lists(contents.matches));
  page.set("has_groups", !report.mesh.groups.empty());
  page.set("groups", group_rows(report));
  page.set("phases", phase_rows(report));
  page.set("style", std::string(kPageStyle));
  page.set("script", std::string(kPageScript));
  page.set("licences", std::string(kPageLicences));
  page.set("data", page_json(report, contents, exit_code));
  mustache html{std::string(kPageTemplate)};
  return html.render(page);
}

}  // namespace cadmorph
