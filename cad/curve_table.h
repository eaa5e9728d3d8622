#pragma once

#include "cad/projector.h"

namespace cadmorph {

/// A place on a curve of the skeleton: an edge of its chain and that edge's parameter.
struct CurveLocation {
  EdgeId edge;
  double t;
};

/// What a curve is measured by. Shape is the length over the whole length plus the angle turned
/// through over a full turn: a nose as long as it is short of a side counts as much as the side.
enum class CurveMeasure { Length, Shape };

/// A curve sampled by arc length: locations by length fraction and back, and nearest points.
class CurveTable {
 public:
  /// Samples curve `curve` of the model's skeleton. The model must outlive the table.
  CurveTable(const CadModel& model, CurveId curve);

  /// Measure from the curve's start over that of the whole curve, in [0, 1].
  double fraction(const CurveLocation& location, CurveMeasure measure = CurveMeasure::Length) const;

  /// Location at a fraction; a closed curve wraps, an open one clamps.
  CurveLocation locate(double fraction, CurveMeasure measure = CurveMeasure::Length) const;

  /// Point at a length fraction.
  Eigen::Vector3d point(double fraction) const;

  /// Nearest location to x, refined by Newton.
  EdgeFoot nearest(const Eigen::Vector3d& x) const;

  double length() const { return arc_.back(); }
  const CadModel& model() const { return *model_; }
  bool is_closed() const { return is_closed_; }

 private:
  const std::vector<double>& measured(CurveMeasure measure) const {
    return measure == CurveMeasure::Length ? arc_ : shape_;
  }

  const CadModel* model_;
  bool is_closed_;
  std::vector<CurveLocation> location_;  // a sample
  std::vector<double> arc_;              // length up to the sample
  std::vector<double> shape_;            // see CurveMeasure
  std::vector<Eigen::Vector3d> point_;
};

}  // namespace cadmorph
