#include "surface/mesh_unit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cad/face_sampler.h"

namespace cadmorph {
namespace {

struct Unit {
  double mm;
  const char* name;
};

constexpr std::array<Unit, 5> kUnits{
    {{1, "mm"}, {1000, "m"}, {10, "cm"}, {25.4, "inch"}, {304.8, "foot"}}};
constexpr Index kProbes = 400;
constexpr Index kSamples = 10'000;
constexpr double kClearlyBetter = 1.1;
constexpr double kSameSize = 0.02;  // of the diagonal: a coarse mesh cuts corners
constexpr double kReach = 0.02;     // of the mesh's size

}  // namespace

double detect_mesh_unit(const CadModel& base, const Mesh& mesh, const Boundary& boundary) {
  const double size = (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
  const FaceSamples samples = sample_faces(base, kSamples);
  const KdTree tree(samples.points);
  const auto nodes = static_cast<Index>(boundary.nodes.size());
  const Index stride = std::max<Index>(1, nodes / kProbes);
  // Places of the CAD that probes lie at, each once, by the part of it that they span: in too small
  // a unit the body lies at one place, a symmetry plane perhaps on one face.
  const auto hits = [&](double mm) {
    const double reach = std::min(samples.spacing, kReach * mm * size);
    std::vector<Index> places;
    for (Index i = 0; i < nodes; i += stride) {
      const Eigen::Vector3d x = mm * mesh.points.row(boundary.nodes[i]);
      const Neighbour nearest = tree.nearest(x.data(), 1)[0];
      if (nearest.squared_distance <= reach * reach) places.push_back(nearest.index);
    }
    if (places.empty()) return 0.0;
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    const RowMatrix at = samples.points(places, Eigen::all);
    const double span =
        (at.colwise().maxCoeff() - at.colwise().minCoeff()).norm() / base.diagonal();
    return static_cast<double>(places.size()) * span * span;
  };
  // The size alone decides nothing: that of a far field may be the CAD's in another unit.
  double best_unit = 1;
  for (const Unit& unit : kUnits)
    if (std::abs(unit.mm * size / base.diagonal() - 1) < kSameSize) best_unit = unit.mm;
  double best = hits(best_unit);
  for (const Unit& unit : kUnits) {
    const double found = hits(unit.mm);
    if (found > kClearlyBetter * best) {
      best = found;
      best_unit = unit.mm;
    }
  }
  return best_unit;
}

std::string mesh_unit_name(double mm_per_unit) {
  for (const Unit& unit : kUnits)
    if (std::abs(unit.mm / mm_per_unit - 1) < 1e-9) return unit.name;
  return std::to_string(mm_per_unit) + " mm";
}

}  // namespace cadmorph
