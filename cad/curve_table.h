#pragma once

#include "cad/projector.h"

namespace cadmorph {

/// A place on a curve of the skeleton: an edge of its chain and that edge's parameter.
struct CurveLocation {
  EdgeId edge;
  double t;
};

/// A curve sampled by arc length: locations by length fraction and back, and nearest points.
class CurveTable {
 public:
  /// Samples curve `curve` of the model's skeleton. The model must outlive the table.
  CurveTable(const CadModel& model, CurveId curve);

  /// Arc length from the curve's start over its whole length, in [0, 1].
  double fraction(const CurveLocation& location) const;

  /// Location at a length fraction; a closed curve wraps, an open one clamps.
  CurveLocation locate(double fraction) const;

  /// Point at a length fraction.
  Eigen::Vector3d point(double fraction) const;

  /// Nearest location to x, refined by Newton.
  EdgeFoot nearest(const Eigen::Vector3d& x) const;

  double length() const { return arc_.back(); }
  const CadModel& model() const { return *model_; }
  bool is_closed() const { return is_closed_; }

 private:
  const CadModel* model_;
  bool is_closed_;
  std::vector<CurveLocation> location_;  // a sample
  std::vector<double> arc_;              // length up to the sample
  std::vector<Eigen::Vector3d> point_;
};

}  // namespace cadmorph
