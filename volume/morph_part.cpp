#include "volume/morph_part.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/archive_types.h"
#include "core/edge_lengths.h"
#include "core/kd_tree.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

// Nodes lie on two sides of a slit that are nearer than the first part of a node's shortest mesh
// edge, or than the second of its longest: where an edge spans the slit, that is the shortest.
constexpr double kOpenSlit = 1e-4, kSpannedSlit = 3e-6;

std::vector<Index> at(const std::vector<Index>& list, const std::vector<Index>& positions) {
  std::vector<Index> result;
  for (const Index position : positions) result.push_back(list[position]);
  return result;
}

RowMatrix centres_of(const Component& nodes, const Mesh& mesh,
                     const std::vector<Index>& surface_nodes) {
  const std::vector<Index> ids = at(surface_nodes, nodes.surface);
  return mesh.points(ids, Eigen::all);
}

}  // namespace

NodeScales node_scales(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                       const RbfOptions& options) {
  const IncidentEdges edges = incident_edges(mesh);
  const Eigen::VectorXd shortest = edges.shortest(surface_nodes);
  return {options.local_length.size() > 0 ? options.local_length : shortest,
          (kOpenSlit * shortest).cwiseMax(kSpannedSlit * edges.longest(surface_nodes))};
}

std::vector<Index> clear_of_each_other(const RowMatrix& points, const Eigen::VectorXd& reach) {
  const KdTree tree(points);
  const Index count = points.rows();
  std::vector<std::vector<Index>> near(static_cast<std::size_t>(count));
  parallel_for(count, 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for (const Neighbour& other : tree.within(points.row(i).data(), reach[i]))
        if (other.index < i) near[i].push_back(other.index);
  });
  std::vector<char> is_kept(static_cast<std::size_t>(count), 1);
  std::vector<Index> kept;
  for (Index i = 0; i < count; ++i) {
    is_kept[i] = std::none_of(near[i].begin(), near[i].end(), [&](Index j) { return is_kept[j]; });
    if (is_kept[i]) kept.push_back(i);
  }
  return kept;
}

PartTargets targets_of(const MorphPart& part, const Points& base) {
  PartTargets targets{base(part.nodes.volume, Eigen::all),
                      std::ssize(part.nodes.volume) - part.nodes.loose, 0};
  if (part.nodes.loose == 0 || part.centres.rows() == 0) return targets;
  const Eigen::RowVector3d middle = part.centres.colwise().mean();
  const double radius =
      std::sqrt((part.centres.rowwise() - middle).rowwise().squaredNorm().maxCoeff());
  for (Index i = targets.of_cells; i < targets.points.rows(); ++i) {
    const Eigen::RowVector3d way = targets.points.row(i) - middle;
    const double distance = way.norm();
    if (distance <= radius) continue;
    targets.points.row(i) = middle + radius / distance * way;
    ++targets.beyond;
  }
  return targets;
}

void add_system(MorphPart& part, const NodeScales& scales, const VolumeMorphOptions& options) {
  const auto clear = clear_of_each_other(part.centres, scales.slits(part.nodes.surface));
  part.dropped = part.centres.rows() - static_cast<Index>(clear.size());
  part.nodes.surface = at(part.nodes.surface, clear);
  part.centres = RowMatrix(part.centres(clear, Eigen::all));
  RbfOptions rbf = options.rbf;
  rbf.local_length = scales.lengths(part.nodes.surface);
  // A node without an edge gives no scale of its own: leave the choice to the solver.
  if (rbf.local_length.minCoeff() <= 0) rbf.local_length.resize(0);
  part.lengths = rbf.local_length;
  part.system.emplace(part.centres, options.kernel, rbf);
}

MorphPart make_part(Component nodes, const Mesh& mesh, const std::vector<Index>& surface_nodes,
                    const NodeScales& scales, const VolumeMorphOptions& options) {
  MorphPart part;
  part.nodes = std::move(nodes);
  part.centres = centres_of(part.nodes, mesh, surface_nodes);
  if (part.nodes.volume.empty() || part.nodes.surface.empty()) return part;
  add_system(part, scales, options);
  const PartTargets targets = targets_of(part, mesh.points);
  part.beyond = targets.beyond;
  part.targets.emplace(*part.system, targets.points);
  return part;
}

MorphPart restore_part(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                       const VolumeMorphOptions& options, InputArchive& archive) {
  MorphPart part;
  archive(part.nodes, part.dropped, part.beyond, part.lengths);
  part.centres = centres_of(part.nodes, mesh, surface_nodes);
  if (!take<bool>(archive)) return part;
  part.system.emplace(part.centres, options.kernel, options.rbf, archive);
  part.targets.emplace(*part.system, archive);
  return part;
}

void store_part(const MorphPart& part, OutputArchive& archive) {
  archive(part.nodes, part.dropped, part.beyond, part.lengths, part.system.has_value());
  if (!part.system) return;
  part.system->store(archive);
  part.targets->store(archive);
}

}  // namespace cadmorph
