#include "apps/summary/summary.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/summary/text_table.h"
#include "core/length_units.h"
#include "core/remedies.h"

namespace cadmorph {
namespace {

constexpr int kLabelWidth = 14;  // columns: the longest label and two blanks

// A result is worth a hint when its smallest scaled Jacobian is poor, and below this part of the
// base's, or the base's is poor, too; and when the mean of its worst elements is below that part.
// A free choice: the hint alone depends on it.
constexpr double kLoss = 0.5;

// An input's poor elements are no news where the worst came out better by this factor, the least
// that raising is taken for.
constexpr double kRisen = 1.01;

// First cells of layers that keep a smaller share of their heights, or grow as much, are told of.
constexpr double kLayerLoss = 0.5;
// So are those that lean by so many degrees more: their second nodes are beside the first ones by
// another third of the height (tan 20 degrees = 0.36), where a wall treatment takes them to be
// above.
constexpr double kLayerLeanDeg = 20;

std::string cad_line(const CadFigures& cad) {
  return cad.file.string() + format(" (%s faces, %s edges, %s vertices; unit %s; diagonal %.4g mm)",
                                    with_commas(cad.faces).c_str(), with_commas(cad.edges).c_str(),
                                    with_commas(cad.vertices).c_str(), cad.unit.c_str(),
                                    cad.diagonal);
}

std::string mesh_line(const MeshReport& mesh) {
  std::string cells = with_commas(mesh.cells - mesh.other_cells) + " cells";
  if (mesh.other_cells > 0)
    cells += " and " + with_commas(mesh.other_cells) + " of lower dimension";
  return mesh.file.string() + format(" (%s, %s nodes, %s; unit %s, %s)", mesh.format.c_str(),
                                     with_commas(mesh.nodes).c_str(), cells.c_str(),
                                     unit_name(mesh.unit_mm).c_str(),
                                     mesh.is_unit_detected ? "detected" : "given");
}

std::string node_line(const MeshReport& mesh) {
  std::string text =
      format("%s vertex, %s edge, %s face, %s interior", with_commas(mesh.vertex_nodes).c_str(),
             with_commas(mesh.edge_nodes).c_str(), with_commas(mesh.face_nodes).c_str(),
             with_commas(mesh.interior_nodes).c_str());
  if (mesh.amid_nodes > 0)
    text += ", " + with_commas(mesh.amid_nodes) + " amid straight edges off the CAD";
  if (mesh.unmatched_nodes > 0)
    text += ", " + with_commas(mesh.unmatched_nodes) + " on no CAD face";
  if (mesh.loose_nodes > 0)
    text += format(
        "; %s of the interior ones in no %s element, they move with what is next to them or tied "
        "to them",
        with_commas(mesh.loose_nodes).c_str(), mesh.has_solids ? "volume" : "shell");
  return text;
}

std::string distance(double length, double diagonal) {
  if (length == 0 || diagonal == 0) return millimetres(length);
  return millimetres(length) + format(" (%.1e)", length / diagonal);
}

using Row = std::vector<std::string>;

std::string before_after_table(const PipelineReport& report) {
  std::vector<Row> rows = {{"", "before", "after"}};
  for (Row& row : distance_rows(report)) rows.push_back(std::move(row));
  for (Row& row : quality_rows(report.before, report.after)) rows.push_back(std::move(row));
  if (report.layers.are_growing())
    for (Row& row : layer_rows(report.layers)) rows.push_back(std::move(row));
  return align(rows);
}

std::string group_table(const std::vector<GroupFigures>& groups) {
  constexpr std::size_t kShown = 24;  // lines of a small terminal
  std::vector<Row> rows = {{"Named part", "kind", "nodes", "largest move"}};
  for (std::size_t i = 0; i < std::min(groups.size(), kShown); ++i)
    rows.push_back({groups[i].name, groups[i].kind, with_commas(groups[i].nodes),
                    millimetres(groups[i].max_displacement)});
  std::string text = align(rows);
  if (groups.size() > kShown)
    text += format("and %zu more: %s has all\n", groups.size() - kShown,
                   words_for(Remedy::AllFigures).c_str());
  return text;
}

std::string solver_line(const PipelineReport& report) {
  const RbfReport& solver = report.solver;
  const int steps = report.stepping.steps;
  const std::string steps_text = format("; %d step%s", steps, steps == 1 ? "" : "s");
  if (report.mesh.interior_nodes == 0)
    return "none, whatever the method, the kernel and the steps: no node lies inside, the warps of "
           "the CAD's faces move all";
  if (report.method != MorphMethod::Rbf)
    return to_string(report.method) + ", " + with_commas(solver.centres) + " surface nodes" +
           steps_text;
  std::string text = to_string(report.kernel) + ", " + with_commas(solver.centres) + " centres, " +
                     to_string(solver.solver);
  if (!solver.reason.empty()) text += " (" + solver.reason + ")";
  if (solver.reciprocal_condition > 0) text += format(", rcond %.1e", solver.reciprocal_condition);
  if (solver.iterations > 0 && solver.solver == SolverKind::Fast)
    text += format(", %d iterations", solver.iterations);
  return text + steps_text;
}

std::string attempts_line(const SteppingReport& stepping) {
  std::string text;
  for (const SteppingAttempt& attempt : stepping.attempts)
    text += format("%s%d: %s", text.empty() ? "" : ", ", attempt.steps,
                   with_commas(attempt.inverted).c_str());
  return text;
}

std::string time_line(const RunReport& run) {
  std::string text = format("%.2f s:", run.seconds);
  const char* separator = " ";
  for (const PhaseTime& phase : run.phases) {
    if (phase.seconds < 0.005) continue;
    text += separator + phase.name + format(" %.2f", phase.seconds);
    separator = ", ";
  }
  return text;
}

std::string machine_line(const RunReport& run) {
  return format("%.0f MiB peak memory, %d thread%s, BLAS kernel %s",
                run.peak_memory / (1024.0 * 1024.0), run.threads, run.threads == 1 ? "" : "s",
                run.blas_kernel.empty() ? "unknown" : run.blas_kernel.c_str());
}

std::string slid_part(Index slid_nodes) {
  return slid_nodes > 0 ? "; " + with_commas(slid_nodes) + " surface nodes slid on the CAD" : "";
}

std::string untangle_line(const UntangleReport& report) {
  return format("%s inverted elements left of %s; %s nodes free, moved at most %.3g mesh units",
                with_commas(report.after).c_str(), with_commas(report.before).c_str(),
                with_commas(report.moved_nodes).c_str(), report.max_move) +
         slid_part(report.slid_nodes);
}

std::string improve_line(const ImproveReport& report) {
  return format("%s elements below %g, %s before; smallest scaled Jacobian from %.4f to %.4f",
                with_commas(report.poor_after).c_str(), report.below,
                with_commas(report.poor_before).c_str(), report.min_before, report.min_after) +
         slid_part(report.slid_nodes);
}

std::string kept_layers_line(const KeptLayers& kept) {
  if (kept.columns == 0) return "none: no layers that grow from a wall were found";
  return with_commas(kept.kept) + " of " + with_commas(kept.columns) +
         " columns of nodes on the wall at their old heights" +
         (kept.partly > 0 ? ", " + with_commas(kept.partly) + " in part" : "");
}

std::string best_mesh_line(const BestMeshReport& report) {
  const WorstCells &plain = report.plain, &best = report.best;
  const std::string figures =
      report.is_by_faces
          ? format(
                "worst face from %.1f to %.1f degrees, mean of the worst 5 %% of the cells from "
                "%.1f to %.1f",
                face_angle(plain.min), face_angle(best.min), face_angle(plain.worst_twentieth),
                face_angle(best.worst_twentieth))
          : format(
                "smallest scaled Jacobian from %.4f to %.4f, mean of the worst 5 %% from %.4f "
                "to %.4f",
                plain.min, best.min, plain.worst_twentieth, best.worst_twentieth);
  return figures +
         format("; %td of %td attempts taken",
                std::ranges::count(report.attempts, true, &RaiseAttempt::is_taken),
                std::ssize(report.attempts)) +
         slid_part(report.slid_nodes);
}

std::string leg_text(const LegReport& leg) {
  const int steps = leg.stepping.steps;
  return leg.cad.file.filename().string() +
         format(": %d step%s, smallest scaled Jacobian %.4f, %s invalid, %.2f s", steps,
                steps == 1 ? "" : "s", leg.after.min_scaled_jacobian,
                with_commas(leg.after.invalid).c_str(), leg.seconds);
}

// What a flow's wall treatment feels.
std::string layer_hint(const PipelineReport& report) {
  const LayerFigures& layers = report.layers;
  const bool are_other = layers.least <= kLayerLoss || layers.most >= 1 / kLayerLoss;
  const bool are_leaning = layers.lean_after >= layers.lean_before + kLayerLeanDeg;
  if (report.outcome != Outcome::Done || !layers.are_growing() || (!are_other && !are_leaning))
    return "";
  return (are_other
              ? format("first cells of layers are %.3g to %.3g times as high as in the input, and "
                       "y+ with them: ",
                       layers.least, layers.most)
              : format("first cells of layers lean by %.0f degrees off the surface's normal, in "
                       "the input by %.0f (worst 5 %%): ",
                       layers.lean_after, layers.lean_before)) +
         (report.kept_layers ? "" : "try " + words_for(Remedy::KeepLayers) + ", or ") +
         "mesh the variant anew where that is too much for the wall treatment";
}

// One bad element of the input hides what many others lost.
bool have_many_lost(const PipelineReport& report) {
  return report.after.poor > report.before.poor &&
         report.after.worst_twentieth < kLoss * report.before.worst_twentieth;
}

bool has_lost(const PipelineReport& report) {
  return have_many_lost(report) ||
         report.after.min_scaled_jacobian < kLoss * report.before.min_scaled_jacobian;
}

// What would raise the worst element where it is poor; empty where it is not.
std::string quality_hint(const PipelineReport& report) {
  const double before = report.before.min_scaled_jacobian;
  const double after = report.after.min_scaled_jacobian;
  const bool many = have_many_lost(report), is_lost = has_lost(report), is_poor = after < kPoor;
  // Cells of finite volumes may have no Jacobian to speak of in the input already.
  if (report.outcome != Outcome::Done || !report.can_repair || (before <= 0 && !many) ||
      (report.improving && !is_poor))
    return "";
  if (!is_lost && !is_poor) return "";
  const std::string worst =
      many ? with_commas(report.after.poor) + " elements have a scaled Jacobian below 0.1"
           : format("the worst element's scaled Jacobian is %.4f", after);
  const std::string of_input =
      ", in the input " + (many ? with_commas(report.before.poor) : format("%.4f", before));
  if (report.improving)
    return worst + of_input + ": improving could not raise it further; " +
           (is_lost ? "go in several steps (" + words_for(Remedy::MoreSteps) +
                          ") or by CAD models between (" + words_for(Remedy::Via) +
                          "), or mesh finer there"
            : before < kPoor
                ? "the input mesh has such elements already: mesh anew with other sizes"
                : "mesh the variant anew where that is too little for the solver");
  if (!is_lost && after > kRisen * before) return "";
  // What the input has already, improving hardly raises.
  if (!is_lost && before < kPoor)
    return worst + of_input + ", which is poor already: mesh anew with other sizes";
  // Improving is for solid elements, and of no use where raising was.
  const bool was_raised = report.best_mesh && !report.best_mesh->attempts.empty();
  if (!is_poor || !report.mesh.has_solids || was_raised)
    return worst + of_input + ": mesh the variant anew where that is too little for the solver";
  return worst + of_input + ": " + format("try %s %g", words_for(Remedy::Improve).c_str(), kPoor);
}

}  // namespace

std::vector<std::string> hints(const PipelineReport& report, HintsOn on) {
  std::vector<std::string> result = {layer_hint(report)};
  if (on == HintsOn::All || has_lost(report)) result.insert(result.begin(), quality_hint(report));
  std::erase(result, "");
  return result;
}

namespace {

// The physical edges and vertices, numbered from 1.
std::string edge_table(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  std::vector<Row> rows = {{"base edge", "length", "variant edge", "length", "confidence"}};
  for (const CurveId c : match.curves.ids())
    rows.push_back({std::to_string(c + 1), millimetres(base.skeleton().curves[c].length),
                    std::to_string(match.curves[c] + 1),
                    millimetres(variant.skeleton().curves[match.curves[c]].length),
                    format("%.2f", match.curve_confidence[c])});
  std::string text("\n");
  text += align(rows);
  if (match.corners.empty()) return text;
  const auto place = [](const CadModel& model, CornerId corner) {
    const Eigen::Vector3d& p = model.vertices()[model.skeleton().corners[corner]].point;
    return format("%.6g %.6g %.6g", p.x(), p.y(), p.z());
  };
  rows = {{"base vertex", "at (mm)", "variant vertex", "at (mm)", "confidence"}};
  for (const CornerId c : match.corners.ids())
    rows.push_back({std::to_string(c + 1), place(base, c), std::to_string(match.corners[c] + 1),
                    place(variant, match.corners[c]), format("%.2f", match.corner_confidence[c])});
  return text.append("\n").append(align(rows));
}

}  // namespace

std::string labelled(std::string label, const std::string& text) {
  label.resize(kLabelWidth, ' ');
  return label + text + "\n";
}

std::string to_string(const Kernel& kernel) {
  switch (kernel.kind) {
    case KernelKind::Gaussian:
      return "Gaussian";
    case KernelKind::Multiquadric:
      return "multiquadric";
    case KernelKind::InverseMultiquadric:
      return "inverse multiquadric";
    case KernelKind::WendlandC2:
      return "Wendland C2";
    case KernelKind::WendlandC4:
      return "Wendland C4";
    case KernelKind::Polyharmonic:
      break;
  }
  switch (kernel.order) {
    case 2:
      return "biharmonic";
    case 3:
      return "triharmonic";
    case 4:
      return "quadharmonic";
    default:
      return format("polyharmonic of order %d", kernel.order);
  }
}

std::string to_string(SolverKind solver) {
  switch (solver) {
    case SolverKind::Lu:
      return "LU";
    case SolverKind::Ldlt:
      return "LDLT";
    case SolverKind::Cholesky:
      return "Cholesky";
    case SolverKind::Iqr:
      return "incremental QR";
    case SolverKind::Fast:
      return "fast";
    case SolverKind::Adaptive:
      return "adaptive";
    case SolverKind::Auto:
      break;
  }
  return "none needed";
}

std::string to_string(CacheUse use) {
  switch (use) {
    case CacheUse::Used:
      return "used";
    case CacheUse::Written:
      return "written";
    case CacheUse::NotWritten:
      return "not written";
    case CacheUse::None:
      break;
  }
  return "none";
}

std::string rounding_text(const CoordinateRounding& rounding) {
  return format(
      "coordinates rounded to the file's digits: %.1e of the shortest edge at most "
      "(%.1e mesh units)",
      rounding.relative, rounding.largest);
}

std::string cache_text(const CacheReport& cache) {
  const std::string file = cache.file.string();
  if (cache.use == CacheUse::Used) return "read from " + file;
  return (cache.use == CacheUse::Written ? "kept in " : "could not be kept in ") + file;
}

std::vector<Row> distance_rows(const PipelineReport& report) {
  return {{"Distance to CAD, max (of diagonal)",
           distance(report.before.max_distance, report.cad.base.diagonal),
           distance(report.after.max_distance, report.cad.variant.diagonal)},
          {"Distance to CAD, mean (of diagonal)",
           distance(report.before.mean_distance, report.cad.base.diagonal),
           distance(report.after.mean_distance, report.cad.variant.diagonal)}};
}

std::vector<Row> quality_rows(const MeshFigures& before, const MeshFigures& after) {
  const auto row = [](const char* name, const char* pattern, double a, double b) {
    return Row{name, format(pattern, a), format(pattern, b)};
  };
  const auto counts = [](const char* name, Index a, Index b) {
    return Row{name, with_commas(a), with_commas(b)};
  };
  std::vector<Row> rows = {
      row("Scaled Jacobian, min", "%.4f", before.min_scaled_jacobian, after.min_scaled_jacobian),
      row("Scaled Jacobian, mean", "%.4f", before.mean_scaled_jacobian, after.mean_scaled_jacobian),
      row("Scaled Jacobian, mean of the worst 5 %", "%.4f", before.worst_twentieth,
          after.worst_twentieth),
      counts("Elements below 0.1", before.poor, after.poor),
      counts("Inverted elements (corner Jacobians)", before.inverted, after.inverted),
      counts("Invalid elements (exact test)", before.invalid, after.invalid)};
  const QualityChecks &a = before.checks, &b = after.checks;
  if (!a.has_cells()) return rows;
  rows.push_back(row("Non-orthogonality, max (deg)", "%.1f", a.max_non_orthogonality_deg,
                     b.max_non_orthogonality_deg));
  rows.push_back(row("Skewness, max", "%.2f", a.max_skewness, b.max_skewness));
  rows.push_back(row("Aspect ratio, max", "%.1f", a.max_aspect_ratio, b.max_aspect_ratio));
  return rows;
}

std::vector<Row> layer_rows(const LayerFigures& layers) {
  if (layers.cells == 0) return {};
  std::vector<Row> rows{
      {"First cells that moved, heights within 1 %", with_commas(layers.cells) + " cells",
       format("%.1f %%", 100 * layers.share_kept)},
      {"First cells that moved, height times", "1",
       format("%.3g to %.3g", layers.least, layers.most)}};
  rows.push_back({"Lean of first cells off the normal, worst 5 % (deg)",
                  format("%.1f", layers.lean_before), format("%.1f", layers.lean_after)});
  if (layers.growth_after > 0)
    rows.push_back({"Growth from first to second cell, mean", format("%.3f", layers.growth_before),
                    format("%.3f", layers.growth_after)});
  return rows;
}

std::string summary_text(const PipelineReport& report) {
  std::string text;
  text += labelled("Base CAD", cad_line(report.cad.base));
  text += labelled("Variant CAD", cad_line(report.cad.variant));
  text += labelled("Mesh", mesh_line(report.mesh));
  text += labelled("Matched by", report.cad.matched_by + format(" (least confidence %.2f)",
                                                                report.cad.least_confidence));
  text += labelled("Nodes", node_line(report.mesh));
  text += labelled("Volume morph", solver_line(report));
  if (report.stepping.attempts.size() > 1)
    text += labelled("Steps tried", attempts_line(report.stepping) + " inverted");
  if (report.followed_nodes > 0)
    text += labelled("Followed", with_commas(report.followed_nodes) +
                                     " surface nodes slid with what moves beside them");
  if (report.kept_layers) text += labelled("Layers", kept_layers_line(*report.kept_layers));
  if (report.best_mesh && !report.best_mesh->attempts.empty())
    text += labelled("Raised", best_mesh_line(*report.best_mesh));
  if (report.improving) text += labelled("Improving", improve_line(*report.improving));
  if (report.untangling) text += labelled("Untangling", untangle_line(*report.untangling));
  for (std::size_t i = 0; i < report.legs.size(); ++i)
    text += labelled(format("Leg %zu", i + 1), leg_text(report.legs[i]));
  text += labelled("Largest move", millimetres(report.max_displacement));
  text.append("\n").append(before_after_table(report)).append("\n");
  if (!report.mesh.groups.empty()) text.append(group_table(report.mesh.groups)).append("\n");
  for (const std::string& hint : hints(report)) text += labelled("Hint", hint);
  if (report.run.cache.use != CacheUse::None)
    text += labelled("Base set-up", cache_text(report.run.cache));
  text += labelled("Time", time_line(report.run));
  text += labelled("Machine", machine_line(report.run));
  if (report.run.rounding.node >= 0)
    text += labelled("Rounding", rounding_text(report.run.rounding));
  if (!report.run.written.empty())
    text += labelled(report.outcome == Outcome::Done ? "Written" : "Refused",
                     report.run.written.string());
  return text;
}

std::string bad_cells_text(const PipelineReport& report) {
  const Index bad = report.diagnosis->bad_cells;
  const std::string what = with_commas(bad) + (bad == 1 ? " element" : " elements");
  if (report.outcome == Outcome::Inverted)
    return what + (bad == 1 ? " is inverted" : " are inverted");
  return what + (bad == 1 ? " has" : " have") +
         format(" a scaled Jacobian below %g", report.min_asked);
}

std::string refusal_text(const PipelineReport& report) {
  return bad_cells_text(report) + "; the refused mesh is " + report.run.written.string() +
         " (cell array cadmorph_bad)";
}

std::string diagnosis_text(const Diagnosis& diagnosis) {
  std::string text = "  the worst is " + diagnosis.worst_name +
                     format(" at (%.6g, %.6g, %.6g)", diagnosis.location[0], diagnosis.location[1],
                            diagnosis.location[2]);
  if (diagnosis.regions.size() > 1 || diagnosis.regions.front().first != 0)
    text += format(", most in region %d (%s)", diagnosis.regions.front().first,
                   with_commas(diagnosis.regions.front().second).c_str());
  text += "\n";
  if (diagnosis.face >= 0) {
    text += format("  nearest CAD face: %d (%s", diagnosis.face + 1, diagnosis.face_type.c_str());
    text += (diagnosis.face_name.empty() ? "" : ", " + diagnosis.face_name) + ")\n";
  }
  if (diagnosis.first_inversion < 1)
    text += format("  the first inversion appears at %.0f %% of the change\n",
                   100 * diagnosis.first_inversion);
  for (const std::string& advice : diagnosis.advice) text += "  try: " + advice + "\n";
  return text;
}

std::string quality_text(const std::filesystem::path& file, const Mesh& mesh,
                         const QualityReport& quality, const ValidityReport& validity,
                         const QualityChecks& checks) {
  const auto cell = [&](Index c) { return c < 0 ? std::string() : cell_name(mesh, c); };
  std::string text = labelled("Mesh", file.string());
  text += labelled("Nodes", with_commas(mesh.node_count()));
  text += labelled("Cells", with_commas(static_cast<Index>(quality.values.size())) + ", " +
                                with_commas(quality.cells) + " of them measured");
  std::vector<Row> rows = {
      {"", "value", "worst", "above the limit"},
      {"Scaled Jacobian, min", format("%.4f", quality.min), cell(quality.worst_cell)},
      {"Scaled Jacobian, mean", format("%.4f", quality.mean)},
      {"Inverted elements (corner Jacobians)", with_commas(quality.inverted),
       quality.inverted ? cell(quality.inverted_cells.front()) : ""},
      {"Invalid elements (exact test)", with_commas(validity.invalid),
       validity.invalid ? cell(validity.invalid_cells.front()) : ""}};
  if (checks.has_cells()) {
    rows.push_back({"Non-orthogonality, max (deg)",
                    format("%.1f", checks.max_non_orthogonality_deg),
                    cell(checks.worst_non_orthogonal_cell),
                    with_commas(checks.severely_non_orthogonal) + " faces > 70"});
    rows.push_back(
        {"Non-orthogonality, mean (deg)", format("%.1f", checks.mean_non_orthogonality_deg)});
    rows.push_back({"Skewness, max", format("%.2f", checks.max_skewness),
                    cell(checks.worst_skew_cell), with_commas(checks.highly_skew) + " faces > 4"});
    rows.push_back({"Aspect ratio, max", format("%.1f", checks.max_aspect_ratio),
                    cell(checks.worst_aspect_cell),
                    with_commas(checks.high_aspect) + " cells > 1000"});
    rows.push_back({dimension(mesh) == 3 ? "Smallest volume, by corners (mesh unit cubed)"
                                         : "Smallest area, by corners (mesh unit squared)",
                    format("%.3e", checks.min_volume)});
  }
  return text.append("\n").append(align(rows));
}

std::string match_text(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  std::string text = labelled("Base CAD", base.file_name() + " (unit " + base.file_unit() + ")");
  text += labelled("Variant CAD", variant.file_name() + " (unit " + variant.file_unit() + ")");
  text += labelled("Matched by", match.how);
  text += labelled("Counts", format("%zu faces, %zu edges, %zu vertices (seams not counted)",
                                    match.faces.size(), match.curves.size(), match.corners.size()));
  if (base.merged_face_count() + variant.merged_face_count() > 0)
    text +=
        labelled("Merged", format("%d faces of the base and %d of the variant with others of the "
                                  "same surface",
                                  base.merged_face_count(), variant.merged_face_count()));
  std::vector<Row> rows = {{"base face", "type", "variant face", "type", "confidence", "name"}};
  for (const FaceId f : match.faces.ids()) {
    const CadFace& from = base.faces()[f];
    const CadFace& to = variant.faces()[match.faces[f]];
    rows.push_back({std::to_string(f + 1), to_string(from.type), std::to_string(match.faces[f] + 1),
                    to_string(to.type), format("%.2f", match.face_confidence[f]), from.name});
  }
  text.append("\n").append(align(rows));
  if (match.joins_edges)
    return text + edge_table(base.with_joined_edges(), variant.with_joined_edges(), match);
  return text + edge_table(base, variant, match);
}

std::vector<std::pair<std::string, double>> cost_terms(const MatchCost& cost) {
  return {{"deformation", cost.deformation},
          {"neighbours", cost.neighbours},
          {"lengths", cost.lengths},
          {"parameters", cost.parameters},
          {"turn", cost.turn},
          {"rest", cost.rest},
          {"passing", cost.passing},
          {"order", cost.order},
          {"names", cost.names},
          {"joints", cost.joints}};
}

std::string cost_text(const TopologyMatch& match) {
  std::vector<Row> rows = {{"cost in bits", "taken"}};
  for (const auto& [name, bits] : cost_terms(match.cost))
    rows.push_back({name, format("%.1f", bits)});
  rows.push_back({"sum", format("%.1f", match.cost.sum())});
  if (!match.runner_up) return "\n" + align(rows) + "No other match was found or looked for.\n";
  const MatchCost& other = match.runner_up->cost;
  rows.front().push_back("runner-up: " + match.runner_up->how);
  std::size_t row = 1;
  for (const auto& [name, bits] : cost_terms(other)) rows[row++].push_back(format("%.1f", bits));
  rows[row].push_back(format("%.1f", other.sum()));
  const std::string others = paired_otherwise(match);
  return "\n" + align(rows) + "The runner-up pairs " +
         (others.empty() ? "the same faces, but not their edges"
                         : others + " of the base otherwise") +
         ".\n";
}

}  // namespace cadmorph
