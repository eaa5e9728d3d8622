#pragma once

#include <vector>

#include "core/mesh.h"
#include "core/sliding_nodes.h"
#include "volume/best_mesh.h"
#include "volume/mid_nodes.h"
#include "volume/wall_rows.h"

namespace cadmorph {

/// Where nodes are.
struct NodePlaces {
  Points positions;  ///< N x 3
  RowMatrix slides;  ///< see SlidingNodes::slides; empty while none may slide
};

/// Nodes that move together, and all cells that these change.
struct Patch {
  std::vector<Index> nodes, cells;  ///< ascending
  std::vector<Index> followers;     ///< nodes amid these, as numbers of MidNodes
  bool is_of_mid_nodes = false;     ///< the nodes themselves
};

/// Which nodes of a mesh may move while its cells are raised, and which move with others: nodes
/// amid edges with their corners; sliding nodes that are images of each other and the rows of a
/// sweep between them, a column, alike.
class MovingNodes {
 public:
  /// `is_fixed`: of all nodes. `reference` (N x 3): where rows are as straight as they are to be.
  /// All must outlive this.
  MovingNodes(const Mesh& mesh, const Points& reference, std::vector<char> is_fixed,
              const BestMeshOptions& options);

  const Mesh& mesh() const { return mesh_; }
  bool is_fixed(Index node) const { return is_fixed_[node]; }
  const std::vector<char>& fixed() const { return is_fixed_; }
  void set_fixed(std::vector<char> is_fixed) { is_fixed_ = std::move(is_fixed); }
  void fix(Index node) { is_fixed_[node] = 1; }
  /// For good, whatever is released.
  void fix_for_good(Index node) { is_fixed_[node] = is_fixed_for_good_[node] = 1; }

  const MidNodes& mid_nodes() const { return mid_nodes_; }
  /// `start` (N x 3): see MidNodes.
  void find_mid_nodes(const Points& start) { mid_nodes_ = MidNodes(mesh_, start); }

  /// Null while none may slide.
  const SlidingNodes* sliding() const { return sliding_; }
  bool is_slider(Index node) const { return find_slider(sliding_, node) >= 0; }
  /// Lets nodes within faces slide, and those `on_edges`, but for those that the options hold;
  /// rows of a sweep with their ends, where these are `with_sweeps`. False where there are none.
  bool let_slide(bool on_edges, bool with_sweeps);
  void end_sliding();
  /// Fixes nodes that slid beyond their face or edge between two rows of `slides` (K x 2), and
  /// corners of those amid edges. Returns whether there are any.
  bool fix_those_beyond(const RowMatrix& before, const RowMatrix& slides);
  /// Lets nodes at rest of these cells slide; false where there are none.
  bool release_resting(const std::vector<Index>& cells);

  /// Holds a row of nodes until the rows are released.
  void hold(const NodeRow& row);
  /// Returns whether any were held.
  bool release_rows();

  Index column_count() const { return std::ssize(columns_); }
  /// Of a node; -1 where it has none.
  Index column(Index node) const { return columns_.empty() ? -1 : column_of_[node]; }
  /// For a node and all that are to move alike.
  void for_column(Index node, const auto& act) const {
    if (column(node) < 0) return act(node);
    for (const Index one : columns_[column(node)]) act(one);
  }

  /// Adds the nodes that follow those of the patch. `has_node`: of all nodes, those of the patch.
  void add_followers(Patch& patch, const std::vector<char>& has_node) const;
  /// Puts them where the patch's nodes carry them.
  void carry_followers(const Patch& patch, NodePlaces& places) const;

  /// Puts the inner nodes of a row where they would be had it stayed straight; those that slide as
  /// near as their face or edge lets them, if within it.
  void straighten(const NodeRow& row, NodePlaces& places) const;
  /// What moves alike with the patch's nodes: images slide alike, rows of a sweep stay straight.
  void align_columns(const Patch& patch, NodePlaces& places) const;

  /// Leaves the node, and those of its column, that share of their move from `home`; returns
  /// whether any had moved.
  bool take_back(Index node, const NodePlaces& home, double kept, NodePlaces& places) const;

 private:
  bool is_on_edge(Index slider) const;
  void find_columns(bool with_sweeps);
  void put_at(Index node, const Eigen::RowVector3d& place, NodePlaces& places) const;
  void make_images_alike(const Patch& patch, NodePlaces& places) const;
  void straighten_sweeps(const Patch& patch, NodePlaces& places) const;
  bool take_back_alone(Index node, const NodePlaces& home, double kept, NodePlaces& places) const;

  const Mesh& mesh_;
  const Points& reference_;
  const BestMeshOptions& options_;
  std::vector<char> is_fixed_, is_fixed_for_good_;
  std::vector<Index> of_held_rows_;  ///< nodes that are fixed for that alone
  MidNodes mid_nodes_;
  const SlidingNodes* sliding_ = nullptr;
  SlidingImages images_;
  std::vector<std::vector<Index>> columns_;  ///< nodes that are to move alike
  std::vector<Index> column_of_;             ///< of all nodes, -1 where there is none
  std::vector<const NodeRow*> slid_rows_;    ///< of the columns
};

}  // namespace cadmorph
