#pragma once

#include <Eigen/Geometry>
#include <array>
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

/// How a closed curve, which no corner holds, may be laid on its variant.
enum class Start {
  Parameters,  ///< where the parameters of both files put it
  InPlace,     ///< turned least against where it was
  WithPart,    ///< turned as the match's alignment
  Predicted    ///< turned as predicted from what is round it
};
inline constexpr int kStarts = 4;  // of Start

/// Where a closed curve lies in the base, and goes.
struct ClosedPlace {
  Eigen::Vector3d centre, image;  ///< means of its places and of their images, millimetres
  Eigen::Vector3d axis;           ///< of the area it runs round, length 1
  double size;                    ///< root mean square distance from the centre

  /// How far from the curve's axis a point lies, in its sizes.
  double off_axis(const Eigen::Vector3d& x) const { return axis.cross(x - centre).norm() / size; }
};

/// The motion of what is round a closed curve.
struct MotionAround {
  Similarity motion;
  bool is_of_places = false;  ///< of closed curves' centres round it, not of curves between corners
};

/// Maps locations on a base curve to its variant: by equal relative parameters (Sieger et al. 2013,
/// sect. 4), those of a face beside it where its own tell nothing of the part; by equal length
/// fractions where the chains of edges differ; by length or shape (CurveMeasure) where the
/// parameters of free forms strain the curve; by nearest points where the curve is the same one
/// under another parametrisation. The sense of the curve comes from its corners, or where it has
/// none from the faces to its left and right, or from the prediction where these have no outside.
/// Where a closed curve starts is chosen by cost (see map_curves): its parameters may only tell
/// where a kernel put the seam.
class CurveMap {
 public:
  CurveMap(const ModelPair& pair, CurveId base_curve);

  CurveLocation operator()(const CurveLocation& base) const;

  /// Nearest place on the variant's curve.
  EdgeFoot nearest(const Eigen::Vector3d& x) const { return variant_.nearest(x); }

  /// Leads the map through joints, as if the curve were cut there: the pieces between them are
  /// stretched evenly. Joints that leave the curve or pass each other are left out.
  void lead_through(const std::vector<CurveJoint>& joints);

  bool is_closed() const { return base_curve_->is_closed(); }

  /// Judges the starts of a closed curve by how far they turn it against what is round it: by
  /// `around`, or where nothing is there by the prediction.
  void rate_starts(const std::optional<MotionAround>& around);

  /// What a start of a closed curve costs, in bits (docs/cad-and-surface.md); where the parameters
  /// don't correspond, theirs costs what the cheapest of the others does.
  double cost(Start start) const { return costs_[static_cast<std::size_t>(start)]; }

  /// Whether its turn is told by the centres of the curves round it.
  bool is_told_by_places() const { return is_told_by_places_; }

  /// Whether a closed curve is the same one in both models under the alignment.
  bool is_same() const { return is_same_; }

  /// Maps by that start, or where the parameters don't correspond by the cheapest.
  void take(Start start);

  /// Where a closed curve lies, and goes, wherever it starts.
  ClosedPlace place() const;

  /// Appends places of the base's curve and their images, each seen from their mean.
  void add_images(std::vector<Eigen::Vector3d>& from, std::vector<Eigen::Vector3d>& to) const;

 private:
  enum class Mode { Parameter, Range, Face, Length, Shape, Nearest };
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

  using Images = std::vector<Eigen::Vector3d>;  // of the probes

  CurveLocation apply(const Way& way, const CurveLocation& base) const;
  double shift(double fraction) const;
  CurveLocation by_parameter(const Way& way, const CurveLocation& base) const;
  CurveLocation by_range(const Way& way, const CurveLocation& base) const;
  bool has_equal_range() const;
  Images places() const;
  Images images(const Way& way) const;
  double deviation(const Way& way, const Images& from) const;
  double turn(const Way& way, const Images& against) const;
  double bend(const Way& way) const;
  double strain(const Way& way) const;
  Way less_strained(const Way& way) const;
  Way best_phase(Way way, const Images& to) const;
  Way polished(Way way, const Images& to) const;
  Way choose();
  Way best_shift(bool is_reversed) const;
  Way best_start(bool is_reversed) const;
  bool has_own_parameters() const;
  void find_progress();
  Way by_face(const Way& way);
  void find_starts();
  bool starts_at_free_form() const;
  Way turned_by(const Similarity& motion) const;
  bool runs_backward() const;
  std::optional<bool> runs_backward_by_faces() const;
  bool is_same_under(const Similarity& motion) const;
  bool rests(const Points& at) const;

  const ModelPair* pair_;  // while constructing
  Similarity alignment_;
  const CadCurve* base_curve_;
  const CadCurve* variant_curve_;
  CurveTable base_;
  CurveTable variant_;
  std::optional<FaceProgress> base_progress_, variant_progress_;
  std::vector<CurveLocation> probes_;
  Images predicted_;
  Way way_;
  Way turned_;                                      // of a closed curve: any phase
  std::array<std::optional<Way>, kStarts> starts_;  // of a closed curve
  std::array<double, kStarts> costs_{};
  bool rests_ = false, is_same_ = false, is_free_form_ = false, is_told_by_places_ = false;
  std::vector<Stretch> stretches_;  // in order, from end to end; closed: from a joint round to it
};

using CurveMaps = IdVector<CurveId, CurveMap>;  ///< by curve of the base

}  // namespace cadmorph
