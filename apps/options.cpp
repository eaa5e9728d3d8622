#include "apps/options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <map>

#include "apps/version.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDescription =
    "cadmorph: moves a simulation mesh from one CAD model onto a changed version of it.\n"
    "\n"
    "  cadmorph BASE.step VARIANT.step MESH [-o OUT] [options]\n"
    "  cadmorph quality MESH [options]\n"
    "  cadmorph match BASE.step VARIANT.step [options]\n"
    "\n"
    "Both STEP files must have the same topology; MESH (.vtu or .vtk) is the mesh of the first. "
    "The\n"
    "result has the same elements, each surface node on the new CAD.";

constexpr const char* kExamples =
    "Examples:\n"
    "  cadmorph wing.step wing_thick.step wing.vtu -o wing_thick.vtu\n"
    "  cadmorph part.step part_b.step part.vtu --mesh-unit m --json report.json\n"
    "  cadmorph part.step part_b.step part.vtu --min-scaled-jacobian 0.1 --improve 0.2\n"
    "  cadmorph quality wing_thick.vtu\n"
    "  cadmorph match part.step part_b.step\n"
    "\n"
    "Exit codes: 0 done; 1 bad usage; 2 an input can't be read or is invalid; 3 the CAD models do\n"
    "not correspond; 4 the mesh does not lie on the base CAD; 5 inverted elements remain or "
    "quality\n"
    "is below what was asked (the mesh goes to OUT's <stem>.failed.<ext>); 6 resources or "
    "numerics.";

constexpr double kInch = 25.4, kFoot = 304.8;

const std::map<std::string, double>& units() {
  static const std::map<std::string, double> all = {{"mm", 1},       {"cm", 10},    {"m", 1000},
                                                    {"inch", kInch}, {"in", kInch}, {"foot", kFoot},
                                                    {"ft", kFoot}};
  return all;
}

double parse_unit(const std::string& text) {
  if (const auto unit = units().find(text); unit != units().end()) return unit->second;
  double millimetres = 0;
  if (!CLI::detail::lexical_cast(text, millimetres) || !(millimetres > 0) ||
      !std::isfinite(millimetres))
    throw UsageError("--mesh-unit " + text +
                     ": give mm, cm, m, inch, foot, or the unit's length in millimetres");
  return millimetres;
}

int parse_steps(const std::string& text) {
  if (text == "auto") return 0;
  int steps = 0;
  if (!CLI::detail::lexical_cast(text, steps) || steps < 1)
    throw UsageError("--steps " + text + ": give auto or a number of at least 1");
  return steps;
}

enum class KernelName {
  Triharmonic,
  Biharmonic,
  Quadharmonic,
  Gaussian,
  Multiquadric,
  InverseMultiquadric,
};

Kernel make_kernel(KernelName name, const std::optional<double>& shape) {
  const bool has_shape = name == KernelName::Gaussian || name == KernelName::Multiquadric ||
                         name == KernelName::InverseMultiquadric;
  if (has_shape && !shape)
    throw UsageError("this --kernel needs --shape, the inverse of a length in the mesh's unit");
  if (!has_shape && shape) throw UsageError("--shape has no meaning for a polyharmonic --kernel");
  const double epsilon = shape.value_or(1);
  switch (name) {
    case KernelName::Biharmonic:
      return Kernel::biharmonic_3d();
    case KernelName::Quadharmonic:
      return Kernel::quadharmonic_3d();
    case KernelName::Gaussian:
      return {.kind = KernelKind::Gaussian, .shape = epsilon};
    case KernelName::Multiquadric:
      return {.kind = KernelKind::Multiquadric, .shape = epsilon};
    case KernelName::InverseMultiquadric:
      return {.kind = KernelKind::InverseMultiquadric, .shape = epsilon};
    default:
      return Kernel::triharmonic_3d();
  }
}

// Texts of the command line that need a second look once all are known.
struct RawOptions {
  std::string output, mesh_unit, steps = "auto", face_map;
  KernelName kernel = KernelName::Triharmonic;
  std::optional<double> shape;
};

// An option whose values are names of a choice, in the order they are listed in.
template <class Enum>
CLI::Option* add_choice(CLI::App& app, const std::string& flag, Enum& target,
                        const std::vector<std::pair<std::string, Enum>>& names,
                        const std::string& description) {
  std::string list;
  for (const auto& [name, value] : names) list += (list.empty() ? "" : "|") + name;
  const auto choose = [&target, names, flag, list](const std::string& text) {
    for (const auto& [name, value] : names)
      if (name == text) {
        target = value;
        return;
      }
    throw CLI::ValidationError(flag + " " + text, "give one of " + list);
  };
  return app.add_option_function<std::string>(flag, choose, description)->type_name(list);
}

void add_method_options(CLI::App& app, CommandLine& line, RawOptions& raw) {
  const auto group = "Method";
  VolumeMorphOptions& volume = line.pipeline.volume;
  SteppingOptions& stepping = line.pipeline.stepping;
  add_choice(app, "--kernel", raw.kernel,
             {{"triharmonic", KernelName::Triharmonic},
              {"biharmonic", KernelName::Biharmonic},
              {"quadharmonic", KernelName::Quadharmonic},
              {"gaussian", KernelName::Gaussian},
              {"multiquadric", KernelName::Multiquadric},
              {"inverse-multiquadric", KernelName::InverseMultiquadric}},
             "radial function of the volume morph (default: triharmonic)")
      ->group(group);
  app.add_option("--shape", raw.shape,
                 "epsilon of the Gaussian and the multiquadrics, 1 / mesh unit")
      ->check(CLI::PositiveNumber)
      ->group(group);
  add_choice(app, "--solver", volume.rbf.solver,
             {{"auto", SolverKind::Auto},
              {"lu", SolverKind::Lu},
              {"ldlt", SolverKind::Ldlt},
              {"cholesky", SolverKind::Cholesky},
              {"fast", SolverKind::Fast}},
             "linear solver of the volume morph (default: auto)")
      ->group(group);
  app.add_option("--tolerance", volume.rbf.tolerance,
                 "residual of the fast solver, in local edge lengths")
      ->check(CLI::PositiveNumber)
      ->capture_default_str()
      ->group(group);
  app.add_option("--steps", raw.steps, "auto: one step, more while elements are inverted; or N")
      ->type_name("auto|N")
      ->capture_default_str()
      ->group(group);
  app.add_option("--max-steps", stepping.max_steps, "most steps of --steps auto")
      ->check(CLI::PositiveNumber)
      ->capture_default_str()
      ->group(group);
  add_choice(app, "--untangle", line.pipeline.untangle,
             {{"auto", UntangleMode::Auto},
              {"never", UntangleMode::Never},
              {"always", UntangleMode::Always}},
             "repair inverted elements by optimisation: auto when steps did not help, always at "
             "once instead of steps (default: auto)")
      ->group(group);
  app.add_option("--improve", line.pipeline.improve_below,
                 "raise elements with a scaled Jacobian below by optimisation")
      ->check(CLI::Range(0.0, 1.0))
      ->group(group);
  app.add_option("--min-scaled-jacobian", line.pipeline.min_scaled_jacobian,
                 "refuse a result with an element below")
      ->check(CLI::Range(-1.0, 1.0))
      ->group(group);
}

void add_mesh_options(CLI::App& app, CommandLine& line, RawOptions& raw) {
  const auto group = "Mesh and CAD";
  SurfaceMorphOptions& surface = line.pipeline.surface;
  app.add_flag("--snap", surface.snap,
               "put nodes exactly on the CAD instead of keeping their offset")
      ->group(group);
  add_choice(app, "--unmatched", surface.unmatched,
             {{"auto", UnmatchedPolicy::Auto},
              {"error", UnmatchedPolicy::Error},
              {"fix", UnmatchedPolicy::Fix},
              {"slide", UnmatchedPolicy::Slide}},
             "what mesh surface on no CAD face does (default: auto)")
      ->group(group);
  app.add_option("--mesh-unit", raw.mesh_unit, "length unit of the mesh (default: detected)")
      ->type_name("mm|cm|m|inch|foot|NUMBER")
      ->group(group);
  app.add_option("--map", raw.face_map, "pairs of base and variant face numbers, as match prints")
      ->type_name("FILE.csv")
      ->group(group);
  app.add_option("--association-tolerance", surface.association.tolerance,
                 "largest distance of a surface node from the CAD, in local edge lengths")
      ->check(CLI::PositiveNumber)
      ->capture_default_str()
      ->group(group);
}

void add_json_option(CLI::App& app, CommandLine& line) {
  app.add_option("--json", line.json, "write all figures to a file; - for stdout, and nothing else")
      ->type_name("FILE|-");
}

void add_threads_option(CLI::App& app, CommandLine& line) {
  app.add_option("--threads", line.threads, "number of threads (default: all processors)")
      ->check(CLI::PositiveNumber);
}

void add_main_options(CLI::App& app, CommandLine& line, RawOptions& raw) {
  app.add_option("BASE", line.files.base_cad, "STEP file the mesh was made for");
  app.add_option("VARIANT", line.files.variant_cad, "STEP file to move the mesh onto");
  app.add_option("MESH", line.files.mesh, "mesh of BASE, .vtu or .vtk");
  app.add_option("-o,--output", raw.output, "morphed mesh (default: <stem>.morphed.<ext>)")
      ->type_name("OUT");
  add_json_option(app, line);
  app.add_flag("--diagnostics", line.files.has_diagnostics,
               "add displacement, CAD entity, (u,v) and scaled Jacobian to the output");
  app.add_flag("--quiet", line.is_quiet, "print errors only");
  add_threads_option(app, line);
  add_method_options(app, line, raw);
  add_mesh_options(app, line, raw);
}

CLI::App* add_quality_command(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("quality", "measure the elements of a mesh");
  command->add_option("MESH", line.files.mesh, "mesh, .vtu or .vtk")->required();
  command
      ->add_option("--min-scaled-jacobian", line.pipeline.min_scaled_jacobian,
                   "exit 5 when an element is below")
      ->check(CLI::Range(-1.0, 1.0));
  add_json_option(*command, line);
  add_threads_option(*command, line);
  return command;
}

CLI::App* add_match_command(CLI::App& app, CommandLine& line, RawOptions& raw) {
  CLI::App* command = app.add_subcommand("match", "show which CAD face became which");
  command->add_option("BASE", line.files.base_cad, "STEP file")->required();
  command->add_option("VARIANT", line.files.variant_cad, "STEP file")->required();
  command->add_option("--map", raw.face_map, "pairs of base and variant face numbers")
      ->type_name("FILE.csv");
  add_json_option(*command, line);
  return command;
}

void check_main_files(const CommandLine& line) {
  const char* missing = line.files.base_cad.empty()      ? "BASE.step, VARIANT.step and MESH"
                        : line.files.variant_cad.empty() ? "VARIANT.step and MESH"
                        : line.files.mesh.empty()        ? "MESH"
                                                         : nullptr;
  if (missing)
    throw UsageError("missing " + std::string(missing) +
                     "; usage: cadmorph BASE.step VARIANT.step MESH [-o OUT] (see --help)");
}

void check_outputs(const CommandLine& line) {
  const MorphFiles& files = line.files;
  std::error_code ignored;
  for (const fs::path& input : {files.base_cad, files.variant_cad, files.mesh})
    for (const fs::path& output : {files.output, fs::path(line.json)})
      if (output == input || fs::equivalent(output, input, ignored))
        throw UsageError("the output " + output.string() +
                         " is one of the inputs; name another file");
  if (files.output == line.json)
    throw UsageError("the mesh and the report can't both go to " + line.json);
  if (files.output.extension() != files.mesh.extension() &&
      (!fs::exists(files.output, ignored) || fs::is_regular_file(files.output, ignored)))
    throw UsageError("the output " + files.output.string() + " must be a " +
                     files.mesh.extension().string() + " file, as the mesh is");
}

void finish(CommandLine& line, const RawOptions& raw) {
  if (!raw.face_map.empty()) line.face_map = raw.face_map;
  if (line.command != Command::Morph) return;
  check_main_files(line);
  line.files.output = raw.output;
  if (raw.output.empty()) line.files.output = default_output(line.files.mesh);
  check_outputs(line);
  if (!raw.mesh_unit.empty())
    line.pipeline.surface.association.mesh_unit_mm = parse_unit(raw.mesh_unit);
  line.pipeline.stepping.steps = parse_steps(raw.steps);
  line.pipeline.volume.kernel = make_kernel(raw.kernel, raw.shape);
}

}  // namespace

std::filesystem::path default_output(const std::filesystem::path& mesh) {
  return mesh.parent_path() / (mesh.stem().string() + ".morphed" + mesh.extension().string());
}

std::optional<CommandLine> parse_command_line(int argc, char** argv) {
  CommandLine line;
  RawOptions raw;
  CLI::App app(kDescription, "cadmorph");
  app.set_version_flag("--version", std::string("cadmorph ") + kVersion);
  app.footer(kExamples);
  app.get_formatter()->column_width(34);
  add_main_options(app, line, raw);
  const CLI::App* quality = add_quality_command(app, line);
  const CLI::App* match = add_match_command(app, line, raw);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& request) {
    app.exit(request);
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    throw UsageError(std::string(error.what()) + " (see cadmorph --help)");
  }
  line.command = quality->parsed() ? Command::Quality
                 : match->parsed() ? Command::Match
                                   : Command::Morph;
  finish(line, raw);
  return line;
}

}  // namespace cadmorph
