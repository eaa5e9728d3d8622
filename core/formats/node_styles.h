#pragma once

#include "core/formats/deck.h"

namespace cadmorph {

/// "number, x, y, z" between commas, or blanks where there is no comma, and what may follow.
class FreeNodeLine : public NodeStyle {
 public:
  std::string_view read(std::string_view record, Eigen::RowVector3d& point) const override;
  void write(std::string_view record, const Eigen::RowVector3d& point,
             const std::array<bool, 3>& is_changed, double least, std::string& text) const override;
};

/// Coordinates in columns, one beside the other. A line may end before its last zeros.
class NodeColumns : public NodeStyle {
 public:
  /// `decimals`, if not negative: every number is written as Fortran's Ew.dEe does it
  /// ("-1.2345E+001"), which some readers count on; else in as many digits as fit.
  NodeColumns(std::size_t first, std::size_t width, int decimals = -1, int exponent_digits = 2)
      : first_(first), width_(width), decimals_(decimals), exponent_digits_(exponent_digits) {}

  std::string_view read(std::string_view record, Eigen::RowVector3d& point) const override;
  void write(std::string_view record, const Eigen::RowVector3d& point,
             const std::array<bool, 3>& is_changed, double least, std::string& text) const override;

 private:
  std::string number(double value) const;

  std::size_t first_, width_;
  int decimals_, exponent_digits_;
};

}  // namespace cadmorph
