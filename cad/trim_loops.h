#pragma once

#include <vector>

#include "cad/ids.h"
#include "cad/pcurve.h"

namespace cadmorph {

/// The wires of a face in its parameter domain as closed loops of chords. Inside is decided by the
/// pcurves themselves where a point is so near that their chords would not do.
class TrimLoops {
 public:
  /// Appends a pcurve between vertices of the model (ids, -1: none); `is_reversed`: run through
  /// backwards, from `end` to `start`.
  void add(const Pcurve& pcurve, bool is_reversed, VertexId start, VertexId end);

  /// Joins what meets at the vertices. To be called once, after all pcurves.
  void close();

  bool empty() const { return chords_.empty(); }
  const Eigen::Vector2d& lower() const { return lower_; }  ///< bounds of the chords
  const Eigen::Vector2d& upper() const { return upper_; }

  /// Whether the loops enclose a point. Costs as much as there is of them at its height.
  bool contains(const Eigen::Vector2d& uv) const;

  /// Values of u, ascending, where chords cross the line v = const.
  std::vector<double> crossings(double v) const;

 private:
  struct Chord {
    Eigen::Vector2d from, to;
    int pcurve = -1;              ///< -1: joins two of them
    double t_from = 0, t_to = 0;  ///< of the edge
    double bulge = 0;             ///< most that the pcurve is off the chord, in its length (scaled)
  };
  struct End {
    VertexId vertex;
    Eigen::Vector2d at;
  };

  Eigen::Vector2d scaled(const Eigen::Vector2d& uv) const;
  std::size_t bin(double height) const;
  void join_ends();
  void measure_bulge(Chord& chord) const;
  void fill_bins();
  bool is_between(const Chord& chord, const Eigen::Vector2d& at) const;
  double winding_angle(const Eigen::Vector2d& uv) const;

  std::vector<Pcurve> pcurves_;
  std::vector<Chord> chords_;
  std::vector<End> arrivals_, departures_;
  Eigen::Vector2d lower_ = Eigen::Vector2d::Zero(), upper_ = Eigen::Vector2d::Zero();
  bool is_open_ = false;
  double least_height_ = 0, bins_per_height_ = 0;
  std::vector<std::size_t> first_of_bin_, binned_;  // chords at the heights of a bin
};

}  // namespace cadmorph
