#pragma once

#include <optional>
#include <vector>

#include "cad/curve_table.h"

namespace cadmorph {

/// Seam edges of a face, each as often as a wire runs along it.
std::vector<EdgeId> seams(const CadModel& model, FaceId face);

/// One parameter of a face, u or v, as a measure of how far along one of the face's curves a place
/// is: from 0 at the curve's start to 1 at its end, through all its links, without jumps at
/// periods.
class FaceProgress {
 public:
  /// Nothing unless the parameter (0: u, 1: v) runs one way all along the curve, and once round
  /// where the curve is closed. The model must outlive the result.
  static std::optional<FaceProgress> along(const CadModel& model, const CadCurve& curve,
                                           FaceId face, int parameter);

  double operator()(const CurveLocation& location) const;

  /// Location at a progress; a closed curve wraps, an open one clamps.
  CurveLocation locate(double progress) const;

  /// Least cosine of the angle between the curve and the parameter's direction on the face: 1 where
  /// the face's other parameter is constant.
  double straightness() const { return straightness_; }

  /// Where the face's own seam meets a closed curve; nothing if it does not, or more than once.
  std::optional<CurveLocation> seam() const;

 private:
  struct Link {
    EdgeId edge;
    CoedgeId coedge;
    double first, last;  // of the edge's parameter, in the sense of the curve
    double shift;        // periods added to the pcurve
  };

  FaceProgress(const CadModel& model, FaceId face, int parameter)
      : model_(&model), face_(face), parameter_(parameter) {}

  bool chain(const CadCurve& curve);
  bool runs_one_way();
  double at(const Link& link, double t) const;
  double solve(const Link& link, double value) const;

  const CadModel* model_;
  FaceId face_;
  int parameter_;
  bool is_closed_ = false;
  std::vector<Link> links_;
  double start_ = 0, span_ = 0;
  double straightness_ = 1;
};

}  // namespace cadmorph
