#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/mesh.h"
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

/// Where the surface of a mesh is at each step.
struct Series {
  Subject subject;
  Mesh mesh;  ///< the base
  Orientation orientation;
  std::vector<Index> surface_nodes;  ///< prescribed ones
  std::vector<Points> absolute;      ///< their positions at steps 1 .. kSteps, each from the base
  std::vector<Points> relative;      ///< each from the CAD and the surface of the step before

  const std::vector<Points>& surface(Mode mode) const {
    return mode == Mode::Absolute ? absolute : relative;
  }
};

/// Reads base, mesh and steps, and morphs the surface (Sieger et al. 2013, sect. 4). `last_only`:
/// of step kSteps alone, absolute; the other positions stay empty. Throws what the pipeline throws.
Series make_series(const Subject& subject, bool last_only = false);

}  // namespace cadmorph::bench
