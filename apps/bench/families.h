#pragma once

#include <compare>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "cad/brep.h"
#include "core/mesh_file.h"
#include "core/quality.h"

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

/// A way through the steps.
struct Route {
  Surface surface = Surface::RbfS;
  Mode mode = Mode::Absolute;
  auto operator<=>(const Route&) const = default;
};

/// Positions of the surface nodes at steps 1, 2, ...
using Path = std::vector<Points>;

/// Where the surface of a mesh is at each step.
struct Series {
  Subject subject;
  std::vector<std::shared_ptr<const CadModel>> cads;  ///< base, steps; those not needed are missing
  std::shared_ptr<const MeshFile> mesh_file;
  Mesh mesh;  ///< the base
  Orientation orientation;
  std::vector<Index> surface_nodes;  ///< prescribed ones
  std::map<Route, Path> paths;       ///< those asked for

  const Path& path(const Route& route) const { return paths.at(route); }
};

/// Reads base, mesh and steps, and morphs the surface to steps 1 .. `last` on the routes asked for,
/// on absolute ones to every `stride`-th step alone; other positions stay empty. On relative ones
/// each step goes out from the CAD and the surface of the step before, so that they don't depend on
/// how the nodes inside move. Throws what the pipeline throws.
Series make_series(const Subject& subject, const std::set<Route>& routes, int stride = 1,
                   int last = kSteps);

}  // namespace cadmorph::bench
