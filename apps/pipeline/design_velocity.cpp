#include "apps/pipeline/design_velocity.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <limits>
#include <sstream>

#include "apps/pipeline/output_file.h"
#include "core/errors.h"
#include "surface/surface_remarks.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

// A step is refused that moves the surface by less than the CAD's tolerance, and warned of below
// this many of it: the velocity may be off by more than 1 % then.
constexpr double kSureMotion = 100;

// The base is about midway between both models where it is nearer to the middle than this part of
// the motion: a central difference keeps that part of the error of a one-sided one.
constexpr double kUneven = 0.1;

// The direction of a motion chooses the kernels, not its size: it is this part of the mesh's size,
// small, but far above the 1e-9 below which a surface counts as the base's (is_at_base).
constexpr double kSmallMotion = 1e-6;

// Of the largest velocity: below, a node rests but for rounding.
constexpr double kRests = 1e-9;

double largest(const RowMatrix& rows) {
  return rows.rows() == 0 ? 0 : rows.rowwise().norm().maxCoeff();
}

Points base_surface(const MorphJob& job) {
  return job.base().mesh().points(job.base().volume->surface_nodes(), Eigen::all);
}

// Of the surface nodes, where `present` is not empty there.
Points positions(const MorphJob& job, const Points& present) {
  return present.rows() > 0 ? present : base_surface(job);
}

// Empty where these are the base's: no motion chooses kernels and anchors then.
Points unless_at_base(const MorphJob& job, const Points& present) {
  return present.rows() > 0 && job.base().is_at_base(present) ? Points() : present;
}

double typical_tolerance(const CadModel& cad) {
  std::vector<double> tolerances;
  for (const CadEdge& edge : cad.edges()) tolerances.push_back(edge.tolerance);
  if (tolerances.empty()) return 0;
  const auto middle = tolerances.begin() + std::ssize(tolerances) / 2;
  std::nth_element(tolerances.begin(), middle, tolerances.end());
  return *middle;
}

std::string text_of(double value) {
  std::ostringstream text;
  text.precision(3);
  text << value;
  return text.str();
}

// Whether the step is one that differences can be taken of.
void judge(const ParameterModels& models, SurfaceVelocity& result) {
  const std::string pair = models.plus.file_name() + " and " + models.minus.file_name();
  const std::string figures = "the step of " + text_of(models.step) + " between " + pair +
                              " moves the surface by " + text_of(result.motion) +
                              " mm at most, and the CAD's tolerance is " +
                              text_of(result.cad_tolerance) + " mm";
  if (result.motion == 0) {
    result.warnings.push_back(pair + " have the same surface: nothing moves with this parameter");
    return;
  }
  if (result.motion < result.cad_tolerance)
    throw InvalidInputError(figures + ": the difference would be noise; take a larger step");
  if (result.motion < kSureMotion * result.cad_tolerance)
    result.warnings.push_back(figures + ": the velocity may be off by up to " +
                              text_of(100 * result.cad_tolerance / result.motion) +
                              " %; take a larger step");
  if (result.unevenness > kUneven)
    result.warnings.push_back(
        std::string(result.present.rows() > 0 ? "the present surface" : "the base") +
        " is not midway between " + pair + ", by " + text_of(100 * result.unevenness) +
        " % of the motion: take a smaller step, or see to it that they are its parameter plus "
        "and minus the step");
}

// Where the surface nodes are whose map carries a velocity: at the base a little in its direction,
// which chooses the kernels and anchors; elsewhere the motion so far does.
Points towards(const MorphJob& job, const SurfaceVelocity& surface) {
  const double speed = largest(surface.velocity);
  if (surface.present.rows() > 0 || speed == 0) return positions(job, surface.present);
  const Points& all = job.base().mesh().points;
  const double size = (all.colwise().maxCoeff() - all.colwise().minCoeff()).norm();
  return base_surface(job) + kSmallMotion * size / speed * surface.velocity;
}

void check_sensitivity(const RowMatrix& sensitivity, Index nodes) {
  if (sensitivity.rows() != nodes || sensitivity.cols() != 3)
    throw InvalidInputError("dJ/dX has " + std::to_string(sensitivity.rows()) + " rows of " +
                            std::to_string(sensitivity.cols()) + "; expected 3 for each of " +
                            std::to_string(nodes) + " nodes");
  for (Index i = 0; i < nodes; ++i)
    if (!sensitivity.row(i).allFinite())
      throw InvalidInputError("dJ/dX of node " + std::to_string(i) + " is not finite");
}

std::shared_ptr<const MeshFile> open_mesh(const fs::path& path) {
  return std::make_shared<const MeshFile>(path);
}

void add_new(std::vector<std::string>& to, const std::vector<std::string>& lines) {
  for (const std::string& line : lines)
    if (std::ranges::find(to, line) == to.end()) to.push_back(line);
}

// A table of some markers is right where dJ/dX of the rest is zero. `moves`: of each surface node,
// whether a parameter moves it.
std::vector<std::string> warn_of_missing(const MorphJob& job, const std::vector<char>& moves,
                                         const std::vector<char>& is_given) {
  if (is_given.empty()) return {};
  const std::vector<Index>& nodes = job.base().volume->surface_nodes();
  Index moved = 0, missing = 0;
  for (std::size_t i = 0; i < moves.size(); ++i) {
    moved += moves[i];
    missing += moves[i] && !is_given[nodes[i]];
  }
  if (missing == 0) return {};
  return {"the parameters move " + std::to_string(moved) + " surface nodes, of which " +
          std::to_string(missing) + " are not in the table of dJ/dX: that of these counts as zero"};
}

}  // namespace

ParameterModels next_models(StepQueue& queue, double step) {
  CadModel plus = queue.next();
  CadModel minus = queue.next();
  return {std::move(plus), std::move(minus), step};
}

SurfaceVelocity surface_velocity(const MorphJob& job, const ParameterModels& models,
                                 const Points& present) {
  if (!(models.step > 0) || !std::isfinite(models.step))
    throw InvalidInputError("the step " + text_of(models.step) + " of a parameter is not positive");
  const MorphResult plus = job.morph_surface(models.plus);
  const MorphResult minus = job.morph_surface(models.minus);
  const double unit = plus.report.mesh.unit_mm;
  const Points apart = plus.surface_positions - minus.surface_positions;
  const Points bent =
      plus.surface_positions + minus.surface_positions - 2 * positions(job, present);
  SurfaceVelocity result;
  result.velocity = apart / (2 * models.step);
  if (!result.velocity.allFinite())
    throw InvalidInputError("the step " + text_of(models.step) +
                            " of a parameter is too small to divide by");
  result.present = unless_at_base(job, present);
  result.step = models.step;
  result.motion = 0.5 * unit * largest(apart);
  result.cad_tolerance = typical_tolerance(*job.base().cad);
  result.unevenness = result.motion > 0 ? largest(bent) / largest(apart) : 0;
  for (const MorphResult* side : {&plus, &minus}) {
    add_new(result.warnings, side->report.run.warnings);
    add_new(result.warnings,
            describe_folds(*side->base->cad, side->match, side->base->association(),
                           side->surface.folded_facets));
  }
  judge(models, result);
  return result;
}

SurfaceVelocity surface_velocity(const MorphJob& job, const ParameterModels& models,
                                 const ParameterModels& half, const Points& present) {
  constexpr double kRounding = 1e-12;  // of the steps, which are read or computed
  if (!(std::abs(2 * half.step - models.step) <= kRounding * models.step))
    throw InvalidInputError("Richardson's estimate takes a second step of half the first, " +
                            text_of(models.step / 2) + ", not " + text_of(half.step));
  const SurfaceVelocity wide = surface_velocity(job, models, present);
  SurfaceVelocity result = surface_velocity(job, half, present);
  result.error = (result.velocity - wide.velocity) / 3;
  result.velocity += result.error;
  add_new(result.warnings, wide.warnings);
  return result;
}

NodeVelocity carry_inside(const MorphJob& job, const SurfaceVelocity& surface) {
  const VolumeDerivative map = job.base().volume->derivative(towards(job, surface));
  RowMatrix all(surface.velocity.rows(), 3 + surface.error.cols() * (surface.error.rows() > 0));
  all.leftCols(3) = surface.velocity;
  if (all.cols() > 3) all.rightCols(3) = surface.error;
  const RowMatrix moved = map.forward(all);
  NodeVelocity result{moved.leftCols(3), RowMatrix(moved.rows(), 0)};
  if (all.cols() > 3) result.error = moved.rightCols(3).rowwise().norm();
  return result;
}

Gradient::Gradient(const MorphJob& job, RowMatrix sensitivity, const Points& present)
    : job_(job), sensitivity_(std::move(sensitivity)) {
  check_sensitivity(sensitivity_, job.base().mesh().node_count());
  const auto& nodes = job.base().volume->surface_nodes();
  surface_ = sensitivity_(nodes, Eigen::all);
  RowMatrix inside = sensitivity_;
  inside(nodes, Eigen::all).setZero();
  // A table of the surface alone has nothing inside to carry to the surface.
  if (inside.isZero(0)) return;
  const Points moved = unless_at_base(job, present);
  surface_ = job.base().volume->derivative(positions(job, moved)).adjoint(sensitivity_);
  if (moved.rows() == 0) holds_ = job.base().volume->hold_check();
}

double Gradient::operator()(const SurfaceVelocity& velocity) const {
  if (holds_.may_be_held(towards(job_, velocity)))
    return sensitivity_.cwiseProduct(carry_inside(job_, velocity).velocity).sum();
  return surface_.cwiseProduct(RowMatrix(velocity.velocity)).sum();
}

VelocityReport velocity_files(const VelocityFiles& files, const PipelineOptions& options) {
  PhaseClock clock(options.progress);
  clock.start("velocity");
  const bool has_half = !files.half_plus.empty();
  std::vector<fs::path> models = {files.base_cad, files.plus, files.minus};
  if (has_half) models.insert(models.end(), {files.half_plus, files.half_minus});
  std::vector<fs::path> inputs = models;
  inputs.push_back(files.mesh);
  check_output(files.output, inputs);
  auto mesh_to_come = std::async(std::launch::async, [&] { return open_mesh(files.mesh); });
  StepQueue queue(models, files.read_cad);
  const auto base = std::make_shared<const CadModel>(queue.next());
  const auto mesh = mesh_to_come.get();
  mesh->check_target(files.output);
  if (!mesh->takes_arrays(files.output))
    throw InvalidInputError(files.output.string() +
                            ": a velocity is an array of nodes, which this format does not hold; "
                            "name a .vtu file");
  const MorphJob job(base, mesh, options);
  const ParameterModels pair = next_models(queue, files.step);
  const SurfaceVelocity surface =
      has_half ? surface_velocity(job, pair, next_models(queue, files.step / 2))
               : surface_velocity(job, pair);
  const NodeVelocity nodes = carry_inside(job, surface);

  VelocityReport report;
  ExtraArrays extra;
  extra.point_arrays["cadmorph_velocity"] = nodes.velocity;
  if (has_half) {
    extra.point_arrays["cadmorph_velocity_error"] = nodes.error;
    report.max_error = nodes.error.maxCoeff();
  }
  as_output([&] { mesh->write(files.output, mesh->mesh().points, extra); });
  report.base_cad = files.base_cad;
  report.mesh = files.mesh;
  report.written = files.output;
  report.nodes = job.base().mesh().node_count();
  report.surface_nodes = std::ssize(job.base().volume->surface_nodes());
  report.mesh_unit_mm = job.base().association().mesh_unit_mm;
  report.step = surface.step;
  report.motion = surface.motion;
  report.cad_tolerance = surface.cad_tolerance;
  report.unevenness = surface.unevenness;
  report.max_speed = nodes.velocity.rowwise().norm().maxCoeff(&report.fastest_node);
  report.fastest_place = job.base().mesh().points.row(report.fastest_node);
  report.warnings = surface.warnings;
  report.seconds = clock.phases().front().seconds;
  return report;
}

GradientReport gradient_files(const ParameterFiles& files,
                              const std::shared_ptr<const MeshFile>& mesh,
                              const Sensitivity& sensitivity, const PipelineOptions& options) {
  const std::vector<DesignParameter>& parameters = files.parameters;
  PhaseClock clock(options.progress);
  clock.start("base");
  std::vector<fs::path> models = {files.base_cad};
  for (const DesignParameter& parameter : parameters)
    models.insert(models.end(), {parameter.plus, parameter.minus});
  StepQueue queue(std::move(models), files.read_cad);
  const MorphJob job(std::make_shared<const CadModel>(queue.next()), mesh, options);
  clock.start("adjoint");
  const Gradient gradient(job, sensitivity.values);
  clock.start("parameters");
  GradientReport report;
  std::vector<char> moves(job.base().volume->surface_nodes().size(), 0);
  for (const DesignParameter& parameter : parameters) {
    if (options.progress)
      options.progress("parameters", static_cast<double>(report.entries.size()) /
                                         static_cast<double>(parameters.size()));
    const SurfaceVelocity velocity = surface_velocity(job, next_models(queue, parameter.step));
    for (const std::string& line : velocity.warnings)
      add_new(report.warnings, {parameter.name + ": " + line});
    const double rests = kRests * largest(velocity.velocity);
    for (Index i = 0; i < velocity.velocity.rows(); ++i)
      moves[i] |= velocity.velocity.row(i).norm() > rests;
    report.entries.push_back({.name = parameter.name,
                              .gradient = gradient(velocity),
                              .step = velocity.step,
                              .max_speed = largest(velocity.velocity),
                              .motion = velocity.motion});
  }
  add_new(report.warnings, warn_of_missing(job, moves, sensitivity.is_given));
  report.base_cad = files.base_cad;
  report.mesh = mesh->path();
  report.nodes = job.base().mesh().node_count();
  report.surface_nodes = gradient.surface().rows();
  report.mesh_unit_mm = job.base().association().mesh_unit_mm;
  report.sensitivity_norm = sensitivity.values.norm();
  report.surface_norm = gradient.surface().norm();
  for (const PhaseTime& phase : clock.phases()) {
    report.seconds += phase.seconds;
    if (phase.name == "adjoint") report.adjoint_seconds = phase.seconds;
  }
  return report;
}

}  // namespace cadmorph
