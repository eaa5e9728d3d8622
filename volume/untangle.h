#pragma once

#include "core/progress.h"
#include "core/sliding_nodes.h"
#include "core/validity.h"

namespace cadmorph {

struct UntangleOptions {
  /// Rings of cells around the inverted ones whose nodes move; doubled while any remains inverted.
  int rings = 2;
  /// Neighbourhoods grow up to this many times.
  int attempts = 5;
  /// Minimisations a neighbourhood gets, each with the next smaller regularisation.
  int outer_iterations = 30;
  /// Steps of one minimisation.
  int inner_iterations = 150;
  /// Valid cells to improve beside the invalid ones, and their neighbourhoods.
  std::vector<Index> poor_cells = {};
  /// Fixed nodes that may slide, if not null: they move within their surfaces.
  const SlidingNodes* sliding = nullptr;
  /// Whether all edges of second-order cells may bend where no repair with straight ones does: it
  /// takes ten times as long as these, and mostly comes to nothing.
  bool may_bend_all = true;
  /// The most work, as a share of what any repair may take (see untangle).
  double most_work = 1;
  Progress progress = {};
};

struct UntangleReport {
  Index before = 0;  ///< invalid cells
  Index after = 0;
  Index moved_nodes = 0;    ///< free nodes of the last neighbourhood
  Index slid_nodes = 0;     ///< sliding ones that are not where they started
  int rings = 0;            ///< size of the last neighbourhood
  bool fell_short = false;  ///< it ended since at its pace most cells would have stayed invalid
  double max_move = 0;      ///< largest change of a node's position, in the mesh's unit
  double seconds = 0;
  ValidityReport validity;
};

struct UntangleResult {
  Points positions;
  RowMatrix slides;  ///< of the sliding nodes: SlidingNodes::slides after the repair
  UntangleReport report;
};

/// Moves volume nodes near invalid cells so that all cells become valid (Garanzha, Kaporin,
/// Kudryavtseva, Protais, Ray, Sokolov: Foldover-free maps in 50 lines of code, ACM TOG 2021). The
/// cells of the base mesh (`mesh.points`) are the shapes to stay near to: the map from base to
/// moved cell has the smallest sum of distortion, sampled at the points that determine its Jacobian
/// determinant; polyhedra by tetrahedra over the means of their faces and nodes. Starts at
/// `positions` (N x 3). Nodes with `is_fixed` true (N) do not move, or slide. Cells that the fixed
/// nodes hold inverted (is_held) are left out. When some cells stay invalid, the positions with the
/// fewest are returned: `report.after` tells; what 100 passes over the mesh don't repair (more on
/// small meshes) is left. Nothing moves when all are valid.
UntangleResult untangle(const Mesh& mesh, const Points& positions,
                        const std::vector<char>& is_fixed, const Orientation& orientation,
                        const UntangleOptions& options = {});

}  // namespace cadmorph
