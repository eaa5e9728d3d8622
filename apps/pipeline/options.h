#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/progress.h"
#include "surface/surface_morph.h"
#include "volume/stepping.h"
#include "volume/volume_morph.h"

namespace cadmorph {

/// When to repair inverted elements by optimisation.
enum class UntangleMode {
  Auto,  ///< when elements are inverted after all steps
  Never,
  Always,  ///< also to raise elements that became poor
};

/// What is done for the elements of a valid result.
enum class QualityMode {
  Best,             ///< where they lost, the worst are raised (find_best_mesh)
  WhereHalfIsLost,  ///< as Best where less than half of the file's is left, else as Fast
  Fast,             ///< nothing: the positions are those of the volume morph
};

/// What the mesh is for: what its solver feels of the elements.
enum class MeshUse {
  OfFormat,        ///< as most solvers that read the mesh's format
  FiniteElements,  ///< the scaled Jacobian
  FiniteVolumes,   ///< non-orthogonality and skewness of faces (face_quality)
};

struct PipelineOptions {
  SurfaceMorphOptions surface;
  VolumeMorphOptions volume;
  SteppingOptions stepping;
  UntangleMode untangle = UntangleMode::Auto;
  /// Has no meaning, as Fast, where `untangle` is Never or `can_repair` false.
  QualityMode quality = QualityMode::Best;
  MeshUse mesh_use = MeshUse::OfFormat;  ///< what `quality` goes by
  /// Raises elements whose scaled Jacobian is below by optimisation.
  std::optional<double> improve_below;
  /// Layers on the surface keep the heights that they have at the base (layer_stage).
  bool keep_layers = false;
  /// The result is refused when any cell's scaled Jacobian is below.
  std::optional<double> min_scaled_jacobian;
  /// Elements that are inverted in the input may stay so.
  bool accept_inverted_input = false;
  /// False: the result is to be a function of the position, as a field is. Repair by optimisation,
  /// which moves single nodes, is then not advised.
  bool can_repair = true;
  /// Base and variant face numbers (1-based) given by the user.
  std::vector<std::pair<int, int>> face_map;
  /// File to keep the base side in for other runs; empty: none (docs/batch.md).
  std::filesystem::path cache = {};
  /// Called through the whole trip.
  Progress progress;
  /// Called before the work goes on with a warning that is not for later; the report has it, too.
  std::function<void(const std::string& warning)> notice = {};
};

}  // namespace cadmorph
