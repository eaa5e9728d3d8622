#include "surface/mesh_unit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "core/errors.h"
#include "core/length_units.h"
#include "core/remedies.h"

namespace cadmorph {
namespace {

constexpr Index kProbes = 400;  // nodes asked: their share is known to 2.5 %
// Of the CAD, to look near them: 1 % of the square root of its area apart.
constexpr Index kSamples = 10'000;
constexpr double kOnCad = 0.1;          // of the local edge, as the association takes
constexpr double kSameSize = 0.02;      // of the diagonal: a coarse mesh cuts corners
constexpr double kNearSample = 1.5;     // of a face's sample spacing: farther is beyond its wires
constexpr double kClearlyBetter = 1.1;  // four times what kProbes leave a share unsure by
// Of the best score: in the next smaller unit (2.54 times) a mesh that lies on the CAD in both
// spans less, and has a sixth of its score.
constexpr double kComparable = 0.5;
// A lower score is chance. The tests of units pass with a tenth and ten times as much, and with
// half and twice of kNearSample.
constexpr double kFits = 0.02;
constexpr double kLies = 0.9;     // share and span of a mesh that lies on the CAD, but for strays
constexpr Index kFacesTried = 4;  // samples next to a node: by a corner they are of three faces

/// A surface node, in the mesh's unit.
struct Probe {
  Eigen::Vector3d point;
  double edge;  ///< shortest facet edge at it
};

std::vector<Probe> choose_probes(const Mesh& mesh, const Boundary& boundary) {
  const Index nodes = std::ssize(boundary.nodes), stride = std::max<Index>(1, nodes / kProbes);
  std::vector<Probe> probes;
  std::vector<int> probe_of(static_cast<std::size_t>(mesh.node_count()), -1);
  for (Index i = 0; i < nodes; i += stride) {
    const Index node = boundary.nodes[i];
    probe_of[node] = static_cast<int>(probes.size());
    probes.push_back({mesh.points.row(node), std::numeric_limits<double>::infinity()});
  }
  const auto add = [&](Index node, double length) {
    if (probe_of[node] < 0 || length == 0) return;
    double& edge = probes[probe_of[node]].edge;
    edge = std::min(edge, length);
  };
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    if (boundary.neighbour[f] >= 0) continue;  // may be a part that no CAD tells of
    const auto facet = boundary.facet(f);
    const int corners = corner_count(boundary.types[f], std::ssize(facet));
    for (int c = 0; c < corners; ++c) {
      const Index a = facet[c], b = facet[(c + 1) % corners];
      const double length = (mesh.points.row(a) - mesh.points.row(b)).norm();
      add(a, length);
      add(b, length);
    }
  }
  // Mid-side nodes stand beside corners that tell as much.
  std::erase_if(probes, [](const Probe& probe) { return !std::isfinite(probe.edge); });
  return probes;
}

/// How well the mesh fits in a unit.
struct Fit {
  LengthUnit unit;
  double share = 0;  ///< of the probes that lie on the CAD
  double span = 0;   ///< of the CAD's diagonal, by the probes on it
  bool is_of_one_size = false;

  /// In too small a unit all nodes may lie on the CAD, but on little of it: a plane mesh on its
  /// plane, a body at the origin.
  double score() const { return share * span * span; }
};

class FitFinder {
 public:
  explicit FitFinder(const CadModel& base)
      : base_(base), samples_(sample_faces(base, kSamples)), tree_(samples_.points) {}

  Fit operator()(const LengthUnit& unit, const std::vector<Probe>& probes, double mesh_size,
                 const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) const {
    Fit fit{.unit = unit};
    Eigen::AlignedBox3d box;
    Index found = 0;
    for (const Probe& probe : probes) {
      const Eigen::Vector3d x = unit.mm * probe.point + shift;
      if (!is_on_cad(x, kOnCad * unit.mm * probe.edge)) continue;
      ++found;
      box.extend(x);
    }
    if (found > 0) {
      fit.share = static_cast<double>(found) / static_cast<double>(probes.size());
      fit.span = std::min(1.0, box.diagonal().norm() / base_.diagonal());
    }
    fit.is_of_one_size = std::abs(unit.mm * mesh_size / base_.diagonal() - 1) < kSameSize;
    return fit;
  }

 private:
  bool is_on_cad(const Eigen::Vector3d& x, double tolerance) const {
    for (const Neighbour& near : tree_.nearest(x.data(), kFacesTried)) {
      const FaceId face = samples_.face[near.index];
      const double reach = kNearSample * samples_.face_spacing[face] + tolerance;
      if (near.squared_distance > reach * reach) continue;
      const FaceFoot foot = project_on_face(base_, face, x, samples_.uv[near.index]);
      if (foot.distance <= tolerance + base_.faces()[face].tolerance) return true;
    }
    return false;
  }

  const CadModel& base_;
  FaceSamples samples_;
  KdTree tree_;
};

[[noreturn]] void refuse(const Fit& a, const Fit& b) {
  const auto percent = [](double share) { return std::to_string(std::lround(100 * share)) + " %"; };
  throw AssociationError("the mesh's unit can't be told: in " + std::string(a.unit.name) + " " +
                         percent(a.share) + " of its surface nodes lie on the CAD, in " +
                         b.unit.name + " " + percent(b.share) + "; say which it is (" +
                         words_for(Remedy::MeshUnit) + ")");
}

}  // namespace

double detect_mesh_unit(const CadModel& base, const Mesh& mesh, const Boundary& boundary) {
  const double size = (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
  const std::vector<Probe> probes = choose_probes(mesh, boundary);
  const FitFinder find(base);
  std::vector<Fit> fits;
  for (const LengthUnit& unit : kLengthUnits) fits.push_back(find(unit, probes, size));
  const double best = std::ranges::max(fits, {}, &Fit::score).score();
  // Off the CAD in any unit: the size is all that is left to go by.
  if (best < kFits) {
    const auto alike = std::ranges::find_if(fits, &Fit::is_of_one_size);
    return alike == fits.end() ? 1.0 : alike->unit.mm;
  }
  std::erase_if(fits, [&](const Fit& fit) { return fit.score() < kComparable * best; });
  // All nodes on the CAD beat any other fit, then a clearly better one, then one of the CAD's size:
  // the size of a far field alone may be the CAD's in another unit.
  const auto keep = [&](auto&& is_kept) {
    if (std::ranges::any_of(fits, is_kept)) std::erase_if(fits, std::not_fn(is_kept));
  };
  keep([](const Fit& fit) { return fit.share == 1; });
  const double best_left = std::ranges::max(fits, {}, &Fit::score).score();
  keep([&](const Fit& fit) { return kClearlyBetter * fit.score() >= best_left; });
  keep([](const Fit& fit) { return fit.is_of_one_size; });
  if (fits.size() > 1) refuse(fits[0], fits[1]);
  return fits.front().unit.mm;
}

std::optional<MeshPlace> find_place(const CadModel& cad, const Mesh& mesh, const Boundary& boundary,
                                    double mm) {
  const Eigen::Vector3d lower = mesh.points.colwise().minCoeff();
  const Eigen::Vector3d upper = mesh.points.colwise().maxCoeff();
  const double size = (upper - lower).norm();
  const std::vector<Probe> probes = choose_probes(mesh, boundary);
  const FitFinder find(cad);
  const auto lies = [](const Fit& fit) { return fit.share >= kLies && fit.span >= kLies; };
  std::vector<LengthUnit> units = {{mm, ""}};
  units.insert(units.end(), kLengthUnits.begin(), kLengthUnits.end());
  for (const LengthUnit& unit : units)
    if (lies(find(unit, probes, size))) return MeshPlace{.mm = unit.mm};
  for (const LengthUnit& unit : units) {
    const Eigen::Vector3d shift = (cad.lower() + cad.upper()) / 2 - unit.mm * (lower + upper) / 2;
    if (lies(find(unit, probes, size, shift))) return MeshPlace{.mm = unit.mm, .shift = shift};
  }
  return std::nullopt;
}

}  // namespace cadmorph
