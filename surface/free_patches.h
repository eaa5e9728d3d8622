#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/rbf/anchors.h"
#include "surface/association.h"
#include "surface/surface_mesh.h"

namespace cadmorph {

/// Where two planar patches that slide meet: nodes of both, in their order along a straight line.
struct FreeLine {
  Eigen::Vector3d direction;
  std::vector<int> nodes;
  std::vector<char> is_free;  ///< one a node; others are on the CAD, on further patches, or ends
};

/// A connected part of the mesh's outside that lies on no CAD face: a side of a far field, a
/// symmetry plane.
struct FreePatch {
  std::vector<int> facets;
  std::vector<int> inner;       ///< unmatched nodes of this patch alone
  std::vector<int> border;      ///< unmatched nodes shared with another patch
  std::vector<int> touched;     ///< nodes shared with the matched surface
  std::vector<FreeLine> lines;  ///< of its border, those that the CAD touches
  Eigen::Vector3d origin, normal;
  bool is_planar;
};

/// Marks the facets of the outside that cancel: two at one place with opposite normals, whose nodes
/// lie two at a place, on no CAD face. They are a crack inside of the mesh, no surface of the part.
std::vector<char> find_cracks(const SurfaceMesh& surface, const Boundary& boundary,
                              const Association& association);

/// What to tell of a crack; empty where there is none.
std::string describe_cracks(const SurfaceMesh& surface, const Boundary& boundary,
                            const Association& association);

/// Splits the unmatched facets of the outside into patches: planar ones, and the curved rest.
std::vector<FreePatch> find_free_patches(const SurfaceMesh& surface, const Boundary& boundary,
                                         const Association& association);

/// Marks unmatched nodes on interfaces between regions and on cracks as free, and throws
/// AssociationError where the unmatched outside can't be a far field or a symmetry plane: the mesh
/// covers less than a quarter of the CAD's faces by half their area, or reaches no further than 1.2
/// times the CAD, or unmatched nodes lie by the CAD amid matched ones.
void check_unmatched(const CadModel& base, const Boundary& boundary, const SurfaceMesh& surface,
                     Association& association);

/// How far nodes of a plane may lie off it, millimetres: coordinates are rounded in proportion to
/// their size.
double plane_tolerance(const SurfaceMesh& surface);

/// Moves the free nodes of a planar patch's lines along them, linearly between the nodes on either
/// side, by those nodes' motion along the line; then its inner nodes in its plane with the nodes it
/// touches, by a 2D RBF (r^2 log r) whose border goes with its lines or stays fixed. `moved` holds
/// all surface nodes' new positions (millimetres) and is updated. Two patches move their common
/// line alike.
void slide_patch(const SurfaceMesh& surface, const FreePatch& patch, Points& moved);

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
      int node, before, after;
      double part;  // of the way from `before` to `after`
    };
    std::vector<Node> nodes;
  };
  // Nodes in a plane that go with its border.
  struct InPlane {
    Eigen::Matrix<double, 3, 2> basis;
    std::vector<int> border, inner;
    FieldMap field;
  };
  struct Step {
    std::vector<OnLine> lines;
    std::optional<InPlane> plane;
  };

  std::vector<Step> steps_;
};

}  // namespace cadmorph
