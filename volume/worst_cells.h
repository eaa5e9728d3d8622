#pragma once

#include <cmath>
#include <vector>

#include "core/face_quality.h"
#include "core/quality.h"

namespace cadmorph {

/// What of a mesh's elements a solver feels first.
struct WorstCells {
  double min = 0;              ///< smallest scaled Jacobian, or face_quality
  double worst_twentieth = 0;  ///< mean of it over the worst 5 % of the cells
};

/// Of the cells that a report measured.
WorstCells worst_cells(const QualityReport& quality);

/// Of face_quality with the nodes at `points` (N x 3).
WorstCells worst_faces(const FiniteVolumes& volumes, const Points& points);

/// The lesser of the two figures' shares of the base's, at most 1.
double least_share(const WorstCells& after, const WorstCells& base);

/// The sum of the two figures' shares of the base's, of any size.
double sum_of_shares(const WorstCells& after, const WorstCells& base);

/// Values of face_quality (of each cell; NaN: none) as a report of their smallest and all of them.
QualityReport quality_of_faces(std::vector<double> values);

inline bool is_measured(double value) { return !std::isnan(value); }

/// Values of one bin differ by less than 1/1024. The bin of a value from -1 to 1.
std::size_t quality_bin(double value);

}  // namespace cadmorph
