#pragma once

#include "cad/curve_table.h"
#include "cad/topology_match.h"
#include "surface/motion_prediction.h"

namespace cadmorph {

/// Both models, their match, and what the match predicts: the input of every map.
struct ModelPair {
  const CadModel& base;
  const CadModel& variant;
  const TopologyMatch& match;
  const MotionPrediction& prediction;
};

/// Maps locations on a base curve to its variant: equal relative parameters (Sieger et al. 2013, sect.
/// 4), the way the curve runs and the phase of a closed one taken from the prediction; equal length
/// fractions where the chains of edges differ; nearest points where the curve is the same one under
/// another parametrisation.
class CurveMap {
 public:
  CurveMap(const ModelPair& pair, int base_curve);

  CurveLocation operator()(const CurveLocation& base) const;

 private:
  enum class Mode { Parameter, Length, Nearest };
  struct Way {
    Mode mode = Mode::Parameter;
    bool is_reversed = false;
    std::size_t shift = 0;  // of the links, closed chains by parameter
    double phase = 0;       // of the length fraction, closed curves by length
  };

  CurveLocation apply(const Way& way, const CurveLocation& base) const;
  CurveLocation by_parameter(const Way& way, const CurveLocation& base) const;
  double deviation(const Way& way) const;
  Way best_phase(bool is_reversed) const;
  Way choose() const;
  Way best_shift() const;
  Way choose_closed(bool has_equal_links) const;
  bool runs_backward() const;
  bool is_same_under_alignment() const;

  const ModelPair* pair_;  // while constructing
  Similarity alignment_;
  const CadCurve* base_curve_;
  const CadCurve* variant_curve_;
  CurveTable base_;
  CurveTable variant_;
  std::vector<CurveLocation> probes_;
  std::vector<Eigen::Vector3d> predicted_;  // of the probes
  Way way_;
};

}  // namespace cadmorph
