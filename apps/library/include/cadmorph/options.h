#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "api.h"

namespace cadmorph::CADMORPH_V1 {

/// What mesh surface on no CAD face (far field, symmetry plane) does.
enum class Unmatched {
  Auto,   ///< planar patches slide where they touch moved surface, all else stays
  Error,  ///< refuse
  Fix,    ///< stays
  Slide,  ///< slides along its own surface, plane or curved
};

/// How the volume nodes follow the surface (docs/evaluation.md).
enum class Method { Rbf, Femwarp, Lbwarp, SimplexLinear };

/// Radial function of Method::Rbf (docs/choosing.md). The last five have a shape.
enum class Kernel {
  Triharmonic,
  Biharmonic,
  Quadharmonic,
  Gaussian,
  Multiquadric,
  InverseMultiquadric,
  WendlandC2,
  WendlandC4,
};

/// Linear solver of Method::Rbf (docs/reference.md).
enum class Solver { Auto, Adaptive, Lu, Ldlt, Cholesky, Iqr, Fast };

/// When to repair inverted elements by optimisation.
enum class Untangle {
  Auto,  ///< where steps did not help
  Never,
  Always,  ///< at once, instead of steps
};

/// What is done for the elements of a valid result.
enum class Quality {
  Best,  ///< where they lost shape, the worst are raised
  Fast,  ///< nothing: the positions are those of the volume morph
};

/// How the mesh's solver works: what Quality::Best raises.
enum class SolverFamily {
  OfFormat,        ///< as most solvers that read the mesh's format; of no file: finite elements
  FiniteElements,  ///< the scaled Jacobian
  FiniteVolumes,   ///< non-orthogonality and skewness of faces
};

/// How to morph. The defaults are the program's; docs/choosing.md tells what to change when.
struct MorphOptions {
  std::optional<double> mesh_unit_mm = {};  ///< millimetres per mesh unit; none: detected
  /// Largest distance of a surface node from the CAD, in its shortest mesh edge.
  double association_tolerance = 0.1;
  bool snap = false;  ///< puts nodes exactly on the CAD instead of keeping their offset
  Unmatched unmatched = Unmatched::Auto;
  std::vector<std::string> hold = {};    ///< named parts of the mesh whose nodes stay
  std::vector<std::string> rigid = {};   ///< named parts that move with the nearest of the CAD
  std::vector<std::string> slide = {};   ///< those on no CAD face that slide along their surface
  std::vector<std::string> follow = {};  ///< named parts on no CAD face that follow the volume
  /// Pairs of named sides a period apart, by a translation or a rotation: the second moves as the
  /// first does, turned with it.
  std::vector<std::pair<std::string, std::string>> periodic = {};
  /// Base and variant face numbers, from 1 as `cadmorph match` prints them.
  std::vector<std::pair<int, int>> face_map = {};
  Method method = Method::Rbf;
  Kernel kernel = Kernel::Triharmonic;
  /// Epsilon of the Gaussian and the multiquadrics, 1 / support of Wendland's; 1 / mesh unit.
  std::optional<double> kernel_shape = {};
  Solver solver = Solver::Auto;
  double solver_tolerance = 1e-5;   ///< residual of the iterative solvers, in local edge lengths
  double memory_limit_bytes = 8e9;  ///< that a solver may take
  int steps = 0;                    ///< 0: one, more while elements are inverted
  int max_steps = 8;                ///< where `steps` is 0
  Untangle untangle = Untangle::Auto;
  Quality quality = Quality::Best;
  SolverFamily solver_family = SolverFamily::OfFormat;
  std::optional<double> improve_below = {};        ///< raises elements with a scaled Jacobian below
  std::optional<double> min_scaled_jacobian = {};  ///< refuses a result with an element below
  bool keep_layers = false;  ///< layers on walls keep their heights, where no element is inverted
  bool accept_inverted_input = false;  ///< elements inverted in the input may stay so
};

}  // namespace cadmorph::CADMORPH_V1
