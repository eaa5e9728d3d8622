#include "apps/commands/options.h"

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>

#include "apps/batch/step_worker.h"
#include "apps/commands/choice.h"
#include "apps/commands/number_checks.h"
#include "apps/pipeline/exit_code.h"
#include "core/length_units.h"

namespace cadmorph {
namespace {

const std::map<std::string, double>& units() {
  static const std::map<std::string, double> all = [] {
    std::map<std::string, double> by_name;
    for (const auto& [mm, name] : kLengthUnits) by_name[name] = mm;
    by_name["in"] = by_name.at("inch");
    by_name["ft"] = by_name.at("foot");
    return by_name;
  }();
  return all;
}

int parse_steps(const std::string& text) {
  if (text == "auto") return 0;
  int steps = 0;
  if (!CLI::detail::lexical_cast(text, steps) || steps < 1)
    throw UsageError("--steps " + text + ": give auto or a number of at least 1");
  return steps;
}

std::pair<std::string, std::string> parse_pair(const std::string& text) {
  const auto comma = text.find(',');
  if (comma == std::string::npos || comma == 0 || comma + 1 == text.size() ||
      text.find(',', comma + 1) != std::string::npos)
    throw UsageError("--periodic " + text + ": give the names of two groups with a comma between");
  return {text.substr(0, comma), text.substr(comma + 1)};
}

Kernel kernel_of(KernelName name) {
  switch (name) {
    case KernelName::Biharmonic:
      return Kernel::biharmonic_3d();
    case KernelName::Quadharmonic:
      return Kernel::quadharmonic_3d();
    case KernelName::Gaussian:
      return {.kind = KernelKind::Gaussian};
    case KernelName::Multiquadric:
      return {.kind = KernelKind::Multiquadric};
    case KernelName::InverseMultiquadric:
      return {.kind = KernelKind::InverseMultiquadric};
    case KernelName::WendlandC2:
      return {.kind = KernelKind::WendlandC2};
    case KernelName::WendlandC4:
      return {.kind = KernelKind::WendlandC4};
    default:
      return Kernel::triharmonic_3d();
  }
}

Kernel make_kernel(KernelName name, const std::optional<double>& shape) {
  Kernel kernel = kernel_of(name);
  if (kernel.has_shape() && !shape)
    throw UsageError("this --kernel needs --shape, the inverse of a length in the mesh's unit");
  if (!kernel.has_shape() && shape)
    throw UsageError("--shape has no meaning for a polyharmonic --kernel");
  kernel.shape = shape.value_or(kernel.shape);
  return kernel;
}

// The choices of the RBF warp mean nothing to another method.
void check_method(const MorphOptions& options) {
  const MorphMethod method = options.pipeline.volume.method;
  if (method == MorphMethod::Rbf) return;
  if (options.kernel || options.shape || options.solver || options.tolerance || options.memory)
    throw UsageError(
        "--kernel, --shape, --solver, --tolerance and --memory choose within --method rbf; " +
        to_string(method) + " has none of them");
}

void add_rbf_options(CLI::App& app, MorphOptions& raw) {
  const auto group = "Method";
  add_choice(app, "--kernel", raw.kernel,
             {{"triharmonic", KernelName::Triharmonic},
              {"biharmonic", KernelName::Biharmonic},
              {"quadharmonic", KernelName::Quadharmonic},
              {"gaussian", KernelName::Gaussian},
              {"multiquadric", KernelName::Multiquadric},
              {"inverse-multiquadric", KernelName::InverseMultiquadric},
              {"wendland-c2", KernelName::WendlandC2},
              {"wendland-c4", KernelName::WendlandC4}},
             "radial function of the volume morph (default: triharmonic)")
      ->group(group);
  app.add_option(
         "--shape", raw.shape,
         "epsilon of the Gaussian and the multiquadrics, 1 / support of Wendland's functions; "
         "1 / mesh unit")
      ->check(positive_number())
      ->group(group);
  add_choice(app, "--solver", raw.solver,
             {{"auto", SolverKind::Auto},
              {"adaptive", SolverKind::Adaptive},
              {"lu", SolverKind::Lu},
              {"ldlt", SolverKind::Ldlt},
              {"cholesky", SolverKind::Cholesky},
              {"iqr", SolverKind::Iqr},
              {"fast", SolverKind::Fast}},
             "linear solver of the volume morph (default: auto)")
      ->group(group);
  app.add_option(
         "--tolerance", raw.tolerance,
         "residual of the adaptive, fast and iqr solvers, in local edge lengths (default: 1e-05)")
      ->check(positive_number())
      ->group(group);
  app.add_option("--memory", raw.memory,
                 "most that a solver may take: bytes, or with a suffix as in 16GB (default: 8GB)")
      ->transform(CLI::AsSizeValue(true))
      ->check(positive_number())
      ->type_name("SIZE")
      ->group(group);
}

void add_method_options(CLI::App& app, MorphOptions& raw) {
  const auto group = "Method";
  VolumeMorphOptions& volume = raw.pipeline.volume;
  SteppingOptions& stepping = raw.pipeline.stepping;
  add_choice(app, "--method", volume.method,
             {{"rbf", MorphMethod::Rbf},
              {"femwarp", MorphMethod::Femwarp},
              {"lbwarp", MorphMethod::Lbwarp},
              {"simplex-linear", MorphMethod::SimplexLinear}},
             "how the volume nodes follow the surface (default: rbf)")
      ->group(group);
  add_rbf_options(app, raw);
  app.add_option("--steps", raw.steps, "auto: one step, more while elements are inverted; or N")
      ->type_name("auto|N")
      ->capture_default_str()
      ->group(group);
  app.add_option("--max-steps", stepping.max_steps, "most steps of --steps auto")
      ->check(positive_number())
      ->capture_default_str()
      ->group(group);
  add_choice(app, "--untangle", raw.pipeline.untangle,
             {{"auto", UntangleMode::Auto},
              {"never", UntangleMode::Never},
              {"always", UntangleMode::Always}},
             "repair inverted elements by optimisation: auto when steps did not help, always at "
             "once instead of steps (default: auto)")
      ->group(group);
  add_choice(
      app, "--quality", raw.pipeline.quality,
      {{"best", QualityMode::Best}, {"fast", QualityMode::Fast}},
      "best: where elements lost shape, raise the worst by optimisation; fast: leave them as "
      "the volume morph does (default: best)")
      ->group(group);
  add_choice(app, "--for", raw.pipeline.mesh_use,
             {{"fe", MeshUse::FiniteElements}, {"fv", MeshUse::FiniteVolumes}},
             "what --quality best raises: fe, the scaled Jacobian; fv, non-orthogonality and "
             "skewness of faces (default: fv for OpenFOAM and Fluent, else fe)")
      ->group(group);
  app.add_option("--improve", raw.pipeline.improve_below,
                 "raise elements with a scaled Jacobian below by optimisation")
      ->check(number_between(0, 1))
      ->group(group);
  app.add_option("--min-scaled-jacobian", raw.pipeline.min_scaled_jacobian,
                 "refuse a result with an element below")
      ->check(number_between(-1, 1))
      ->group(group);
  app.add_flag("--keep-layers", raw.pipeline.keep_layers,
               "layers on walls keep their heights, as far as no element is inverted")
      ->group(group);
  app.add_flag("--accept-inverted-input", raw.pipeline.accept_inverted_input,
               "elements that are inverted in MESH may stay so; all others are refused still")
      ->group(group);
}

void add_mesh_options(CLI::App& app, MorphOptions& raw) {
  const auto group = "Mesh and CAD";
  SurfaceMorphOptions& surface = raw.pipeline.surface;
  app.add_flag("--snap", surface.snap,
               "put nodes exactly on the CAD instead of keeping their offset")
      ->group(group);
  add_choice(app, "--unmatched", surface.unmatched,
             {{"auto", UnmatchedPolicy::Auto},
              {"error", UnmatchedPolicy::Error},
              {"fix", UnmatchedPolicy::Fix},
              {"slide", UnmatchedPolicy::Slide}},
             "what mesh surface on no CAD face does, but for named parts (default: auto)")
      ->group(group);
  const auto add_group_option = [&](const char* name, std::vector<std::string>& names,
                                    const char* what) {
    app.add_option(name, names, what)->type_name("GROUP")->allow_extra_args(false)->group(group);
  };
  add_group_option("--hold", surface.groups.held,
                   "named part of the mesh (marker, patch, set) whose nodes stay; may be repeated");
  add_group_option("--rigid", surface.groups.rigid,
                   "named part that moves as one piece with the nearest part of the CAD; may be "
                   "repeated");
  add_group_option("--slide", surface.groups.sliding,
                   "named part on no CAD face that slides along its own surface; may be repeated");
  add_group_option("--follow", surface.groups.following,
                   "named part on no CAD face that follows the volume; may be repeated");
  app.add_option_function<std::vector<std::string>>(
         "--periodic",
         [&surface](const std::vector<std::string>& pairs) {
           for (const std::string& pair : pairs)
             surface.groups.periodic.push_back(parse_pair(pair));
         },
         "two named sides a period apart, by a translation or a rotation: B moves as A does; may "
         "be repeated")
      ->type_name("A,B")
      ->allow_extra_args(false)
      ->group(group);
  app.add_option("--mesh-unit", raw.mesh_unit, "length unit of the mesh (default: detected)")
      ->type_name("mm|cm|m|inch|foot|NUMBER")
      ->group(group);
  add_face_map_option(app, raw.face_map)->group(group);
  app.add_option("--association-tolerance", surface.association.tolerance,
                 "largest distance of a surface node from the CAD, in local edge lengths")
      ->check(positive_number())
      ->capture_default_str()
      ->group(group);
  app.add_option("--cache", raw.pipeline.cache,
                 "file to keep the set-up of BASE and MESH in, for other runs")
      ->type_name("FILE")
      ->group(group);
}

}  // namespace

double parse_unit(const std::string& text) {
  if (const auto unit = units().find(text); unit != units().end()) return unit->second;
  double millimetres = 0;
  if (!CLI::detail::lexical_cast(text, millimetres) || !(millimetres > 0) ||
      !std::isfinite(millimetres))
    throw UsageError("--mesh-unit " + text +
                     ": give mm, cm, m, inch, foot, or the unit's length in millimetres");
  return millimetres;
}

void add_morph_options(CLI::App& app, MorphOptions& options) {
  add_method_options(app, options);
  add_mesh_options(app, options);
}

void add_derivative_options(CLI::App& app, MorphOptions& options) {
  add_rbf_options(app, options);
  add_mesh_options(app, options);
}

void check_linear(const MorphOptions& options) {
  if (options.solver == SolverKind::Iqr)
    throw UsageError("--solver iqr fits the surface's displacements and has no derivative here");
}

void add_json_option(CLI::App& app, std::string& json) {
  app.add_option("--json", json, "write all figures to a file; - for stdout, and nothing else")
      ->type_name("FILE|-");
}

void add_threads_option(CLI::App& app, int& threads) {
  app.add_option("--threads", threads, "number of threads (default: all processors)")
      ->check(positive_number());
}

void add_timeout_option(CLI::App& app, CadReader& read_cad) {
  const auto read_within = [&read_cad](double seconds) {
    read_cad = std::bind_front(read_step_within, std::chrono::duration<double>(seconds));
  };
  app.add_option_function<double>("--timeout", read_within,
                                  "seconds to wait for the reading of one STEP file, then in a "
                                  "process of its own (default: for ever)")
      ->check(check_timeout)
      ->group("Mesh and CAD");
}

std::string check_timeout(const std::string& text) {
  double seconds = 0;
  const bool is_good =
      CLI::detail::lexical_cast(text, seconds) && seconds > 0 && std::isfinite(seconds);
  return is_good ? "" : text + ": give a number of seconds above 0";
}

CLI::Option* add_face_map_option(CLI::App& app, std::string& face_map) {
  return app
      .add_option("--map", face_map, "pairs of base and variant face numbers, as match prints")
      ->type_name("FILE.csv");
}

PipelineOptions resolve(const MorphOptions& options) {
  PipelineOptions result = options.pipeline;
  check_method(options);
  if (!options.mesh_unit.empty())
    result.surface.association.mesh_unit_mm = parse_unit(options.mesh_unit);
  result.stepping.steps = parse_steps(options.steps);
  result.volume.kernel =
      make_kernel(options.kernel.value_or(KernelName::Triharmonic), options.shape);
  RbfOptions& rbf = result.volume.rbf;
  rbf.solver = options.solver.value_or(rbf.solver);
  rbf.tolerance = options.tolerance.value_or(rbf.tolerance);
  if (options.memory) rbf.memory_limit = static_cast<double>(*options.memory);
  if (!options.face_map.empty()) result.face_map = read_face_map(options.face_map);
  return result;
}

}  // namespace cadmorph
