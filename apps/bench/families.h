#pragma once

#include <compare>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cad/brep.h"
#include "core/mesh_file.h"
#include "core/quality.h"
#include "volume/volume_morph.h"

namespace cadmorph::bench {

/// Number of steps of a family's parameter change; step k stands at k / kSteps of it.
constexpr int kSteps = 20;

/// One mesh of a family: <folder>/<mesh>.vtu beside base.step and step01.step ... step20.step.
struct Subject {
  std::filesystem::path folder;
  std::string family, mesh;
};

/// The meshes of all families below `models`, those of quadratic cells left out, in the order of
/// their names. Throws IoError when there is no family.
std::vector<Subject> find_subjects(const std::filesystem::path& models);

enum class Mode {
  Absolute,  ///< each step from the base
  Relative,  ///< each step from the one before
};

/// Where the surface nodes go.
enum class Surface {
  RbfS,      ///< Sieger et al. 2013, sect. 4
  Harmonic,  ///< stands in for what the methods were given there: harmonic_surface
};

/// A way to steps 1 .. kSteps.
struct Route {
  Surface surface = Surface::RbfS;
  Mode mode = Mode::Absolute;
  auto operator<=>(const Route&) const = default;
};

/// Positions of the surface nodes at steps 1 .. kSteps.
using Path = std::vector<Points>;

/// What the RBF warp makes of a step.
struct Warped {
  Points positions = {};  ///< of all nodes
  double set_up_seconds = 0, seconds = 0;
  double cpu_seconds = 0;  ///< of both
};

/// Where the surface of a mesh is at each step.
struct Series {
  Subject subject;
  std::vector<std::shared_ptr<const CadModel>> cads;  ///< base, steps; those not needed are missing
  std::shared_ptr<const MeshFile> mesh_file;
  Mesh mesh;  ///< the base
  Orientation orientation;
  std::vector<Index> surface_nodes;  ///< prescribed ones
  Path absolute[2];                  ///< by Surface; each step from the base
  Path relative[2];                  ///< each from the CAD and the surface of the step before
  std::optional<VolumeMorph> warp;   ///< of the base, where it was needed
  Warped warp_set_up;                ///< its seconds
  /// By Surface: the RBF warp on these paths. Relative ones come with the path, whose surface is
  /// associated anew on the mesh that they move; absolute ones by `warp_absolutely`.
  std::vector<Warped> absolute_warps[2], relative_warps[2];

  const Path& path(const Route& route) const {
    return (route.mode == Mode::Absolute ? absolute : relative)[static_cast<int>(route.surface)];
  }
  const Warped& warped(const Route& route, int step) const {
    const auto& warps = route.mode == Mode::Absolute ? absolute_warps : relative_warps;
    return warps[static_cast<int>(route.surface)][step - 1];
  }
};

/// Reads base, mesh and steps, and morphs the surface on the routes asked for, on absolute ones at
/// every `stride`-th step alone; other positions stay empty. Throws what the pipeline throws.
Series make_series(const Subject& subject, const std::set<Route>& routes, int stride = 1);

/// Fills the absolute warps of a path, several steps at once (VolumeMorph::morph_each): their
/// seconds are shares of the whole. Does nothing when they are there. Throws SolverError.
void warp_absolutely(Series& series, Surface surface);

}  // namespace cadmorph::bench
