#pragma once

#include <optional>
#include <vector>

#include "core/rbf/anchors.h"
#include "surface/free_patches.h"

namespace cadmorph {

/// Moves the free nodes of a planar patch's lines along them, linearly between the nodes on either
/// side, by those nodes' motion along the line; then its inner nodes in its plane with the nodes it
/// touches, by a 2D RBF (r^2 log r) whose border goes with its lines or stays fixed. Those of a
/// curved patch go by an RBF in space (r^3) and from there to the nearest point of its surface
/// (FreePatch::form); what they are off it, they stay off. `moved` holds all surface nodes' new
/// positions (millimetres) and is updated. Two patches move their common line alike.
void slide_patch(const SurfaceMesh& surface, const FreePatch& patch, Points& moved);

/// The point of a patch (planar, or with a form) nearest to x, for a node that stays as far off the
/// patch as it is at `from`.
Eigen::Vector3d onto_patch(const FreePatch& patch, RowId node, const Eigen::Vector3d& from,
                           const Eigen::Vector3d& x);

/// What slide_patch does, one patch after the other, as a linear map of the displacements of all
/// surface nodes, the anchors held that `moved` took, and the transpose of that map. Sheets that
/// are images of each other go each by themselves: others than mirrored displacements may be asked
/// for.
class SlideDerivative {
 public:
  /// `moved`: where all surface nodes are, millimetres.
  SlideDerivative(const SurfaceMesh& surface, const std::vector<FreePatch>& patches,
                  const Points& moved);

  /// Returns the displacements with those that follow in place of what is given for them: n x 3 k,
  /// k displacements side by side.
  RowMatrix forward(RowMatrix displacements) const;

  /// Returns the derivative by the displacements given (0 by those that follow) for that by all.
  RowMatrix adjoint(RowMatrix slopes) const;

 private:
  // Nodes of a line that go with the nodes on either side.
  struct OnLine {
    Eigen::RowVector3d direction;
    struct Node {
      RowId node, before, after;
      double part;  // of the way from `before` to `after`
    };
    std::vector<Node> nodes;
  };
  // Nodes of a patch that go with its border.
  struct OnPatch {
    Eigen::Matrix3Xd basis;
    std::vector<RowId> border, inner;
    FieldMap field;
    std::vector<Eigen::Matrix3d> slopes;  // of the way onto a curved surface, by inner nodes
  };
  struct Step {
    std::vector<OnLine> lines;
    std::optional<OnPatch> patch;
  };

  std::vector<Step> steps_;
};

}  // namespace cadmorph
