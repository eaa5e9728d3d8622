#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/pipeline/morph_files.h"
#include "apps/pipeline/output_file.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace cadmorph {

enum class KernelName {
  Triharmonic,
  Biharmonic,
  Quadharmonic,
  Gaussian,
  Multiquadric,
  InverseMultiquadric,
  WendlandC2,
  WendlandC4,
};

/// The options of a morph as the command line gives them.
struct MorphOptions {
  PipelineOptions pipeline;  ///< what needs no second look
  std::string mesh_unit, steps = "auto", face_map;
  // Of --method rbf alone.
  std::optional<KernelName> kernel;
  std::optional<double> shape;
  std::optional<SolverKind> solver;
  std::optional<double> tolerance;      ///< of the solver
  std::optional<std::uint64_t> memory;  ///< bytes
};

/// Adds the groups of options that every command that morphs has.
void add_morph_options(CLI::App& app, MorphOptions& options);
/// Those of them that a derivative has.
void add_derivative_options(CLI::App& app, MorphOptions& options);
/// Refuses what has no derivative. Throws UsageError.
void check_linear(const MorphOptions& options);
void add_json_option(CLI::App& app, std::string& json);
void add_threads_option(CLI::App& app, int& threads);
/// Adds --timeout, within which `read_cad` reads then.
void add_timeout_option(CLI::App& app, CadReader& read_cad);
/// What is wrong with the value of a --timeout; empty for nothing.
std::string check_timeout(const std::string& text);
CLI::Option* add_face_map_option(CLI::App& app, std::string& face_map);

/// Millimetres of a --mesh-unit. Throws UsageError.
double parse_unit(const std::string& text);

/// What the options come to. Throws UsageError; what read_face_map throws.
PipelineOptions resolve(const MorphOptions& options);

}  // namespace cadmorph
