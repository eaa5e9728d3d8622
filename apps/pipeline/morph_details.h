#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// How many values lie in each of equal bins of [low, high], before and after a morph.
struct Histogram {
  double low = 0, high = 1;
  std::vector<Index> before, after;

  bool is_empty() const {
    const auto is_zero = [](Index count) { return count == 0; };
    return std::ranges::all_of(before, is_zero) && std::ranges::all_of(after, is_zero);
  }
};

/// One of the worst elements of a morphed mesh.
struct WorstElement {
  Index cell = -1;
  std::string name;              ///< with its number in the file
  double before = 0, after = 0;  ///< scaled Jacobian
  Eigen::Vector3d centre;        ///< mean of its nodes after the morph, in the mesh's unit
  FaceId face;                   ///< variant CAD face nearest to it
};

/// What of a morph needs more than a figure to tell.
struct MorphDetails {
  Histogram scaled_jacobian;  ///< of the measured cells
  Histogram deviation;        ///< log10 of surface nodes' distances to the CAD, in millimetres
  Index exact_before = 0, exact_after = 0;  ///< surface nodes nearer than the lowest bin
  std::vector<WorstElement> worst;          ///< worst first
};

struct DetailOptions {
  int jacobian_bins = 50;
  int bins_per_decade = 2;         ///< of the deviation
  double least_deviation = 1e-13;  ///< millimetres; below is the rounding of coordinates
  Index worst = 20;                ///< elements to list
};

/// Gathers the details of a result. O(cells + F log F) for F surface facets.
MorphDetails gather_details(const MorphResult& result, const DetailOptions& options = {});

}  // namespace cadmorph
