#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api.h"
#include "cad_model.h"
#include "progress.h"
#include "types.h"

namespace cadmorph::CADMORPH_V1 {

/// The volume morph of a Morpher as a linear map, the centres that it chose held, and the transpose
/// of that map to rounding: of one plain morph, without steps and repair. It does not change;
/// threads may share it.
class Derivative {
 public:
  /// Displacements of all nodes (N x M) for those of the m surface nodes (m x M), which themselves
  /// move just so. Each column counts by itself: three for a displacement, 3 k for k of them.
  /// Throws InvalidInputError on a wrong size or a number that is not finite, SolverError.
  RowMatrix forward(const RowMatrix& surface) const {
    RowMatrix result(node_count(), surface.cols());
    forward_to(surface, result.data());
    return result;
  }

  /// The derivative of a quantity by the surface nodes' positions (m x M) for that by the positions
  /// of all nodes (N x M). Throws as forward does.
  RowMatrix adjoint(const RowMatrix& volume) const {
    RowMatrix result(surface_count(), volume.cols());
    adjoint_to(volume, result.data());
    return result;
  }

  Index node_count() const;     ///< N
  Index surface_count() const;  ///< m

  struct Impl;
  explicit Derivative(std::shared_ptr<const Impl> impl);

 private:
  // The matrices are the caller's own: Eigen may allocate otherwise there.
  void forward_to(const RowMatrix& surface, double* result) const;
  void adjoint_to(const RowMatrix& volume, double* result) const;

  std::shared_ptr<const Impl> impl_;
};

struct DerivativeCall {
  /// Nodes on planes that slide (symmetry planes, sides of a far field) follow the others: what is
  /// given for them is not read, the adjoint by them is 0, and columns come in threes.
  bool slide = false;
};

/// The CAD models with a parameter larger and smaller by a step, in the parameter's unit.
struct ParameterPair {
  CadModel plus, minus;
  double step;
};

struct VelocityCall {
  /// The model at the present parameters, between the pair's two; none: the base.
  std::optional<CadModel> present = {};
  /// A second pair, of half the step: the velocity is then Richardson's extrapolation, with an
  /// estimate of the second's error.
  std::optional<ParameterPair> half = {};
};

/// How the nodes move with a CAD parameter, in the mesh's unit per unit of it.
class Velocity {
 public:
  const Points& surface() const;    ///< m x 3, rows as Morpher::surface_nodes
  const Points& nodes() const;      ///< N x 3
  const RowMatrix& errors() const;  ///< N x 1, estimated; N x 0 without a second pair
  double motion_mm() const;         ///< most that the step moves a surface node
  /// Of the present surface between both models, in parts of the motion.
  double unevenness() const;
  const std::vector<std::string>& warnings() const;

  struct Impl;
  explicit Velocity(std::shared_ptr<const Impl> impl);

 private:
  std::shared_ptr<const Impl> impl_;
};

/// A parameter of a gradient.
struct Parameter {
  std::string name;
  ParameterPair pair;
};

/// A CAD parameter and the STEP files of its pair.
struct ParameterFiles {
  std::string name;
  std::filesystem::path plus, minus;
  double step;
};

struct GradientCall {
  /// The model at the present parameters, where dJ/dX is taken; none: the base.
  std::optional<CadModel> present = {};
  Progress progress = {};
};

/// What a parameter of a gradient came to.
struct ParameterGradient {
  std::string name;
  double gradient;   ///< dJ/dp
  double max_speed;  ///< of a surface node, mesh units per unit of the parameter
  double motion_mm;  ///< most that the step moves a surface node
  std::vector<std::string> warnings;
};

}  // namespace cadmorph::CADMORPH_V1
