#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "cad/brep.h"
#include "core/rbf/rbf_system.h"
#include "surface/association.h"

namespace cadmorph {

/// The part of a parameter warp that depends on the base face alone: its sampled wires in the
/// scaled parameter domain, its joints, and the factorisation of the 2D RBF (r^2 log r + linear)
/// over them (Sieger et al. 2013, sect. 4). A direction in which the face closes on itself is laid
/// on a circle, so that the warp is periodic and the seam leaves no trace; r^2 log r stays
/// conditionally positive definite there.
class FaceDomain {
 public:
  /// A sample of a wire: where it lies on the physical curve, or on a pole (edge is degenerate).
  /// Or a joint, whose coedge is -1.
  struct Sample {
    CoedgeId coedge;
    double t;
    Eigen::Vector2d uv;
    double tolerance;  ///< of its edge, millimetres
    int joint = -1;    ///< which one
  };

  /// `samples_per_curve`: samples along each edge; where a face has so many edges that this makes
  /// too many, long edges keep more of them. `joints`: parameters of points within the wires that
  /// do not follow them. `asked`: parameters of the nodes that will be asked for: samples closer to
  /// each other than these can tell apart count once.
  FaceDomain(const CadModel& base, FaceId face, int samples_per_curve,
             const Parameters& joints = Parameters(0, 2),
             const Parameters& asked = Parameters(0, 2));

  FaceId face() const { return face_; }
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
  void thin_out(const Parameters& asked);
  bool is_within_tolerance(const Parameters& misfit) const;
  Eigen::MatrixXd linear_basis(const Parameters& uv) const;
  Eigen::MatrixXd fit_linear(const Parameters& values) const;
  RowMatrix interpolate_freely(const RowMatrix& lengths, const RowMatrix& points) const;
  Parameters in_lengths(const Parameters& d) const;
  Parameters in_parameters(const Parameters& d) const;
  RowMatrix embed(const Parameters& uv) const;

  FaceId face_;
  Eigen::Vector2d scale_;   // mean lengths of the derivatives, mm per parameter
  Eigen::Vector2d period_;  // 0: not periodic
  Eigen::Vector2d size_;
  std::vector<Sample> samples_;
  Parameters sample_uv_;
  mutable std::mutex mutex_;
  mutable std::unique_ptr<RbfSystem> system_;  // made when first needed
};

/// Mean lengths of the derivatives S_u, S_v over a face: millimetres per parameter.
Eigen::Vector2d mean_derivatives(const CadModel& model, FaceId face);

/// Parameters of a coedge's edge at t: its pcurve, or the foot of the edge's point where the pcurve
/// is further from it than the edge's tolerance.
Eigen::Vector2d wire_parameters(const CadModel& model, CoedgeId coedge, double t);

/// The same with the foot wherever the pcurve is further from it than `tolerance`, millimetres.
Eigen::Vector2d wire_parameters(const CadModel& model, CoedgeId coedge, double t, double tolerance);

/// Whether a coedge on a degenerate edge is no pole: exporters close the gap between the pcurves of
/// two edges by one.
bool fills_gap(const CadModel& model, CoedgeId coedge);

}  // namespace cadmorph
