#pragma once

#include <vector>

#include "core/types.h"

namespace cadmorph {

/// The distinct rows of a point set.
struct DistinctRows {
  std::vector<Index> rows;   ///< first row of each distinct point, ascending
  std::vector<Index> group;  ///< for each row, its position in `rows`

  template <class Archive>
  void serialize(Archive& archive) {
    archive(rows, group);
  }
};

/// Finds rows that are equal to the last bit. O(N log N).
DistinctRows distinct_rows(const RowMatrix& points);

/// Coordinates of unit size about the centroid of a point set, and the linear polynomials that the
/// set determines: 1, and one along each principal axis in which the set has an extent. On the set
/// itself the polynomials are orthogonal, with N as the square of their norm.
class CentreFrame {
 public:
  explicit CentreFrame(const RowMatrix& points);

  /// Length of one unit, in the unit of the points.
  double unit() const { return unit_; }

  /// Returns points (any number x D) in unit coordinates, column-major for the kernel sums.
  Eigen::MatrixXd to_unit(const RowMatrix& points) const;

  /// Returns the polynomials at unit coordinates: rows x terms().
  Eigen::MatrixXd polynomials(const Eigen::Ref<const Eigen::MatrixXd>& unit_points) const;

  /// Returns the linear function of polynomials(x) * coefficients as constant and slopes by the
  /// coordinates x: (D + 1) x M.
  Eigen::MatrixXd linear(const Eigen::MatrixXd& coefficients) const;

  /// Likewise, by the coordinates of the points that the frame was made of.
  Eigen::MatrixXd linear_in_given(const Eigen::MatrixXd& coefficients) const;

  const Eigen::RowVectorXd& centre() const { return centre_; }
  Index dimension() const { return centre_.size(); }
  int terms() const { return static_cast<int>(slopes_.cols()) + 1; }

 private:
  Eigen::RowVectorXd centre_;
  double unit_ = 1;
  Eigen::MatrixXd slopes_;  // D x (terms - 1)
};

}  // namespace cadmorph
