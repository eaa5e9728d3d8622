#pragma once

#include <functional>
#include <vector>

#include "core/face_quality.h"
#include "core/quality.h"
#include "core/sliding_nodes.h"
#include "core/validity.h"
#include "volume/wall_rows.h"
#include "volume/worst_cells.h"

namespace cadmorph {

/// Positions of a mesh's nodes, N x 3, and the quality of its cells there.
struct MeasuredShape {
  const Points& points;
  const QualityReport& quality;
};

/// What moves in an attempt to raise cells.
enum class RaiseBy { MidNodes, SweptRows, WallRows, InnerNodes, SlidingNodes };

struct RaiseAttempt {
  RaiseBy by = RaiseBy::InnerNodes;
  int power = 0;          ///< see ShapeEnergy; 0: what needed no search
  Index cells = 0;        ///< whose shape it looked at
  double passes = 0;      ///< evaluations of a cell, over the number of the mesh's cells
  WorstCells after;       ///< what it came to
  bool is_taken = false;  ///< whether it went into the result
};

struct BestMeshReport {
  bool is_by_faces = false;  ///< the figures are those of face_quality
  WorstCells base, plain, best;
  std::vector<RaiseAttempt> attempts;  ///< in the order tried; none where little was lost
  Index slid_nodes = 0;                ///< surface nodes that are not where they started
  double seconds = 0;
};

/// Sliding nodes that are images of each other: opposite sides of a periodic mesh, of a swept one.
struct SlidingImages {
  std::vector<std::vector<Index>> groups;  ///< those of each other, as in SlidingNodes::nodes
  std::vector<Index> bound;                ///< those whose images can't follow, which stay
  /// Slides (K x 2) with those of images alike.
  std::function<RowMatrix(const RowMatrix& slides)> alike;
};

struct BestMeshOptions {
  /// The mesh where its solver works by finite volumes: cells are judged by face_quality, in place
  /// of the scaled Jacobian. Must outlive the call.
  const FiniteVolumes* volumes = nullptr;
  /// Surface nodes that may slide, asked for when inner nodes alone do not do; may be empty.
  std::function<const SlidingNodes*()> sliding = {};
  /// Of those, asked for with them; may be empty.
  std::function<SlidingImages()> images = {};
  /// Sliding nodes that stay nevertheless: ids.
  std::vector<Index> held = {};
  /// Sliding nodes that stay, too, except in cells that are still poor after all else was tried:
  /// ids.
  std::vector<Index> resting = {};
  /// Whether nodes slid so that valid cells overlap.
  std::function<bool(const Points& positions, const RowMatrix& slides)> is_folded = {};
  /// Rows of nodes that are to stay straight, the nodes at the same parts of them: across walls,
  /// and those of a swept mesh, from a node to its image, that stay so while these slide.
  std::vector<NodeRow> wall_rows = {}, swept_rows = {};
  /// Of the moved mesh's solid cells, where known; must outlive the call.
  const ValidityReport* validity = nullptr;
};

struct BestMeshResult {
  Points positions;       ///< N x 3
  RowMatrix slides;       ///< SlidingNodes::slides of the result; empty where no surface node slid
  QualityReport quality;  ///< scaled Jacobians
  BestMeshReport report;
};

/// Raises the cells of a moved mesh whose shape suffered most against a reference: the mesh file's
/// shape, also after many morphs. What is done, in which order, is docs/raising.md:
///
///  - nodes amid edges that the motion bent go back to where these edges' corners have them;
///  - rows of a swept mesh, and those through walls, become as straight as they are in the
///  reference;
///  - the nodes of the worst cells minimise ShapeEnergy: the inner ones (not `is_fixed`, N; of
///    shells those that slide within faces), where that is not enough all that slide, too.
///
/// Of `moved` neither the smallest scaled Jacobian nor the mean of the worst twentieth becomes less
/// (of straight rows, by more than a thousandth; of those of a sweep and after raising, 2 %), no
/// more cells are invalid, and those that are stay as they are. No node moves farther from the
/// reference than kMostOvershoot times the farthest fixed one, or than the farthest of those that
/// came. What it costs is bounded by passes over the cells, a count, no time: the result is the
/// same on every machine and for any number of threads.
BestMeshResult find_best_mesh(const Mesh& mesh, const MeasuredShape& reference,
                              const MeasuredShape& moved, const std::vector<char>& is_fixed,
                              const Orientation& orientation, const BestMeshOptions& options = {});

}  // namespace cadmorph
