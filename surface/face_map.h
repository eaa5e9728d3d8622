#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "core/rbf/rbf_system.h"
#include "surface/curve_map.h"

namespace cadmorph {

using Parameters = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

/// The part of a parameter warp that depends on the base face alone: its sampled wires in the
/// scaled parameter domain, and the factorisation of the 2D RBF (r^2 log r + linear) over them
/// (Sieger et al. 2013, sect. 4). A direction in which the face closes on itself is laid on a
/// circle, so that the warp is periodic and the seam leaves no trace; r^2 log r stays conditionally
/// positive definite there.
class FaceDomain {
 public:
  /// A sample of a wire: where it lies on the physical curve, or on a pole (edge is degenerate).
  struct Sample {
    int coedge;
    double t;
    Eigen::Vector2d uv;
    double tolerance;  ///< of its edge, millimetres
  };

  /// `samples_per_curve`: samples along each edge; scaled down where a face has very many edges.
  FaceDomain(const CadModel& base, int face, int samples_per_curve);

  int face() const { return face_; }
  const std::vector<Sample>& samples() const { return samples_; }

  /// Interpolates values (a row a sample, two columns) at parameters; exactly constant or linear
  /// values are reproduced without the RBF.
  Parameters interpolate(const Parameters& values, const Parameters& at) const;

  /// The same in `steps` uniform steps of the samples, each interpolated from where the one before
  /// left them: large motions then don't fold the domain. Only for faces that close in no
  /// direction.
  Parameters interpolate_in_steps(const Parameters& values, const Parameters& at, int steps) const;

  bool is_closed() const { return period_[0] > 0 || period_[1] > 0; }

 private:
  void thin_out();
  bool is_within_tolerance(const Parameters& misfit) const;
  Eigen::MatrixXd linear_basis(const Parameters& uv) const;
  Eigen::MatrixXd fit_linear(const Parameters& values) const;
  RowMatrix embed(const Parameters& uv) const;

  int face_;
  Eigen::Vector2d scale_;   // mean lengths of the derivatives, mm per parameter
  Eigen::Vector2d period_;  // 0: not periodic
  Eigen::Vector2d size_;
  std::vector<Sample> samples_;
  Parameters sample_uv_;
  mutable std::mutex mutex_;
  mutable std::unique_ptr<RbfSystem> system_;  // made when first needed
};

/// Maps parameters of a base face to its variant.
struct FaceMapResult {
  Parameters uv;              ///< on the variant face
  bool is_projected = false;  ///< predicted positions were projected, no warp was possible
  std::string note;           ///< why; empty when all went well
};

/// Warps parameters `uv` of the domain's face with the images of its wires under `curve_maps`
/// (indexed by base curve), in one or more steps (interpolate_in_steps; open faces only). `points`
/// are the nodes' positions S(uv) on the base. Falls back to projecting the predicted positions
/// where the parametrisations don't correspond.
FaceMapResult map_face(const FaceDomain& domain, const ModelPair& pair,
                       const std::vector<CurveMap>& curve_maps, const Parameters& uv,
                       const Points& points, int steps = 1);

/// The fallback alone: predicted positions, corrected to meet the mapped curves, projected.
FaceMapResult project_face(const FaceDomain& domain, const ModelPair& pair,
                           const std::vector<CurveMap>& curve_maps, const Points& points);

}  // namespace cadmorph
