#pragma once

#include <optional>
#include <vector>

#include "core/archive.h"
#include "core/mesh.h"
#include "core/rbf/rbf_system.h"
#include "volume/components.h"
#include "volume/volume_morph.h"

namespace cadmorph {

/// What the mesh says of the scale at each surface node.
struct NodeScales {
  Eigen::VectorXd lengths;  ///< shortest incident edge, or what the options say
  Eigen::VectorXd slits;    ///< nodes this near each other lie on the two sides of a slit
};
NodeScales node_scales(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                       const RbfOptions& options);

/// One component of a volume morph with its system.
struct MorphPart {
  Component nodes;
  RowMatrix centres;                ///< of its surface nodes
  Index dropped = 0;                ///< surface nodes that the other side of a slit stands for
  Index beyond = 0;                 ///< see PartTargets
  Eigen::VectorXd lengths;          ///< local ones of the centres; may be empty
  std::optional<RbfSystem> system;  ///< none where no node is free
  std::optional<RbfTargets> targets;
};

MorphPart make_part(Component nodes, const Mesh& mesh, const std::vector<Index>& surface_nodes,
                    const NodeScales& scales, const VolumeMorphOptions& options);

/// The part that was stored, for the same mesh, surface nodes and options.
MorphPart restore_part(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                       const VolumeMorphOptions& options, InputArchive& archive);
void store_part(const MorphPart& part, OutputArchive& archive);

/// Takes surface nodes out that lie across a slit, and factors the rest.
void add_system(MorphPart& part, const NodeScales& scales, const VolumeMorphOptions& options);

/// Where the field of a part is evaluated for its volume nodes. It is known about the mesh alone,
/// and runs on outside: nodes of no cell beyond the ball about the mesh, such as dummies at the end
/// of the world, move as the nearest point of that ball.
struct PartTargets {
  RowMatrix points;
  Index of_cells =
      0;             ///< rows of nodes of cells, the first; others neither bound nor hold the field
  Index beyond = 0;  ///< nodes of no cell beyond the ball
};
/// `base`: of all nodes.
PartTargets targets_of(const MorphPart& part, const Points& base);

/// Rows of the points that serve as centres, of those within `reach` of each other one: the two
/// sides of a slit would make the system singular to rounding, and its field can't jump between
/// them.
std::vector<Index> clear_of_each_other(const RowMatrix& points, const Eigen::VectorXd& reach);

}  // namespace cadmorph
