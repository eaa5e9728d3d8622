#pragma once

#include <optional>
#include <vector>

#include "cad/curve_table.h"
#include "cad/topology_match.h"
#include "surface/face_progress.h"
#include "surface/motion_prediction.h"

namespace cadmorph {

/// Both models, their match, and what the match predicts: the input of every map.
struct ModelPair {
  const CadModel& base;
  const CadModel& variant;
  const TopologyMatch& match;
  const MotionPrediction& prediction;
};

/// A place on a base curve where a corner of something else stands, and where that corner goes.
struct CurveJoint {
  CurveLocation base;
  Eigen::Vector3d to;  ///< millimetres
};

/// Maps locations on a base curve to its variant: by equal relative parameters (Sieger et al. 2013,
/// sect. 4), those of a face beside it where its own tell nothing of the part; by equal length
/// fractions where the chains of edges differ or set_phase() says so; by nearest points where the
/// curve is the same one under another parametrisation. The sense of the curve comes from its
/// corners, or where it has none from the faces to its left and right, or from the prediction where
/// these have no outside.
class CurveMap {
 public:
  CurveMap(const ModelPair& pair, int base_curve);

  CurveLocation operator()(const CurveLocation& base) const;

  /// Nearest place on the variant's curve.
  EdgeFoot nearest(const Eigen::Vector3d& x) const { return variant_.nearest(x); }

  /// Leads the map through joints, as if the curve were cut there: the pieces between them are
  /// stretched evenly. Joints that leave the curve or pass each other are left out.
  void lead_through(const std::vector<CurveJoint>& joints);

  /// For a closed curve mapped by its parameters that kept its form up to size, nearly at least:
  /// the turn by which this differs from the phase of least motion, along the curve's axis, of
  /// length (0, 1/2] turns; nullopt for other curves.
  const std::optional<Eigen::Vector3d>& turn() const { return turn_; }

  /// A closed curve in the phase of least motion, for its parameters tell nothing.
  bool is_by_least_motion() const { return is_by_least_motion_; }

  /// Of a curve with a turn(): it kept its form to the digits of its sampling.
  bool keeps_form() const { return keeps_form_; }

  /// Cosine and sine (times a positive number) of the angle about `axis` by which the map turns the
  /// curve beyond the match's alignment.
  Eigen::Vector2d spin(const Eigen::Vector3d& axis) const { return spin(way_, axis); }

  /// The same of the phase of least motion, for a curve with a turn().
  Eigen::Vector2d spin_of_least_motion(const Eigen::Vector3d& axis) const {
    return spin(least_motion_, axis);
  }

  /// Sums of squares of how far the map moves the curve, beyond `motion`: by the parameters, and by
  /// the phase of least motion.
  Eigen::Vector2d moved_beyond(const Similarity& motion) const;

  /// Takes the phase of least motion: the start of the parametrisation moved, not the part.
  void take_least_motion() {
    way_ = least_motion_;
    if (turn_) turn_->setZero();
  }

 private:
  enum class Mode { Parameter, Range, Face, Length, Nearest };
  struct Way {
    Mode mode = Mode::Parameter;
    bool is_reversed = false;
    std::size_t shift = 0;  // of the links, closed chains by parameter
    double phase = 0;       // of the fraction, closed curves by range, face or length
  };

  // Where the map leads, as a length fraction of the variant, and how much farther a joint does.
  struct Stretch {
    double fraction, shift;
  };

  CurveLocation apply(const Way& way, const CurveLocation& base) const;
  double shift(double fraction) const;
  CurveLocation by_parameter(const Way& way, const CurveLocation& base) const;
  CurveLocation by_range(const Way& way, const CurveLocation& base) const;
  bool has_equal_range() const;
  Way best_start() const;
  double deviation(const Way& way) const;
  Way best_phase(bool is_reversed) const;
  Way polished(Way way) const;
  Way choose();
  Way best_shift() const;
  bool has_own_parameters() const;
  void find_progress();
  Way by_face(const Way& way);
  Way choose_closed(bool has_equal_links);
  bool stays(const Way& way) const;
  bool is_reparametrised(const Way& way) const;
  double change_of_form(const Way& way) const;
  Eigen::Vector2d spin(const Way& way, const Eigen::Vector3d& axis) const;
  Eigen::Vector3d axis() const;
  double shift_along(const CurveLocation& from, const CurveLocation& to) const;
  bool runs_backward() const;
  std::optional<bool> runs_backward_by_faces() const;
  bool is_same_under_alignment() const;

  const ModelPair* pair_;  // while constructing
  Similarity alignment_;
  const CadCurve* base_curve_;
  const CadCurve* variant_curve_;
  CurveTable base_;
  CurveTable variant_;
  std::optional<FaceProgress> base_progress_, variant_progress_;
  std::vector<CurveLocation> probes_;
  std::vector<Eigen::Vector3d> predicted_;  // of the probes
  Way way_, least_motion_;
  std::vector<Stretch> stretches_;  // in order, from end to end; closed: from a joint round to it
  std::optional<Eigen::Vector3d> turn_;
  bool keeps_form_ = false, is_by_least_motion_ = false;
};

}  // namespace cadmorph
