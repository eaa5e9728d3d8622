#include "apps/summary/json_report.h"

#include "apps/summary/json_text.h"
#include "apps/summary/summary.h"
#include "core/length_units.h"

namespace cadmorph {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const Eigen::Vector3d& v) {
  return {json_number(v[0]), json_number(v[1]), json_number(v[2])};
}

Json to_json(const CadFigures& cad) {
  return {{"file", cad.file.string()},
          {"unit", cad.unit},
          {"faces", cad.faces},
          {"edges", cad.edges},
          {"vertices", cad.vertices},
          {"solids", cad.solids},
          {"diagonal_mm", json_number(cad.diagonal)}};
}

Json to_json(const QualityChecks& checks) {
  if (!checks.has_cells()) return nullptr;
  return {{"max_non_orthogonality_deg", json_number(checks.max_non_orthogonality_deg)},
          {"mean_non_orthogonality_deg", json_number(checks.mean_non_orthogonality_deg)},
          {"faces_above_70_deg", checks.severely_non_orthogonal},
          {"max_skewness", json_number(checks.max_skewness)},
          {"faces_above_skewness_4", checks.highly_skew},
          {"max_aspect_ratio", json_number(checks.max_aspect_ratio)},
          {"cells_above_aspect_1000", checks.high_aspect},
          {"min_volume", json_number(checks.min_volume)}};
}

Json to_json(const MeshFigures& figures, double diagonal) {
  const double per_diagonal = diagonal > 0 ? 1 / diagonal : 0;
  return {{"max_distance_mm", json_number(figures.max_distance)},
          {"mean_distance_mm", json_number(figures.mean_distance)},
          {"max_distance_per_diagonal", json_number(figures.max_distance * per_diagonal)},
          {"mean_distance_per_diagonal", json_number(figures.mean_distance * per_diagonal)},
          {"min_scaled_jacobian", json_number(figures.min_scaled_jacobian)},
          {"mean_scaled_jacobian", json_number(figures.mean_scaled_jacobian)},
          {"worst_twentieth", json_number(figures.worst_twentieth)},
          {"cells_below_0.1", figures.poor},
          {"worst_cell", figures.worst_cell},
          {"inverted_corner_jacobian", figures.inverted},
          {"invalid_exact", figures.invalid},
          {"checks", to_json(figures.checks)}};
}

Json to_json(const RbfReport& report, const Kernel& kernel) {
  return {{"kernel", to_string(kernel)},
          {"solver", to_string(report.solver)},
          {"reason", report.reason},
          {"centres", report.centres},
          {"merged_centres", report.merged},
          {"polynomial_terms", report.polynomial_terms},
          {"reciprocal_condition", json_number(report.reciprocal_condition)},
          {"iterations", report.iterations},
          {"max_residual_local_lengths", json_number(report.max_residual)},
          {"seconds", json_number(report.seconds)}};
}

Json to_json(const SteppingReport& stepping) {
  Json attempts = Json::array();
  for (const SteppingAttempt& attempt : stepping.attempts)
    attempts.push_back({{"steps", attempt.steps}, {"invalid", attempt.inverted}});
  return {{"steps", stepping.steps}, {"attempts", attempts}};
}

Json to_json(const UntangleReport& report) {
  return {{"invalid_before", report.before},
          {"invalid_after", report.after},
          {"free_nodes", report.moved_nodes},
          {"slid_nodes", report.slid_nodes},
          {"rings", report.rings},
          {"max_move", json_number(report.max_move)},
          {"seconds", json_number(report.seconds)}};
}

Json to_json(const Diagnosis& diagnosis) {
  Json regions = Json::array();
  for (const auto& [region, cells] : diagnosis.regions)
    regions.push_back({{"region", region}, {"bad_cells", cells}});
  return {{"bad_cells", diagnosis.bad_cells},
          {"bad_in_base", diagnosis.bad_in_base},
          {"poor_in_base", diagnosis.poor_in_base},
          {"misordered", diagnosis.misordered},
          {"held_cells", diagnosis.held_cells},
          {"folded_shells", diagnosis.folded_shells},
          {"worst_cell", diagnosis.worst_cell},
          {"worst_name", diagnosis.worst_name},
          {"location", to_json(diagnosis.location)},
          {"regions", regions},
          {"nearest_face", diagnosis.face + 1},
          {"nearest_face_type", diagnosis.face_type},
          {"nearest_face_name", diagnosis.face_name},
          {"first_inversion_share", json_number(diagnosis.first_inversion)},
          {"advice", diagnosis.advice}};
}

Json to_json(const LayerFigures& layers) {
  return {{"first_cells", layers.cells},
          {"share_within_1_percent", json_number(layers.share_kept)},
          {"least_height_ratio", json_number(layers.least)},
          {"most_height_ratio", json_number(layers.most)},
          {"lean_of_worst_twentieth_before_deg", json_number(layers.lean_before)},
          {"lean_of_worst_twentieth_after_deg", json_number(layers.lean_after)},
          {"mean_growth_before", json_number(layers.growth_before)},
          {"mean_growth_after", json_number(layers.growth_after)}};
}

Json to_json(const WorstCells& worst, bool is_by_faces) {
  if (is_by_faces)
    return {{"worst_face_deg", json_number(face_angle(worst.min))},
            {"worst_twentieth_deg", json_number(face_angle(worst.worst_twentieth))}};
  return {{"min_scaled_jacobian", json_number(worst.min)},
          {"worst_twentieth", json_number(worst.worst_twentieth)}};
}

std::string to_string(RaiseBy by) {
  switch (by) {
    case RaiseBy::MidNodes:
      return "nodes amid edges";
    case RaiseBy::SweptRows:
      return "rows of a sweep";
    case RaiseBy::WallRows:
      return "rows through walls";
    case RaiseBy::InnerNodes:
      return "inner nodes";
    case RaiseBy::SlidingNodes:
      return "inner and sliding nodes";
  }
  return {};
}

Json to_json(const BestMeshReport& best) {
  const bool is_by_faces = best.is_by_faces;
  Json attempts = Json::array();
  for (const RaiseAttempt& attempt : best.attempts)
    attempts.push_back({{"by", to_string(attempt.by)},
                        {"power", attempt.power},
                        {"cells", attempt.cells},
                        {"passes", json_number(attempt.passes)},
                        {"after", to_json(attempt.after, is_by_faces)},
                        {"is_taken", attempt.is_taken}});
  return {{"judged_by", is_by_faces ? "faces" : "scaled Jacobian"},
          {"base", to_json(best.base, is_by_faces)},
          {"plain", to_json(best.plain, is_by_faces)},
          {"best", to_json(best.best, is_by_faces)},
          {"attempts", attempts},
          {"slid_nodes", best.slid_nodes},
          {"seconds", json_number(best.seconds)}};
}

Json to_json(const MeshReport& mesh) {
  return {{"file", mesh.file.string()},
          {"format", mesh.format},
          {"remarks", mesh.remarks},
          {"nodes", mesh.nodes},
          {"cells", mesh.cells},
          {"cells_of_lower_dimension", mesh.other_cells},
          {"unit", unit_name(mesh.unit_mm)},
          {"unit_mm", mesh.unit_mm},
          {"is_unit_detected", mesh.is_unit_detected}};
}

Json nodes_json(const MeshReport& mesh) {
  return {{"vertex", mesh.vertex_nodes},       {"edge", mesh.edge_nodes},
          {"face", mesh.face_nodes},           {"amid_straight_edges", mesh.amid_nodes},
          {"unmatched", mesh.unmatched_nodes}, {"interior", mesh.interior_nodes},
          {"loose", mesh.loose_nodes}};
}

Json to_json(const std::vector<GroupFigures>& groups) {
  Json json = Json::array();
  for (const GroupFigures& group : groups)
    json.push_back({{"name", group.name},
                    {"kind", group.kind},
                    {"nodes", group.nodes},
                    {"max_displacement_mm", json_number(group.max_displacement)}});
  return json;
}

Json to_json(const LegReport& leg) {
  Json json = {{"cad", to_json(leg.cad)},
               {"matched_by", leg.matched_by},
               {"after", to_json(leg.after, leg.cad.diagonal)},
               {"stepping", to_json(leg.stepping)}};
  if (leg.untangling) json["untangling"] = to_json(*leg.untangling);
  json["seconds"] = json_number(leg.seconds);
  return json;
}

Json to_json(const std::vector<PhaseTime>& phases) {
  Json result = Json::object();
  for (const PhaseTime& phase : phases) result[phase.name] = phase.seconds;
  return result;
}

Json to_json(const CacheReport& cache) {
  return {{"file", cache.file.string()}, {"use", to_string(cache.use)}, {"remark", cache.remark}};
}

const char* outcome_name(Outcome outcome) {
  switch (outcome) {
    case Outcome::Done:
      return "done";
    case Outcome::Inverted:
      return "inverted elements";
    case Outcome::PoorQuality:
      return "quality below what was asked";
  }
  return "";
}

// Edges are the physical ones (CadSkeleton::curves), numbered from 1.
Json matched_edges(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  Json edges = Json::array();
  for (const CurveId c : match.curves.ids()) {
    const CadCurve& from = base.skeleton().curves[c];
    const CadCurve& to = variant.skeleton().curves[match.curves[c]];
    Json faces = Json::array();
    for (const FaceId f : from.faces) faces.push_back(f + 1);
    edges.push_back({{"base", c + 1},
                     {"variant", match.curves[c] + 1},
                     {"base_faces", faces},
                     {"base_length", json_number(from.length)},
                     {"variant_length", json_number(to.length)},
                     {"confidence", json_number(match.curve_confidence[c])}});
  }
  return edges;
}

Json matched_vertices(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  const auto point = [](const CadModel& model, CornerId corner) {
    const Eigen::Vector3d& p = model.vertices()[model.skeleton().corners[corner]].point;
    return Json{json_number(p.x()), json_number(p.y()), json_number(p.z())};
  };
  Json vertices = Json::array();
  for (const CornerId c : match.corners.ids())
    vertices.push_back({{"base", c + 1},
                        {"variant", match.corners[c] + 1},
                        {"base_point", point(base, c)},
                        {"variant_point", point(variant, match.corners[c])},
                        {"confidence", json_number(match.corner_confidence[c])}});
  return vertices;
}

}  // namespace

std::string to_json(const PipelineReport& report, int exit_code) {
  Json json = json_header(exit_code);
  json["outcome"] = outcome_name(report.outcome);
  json["base_cad"] = to_json(report.cad.base);
  json["variant_cad"] = to_json(report.cad.variant);
  json["mesh"] = to_json(report.mesh);
  json["nodes"] = nodes_json(report.mesh);
  json["groups"] = to_json(report.mesh.groups);
  json["match"] = {{"how", report.cad.matched_by},
                   {"least_confidence", json_number(report.cad.least_confidence)},
                   {"scale", json_number(report.cad.alignment.scale)}};
  json["before"] = to_json(report.before, report.cad.base.diagonal);
  json["after"] = to_json(report.after, report.cad.variant.diagonal);
  json["max_displacement_mm"] = json_number(report.max_displacement);
  json["max_surface_displacement_mm"] = json_number(report.max_surface_displacement);
  if (report.layers.are_growing()) json["layers"] = to_json(report.layers);
  if (report.kept_layers)
    json["kept_layers"] = {{"columns", report.kept_layers->columns},
                           {"kept", report.kept_layers->kept},
                           {"partly", report.kept_layers->partly},
                           {"seconds", json_number(report.kept_layers->seconds)}};
  json["method"] = to_string(report.method);
  json["volume_morph"] = report.method == MorphMethod::Rbf
                             ? to_json(report.solver, report.kernel)
                             : Json{{"surface_nodes", report.solver.centres},
                                    {"seconds", json_number(report.solver.seconds)}};
  json["stepping"] = to_json(report.stepping);
  if (report.untangling) json["untangling"] = to_json(*report.untangling);
  json["followed_nodes"] = report.followed_nodes;
  if (report.best_mesh) json["best_mesh"] = to_json(*report.best_mesh);
  if (report.improving)
    json["improving"] = {{"below", report.improving->below},
                         {"poor_before", report.improving->poor_before},
                         {"poor_after", report.improving->poor_after},
                         {"slid_nodes", report.improving->slid_nodes},
                         {"min_before", json_number(report.improving->min_before)},
                         {"min_after", json_number(report.improving->min_after)}};
  if (report.diagnosis) json["diagnosis"] = to_json(*report.diagnosis);
  for (const LegReport& leg : report.legs) json["legs"].push_back(to_json(leg));
  if (report.run.cache.use != CacheUse::None) json["cache"] = to_json(report.run.cache);
  json["warnings"] = report.run.warnings;
  json["hints"] = hints(report);
  json["notes"] = report.run.notes;
  json["seconds"] = to_json(report.run.phases);
  json["seconds"]["total"] = report.run.seconds;
  json["peak_memory_bytes"] = report.run.peak_memory;
  json["threads"] = report.run.threads;
  json["blas_kernel"] = report.run.blas_kernel;
  json["written"] = report.run.written.string();
  if (report.run.rounding.node >= 0)
    json["rounding"] = {{"largest", json_number(report.run.rounding.largest)},
                        {"of_shortest_edge", json_number(report.run.rounding.relative)},
                        {"node", report.run.rounding.node}};
  return json_text(json);
}

std::string quality_json(const std::filesystem::path& mesh, Index nodes,
                         const QualityReport& quality, const ValidityReport& validity,
                         const QualityChecks& checks, int exit_code) {
  Json json = json_header(exit_code);
  json["mesh"] = mesh.string();
  json["nodes"] = nodes;
  json["cells"] = quality.values.size();
  json["measured_cells"] = quality.cells;
  json["min_scaled_jacobian"] = json_number(quality.min);
  json["mean_scaled_jacobian"] = json_number(quality.mean);
  json["worst_cell"] = quality.worst_cell;
  json["inverted_corner_jacobian"] = quality.inverted;
  json["invalid_exact"] = validity.invalid;
  json["invalid_cells"] = validity.invalid_cells;
  json["checks"] = to_json(checks);
  return json_text(json);
}

namespace {

Json cost_json(const MatchCost& cost) {
  Json json;
  for (const auto& [name, bits] : cost_terms(cost)) json[name] = json_number(bits);
  json["sum"] = json_number(cost.sum());
  return json;
}

}  // namespace

std::string match_json(const CadModel& base, const CadModel& variant, const TopologyMatch& match) {
  Json json = json_header(0);
  json["base"] = base.file_name();
  json["variant"] = variant.file_name();
  json["how"] = match.how;
  json["scale"] = json_number(match.alignment.scale);
  json["cost"] = cost_json(match.cost);
  if (match.runner_up)
    json["runner_up"] = {{"how", match.runner_up->how}, {"cost", cost_json(match.runner_up->cost)}};
  json["merged_faces"] = {{"base", base.merged_face_count()},
                          {"variant", variant.merged_face_count()}};
  Json faces = Json::array();
  for (const FaceId f : match.faces.ids())
    faces.push_back({{"base", f + 1},
                     {"variant", match.faces[f] + 1},
                     {"base_type", to_string(base.faces()[f].type)},
                     {"variant_type", to_string(variant.faces()[match.faces[f]].type)},
                     {"confidence", json_number(match.face_confidence[f])},
                     {"name", base.faces()[f].name}});
  json["faces"] = faces;
  const CadModel base_edges = match.joins_edges ? base.with_joined_edges() : base;
  const CadModel variant_edges = match.joins_edges ? variant.with_joined_edges() : variant;
  json["edges"] = matched_edges(base_edges, variant_edges, match);
  json["vertices"] = matched_vertices(base_edges, variant_edges, match);
  return json_text(json);
}

bool is_json_report(const std::string& text) {
  const std::string header = json_text(json_header(0));
  return text.starts_with(header.substr(0, header.find(',')));
}

std::string error_json(const std::string& message, int exit_code) {
  Json json = json_header(exit_code);
  json["outcome"] = "error";
  json["error"] = message;
  return json_text(json);
}

}  // namespace cadmorph
