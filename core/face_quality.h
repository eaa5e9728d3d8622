#pragma once

#include <vector>

#include "core/finite_volumes.h"

namespace cadmorph {

/// How well the faces of each cell suit a finite-volume scheme: the least over its faces of the
/// cosines of the non-orthogonality and of the skewness s taken as an angle, arctan(s tan(70
/// deg) / 4). So both are cos(70 deg) at checkMesh's limits, 70 degrees and 4. One where all lines
/// between neighbours' centres pass their faces upright in the middle, not positive where a centre
/// lies behind a face. Of every cell of the mesh, NaN for those that are no finite volumes;
/// `points` (N x 3): its nodes. Parallel; O(faces).
std::vector<double> face_quality(const FiniteVolumes& volumes, const Points& points);

/// The values of face_quality where only the nodes of `cells` (ids, ascending) moved since
/// `before`.
std::vector<double> face_quality_again(std::vector<double> before, const FiniteVolumes& volumes,
                                       const Points& points, const std::vector<Index>& cells);

/// The angle of such a cosine, in degrees.
double face_angle(double quality);

namespace finite_volume {

/// The tangent of the skewness taken as an angle, over the skewness.
extern const double kSkewnessSlope;

}  // namespace finite_volume
}  // namespace cadmorph
