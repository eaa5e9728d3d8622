#include "apps/pipeline/layer_stage.h"

#include <Eigen/Core>
#include <algorithm>
#include <iterator>
#include <set>
#include <span>
#include <utility>

#include "core/errors.h"
#include "core/layer_heights.h"
#include "core/least_squares.h"
#include "core/plane_mesh.h"
#include "core/stopwatch.h"
#include "surface/image_slides.h"
#include "volume/mid_nodes.h"
#include "volume/near_displacements.h"
#include "volume/untangle.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Rows of cells along the wall over which columns come from their old heights to the new ones, so
// that none is sheared against the next by more than a fifth of the difference. The tests pass with
// 1 to 10, and 3 changes of a wing come out the same with 2 or 10.
constexpr int kRamp = 5;
// Columns with inverted cells keep half of their nodes in the next round, those in each row of
// columns round them so many more. After the last round columns of 30 nodes have none.
constexpr int kMostRounds = 6, kMoreEachRow = 2;
// Cells give way as far beyond the layers as this many times the highest column: where heights
// change by a half, by 1/16 of their size on the mean.
constexpr double kReach = 8;
// Newton's steps to the place of a surface that is nearest to a point; the last changes the slide
// by no more than this part of it, its rounding.
constexpr int kMostSteps = 8;
constexpr double kFound = 1e-12;
// Of the diagonal: images after a slide. Far above rounding, far below the closest nodes' 1e-6.
constexpr double kImagesAlike = 1e-9;

// The slide of nodes[i] whose place is nearest to x, from `slide` on.
Vector2d nearest_slide(const SlidingNodes& sliding, Index i, const Vector3d& x, Vector2d slide) {
  for (int k = 0; k < kMostSteps; ++k) {
    const SlidePlace place = sliding.at(i, slide);
    const Vector2d step = small_least_squares(place.tangents, x - place.point);
    slide += step;
    if (step.norm() <= kFound * slide.norm()) break;
  }
  return slide;
}

class LayerKeeper {
 public:
  LayerKeeper(const MorphResult& result, const SlidingNodes& sliding)
      : base_(*result.base),
        result_(result),
        sliding_(sliding),
        layers_(find_layer_columns(base_.mesh(), base_.neighbours, base_.on_cad(),
                                   base_.mesh().points, base_.layer_growth())),
        images_(result.surface.images, base_.boundary, sliding) {
    if (layers_.columns.empty()) return;
    mid_nodes_ = MidNodes(mesh(), result.positions);
    target_ = carry_columns(layers_, base_.mesh().points, result.positions);
    find_rows();
    find_columns();
    find_sides();
    std::set<Index> full;
    for (std::size_t i = 0; i < layers_.columns.size(); ++i) {
      kept_nodes_.push_back(std::ssize(layers_.columns[i].nodes));
      if (ends_on_wall(i)) full.insert(Index(i));
    }
    if (base_.options.keep_layers) lower(full);  // what is beyond layers is to give way
    for (std::size_t i = 0; i < layers_.columns.size(); ++i)
      if (std::ranges::any_of(kept_nodes(i), [&](Index node) { return !can_move(node); }))
        kept_nodes_[i] = 0;
  }

  bool has_layers() const { return !layers_.columns.empty(); }

  MeshWithLayers keep() {
    MeshWithLayers kept{result_.positions, sliding_.slides, result_.validity, {}};
    kept.report.columns = std::ranges::count(is_floor_, 1);
    most_bad_ = std::ssize(bad_cells(kept));
    for (int round = 0; round < kMostRounds; ++round) {
      const std::vector<double> shares = shares_of_columns();
      if (std::ranges::all_of(shares, [](double share) { return share == 0; })) break;
      std::optional<MeshWithLayers> moved = move(shares);
      if (!moved) break;
      MeshWithLayers& made = *moved;
      if (const std::vector<Index> bad = bad_cells(made); std::ssize(bad) > most_bad_) {
        const bool is_last = round + 1 == kMostRounds;
        if (!is_last && lower_columns_of(bad)) continue;
        if (!repair(made)) break;
      }
      made.report = kept.report;
      count_columns(shares, made.report);
      return made;
    }
    return kept;
  }

 private:
  const Mesh& mesh() const { return base_.mesh(); }

  void find_rows() {
    row_of_.assign(mesh().node_count(), RowId());
    for (std::size_t i = 0; i < base_.boundary.nodes.size(); ++i)
      row_of_[base_.boundary.nodes[i]] = RowId(i);
    slide_of_.assign(mesh().node_count(), -1);
    for (std::size_t i = 0; i < sliding_.nodes.size(); ++i)
      slide_of_[sliding_.nodes[i]] = static_cast<Index>(i);
    is_inner_.assign(mesh().node_count(), 0);
    for (Index node = 0; node < mesh().node_count(); ++node) is_inner_[node] = row_of_[node] < 0;
    is_in_plane_ = !plane_normal(mesh(), mesh().points, result_.positions).isZero(0);
    if (is_in_plane_) {
      const std::vector<char> is_border = border_nodes(mesh(), mesh().points);
      for (const RowId row : base_.association().dimension.ids())
        if (base_.association().dimension[row] == CadDimension::Face)
          is_inner_[base_.boundary.nodes[row]] = !is_border[base_.boundary.nodes[row]];
    }
    patch_of_.assign(mesh().node_count(), -1);
    const auto patches = base_.surface->nodes_of_sliding_patches();
    for (std::size_t p = 0; p < patches.size(); ++p)
      for (const RowId row : patches[p]) patch_of_[base_.boundary.nodes[row]] = int(p);
  }

  void find_columns() {
    column_of_.assign(mesh().node_count(), -1);
    level_.assign(mesh().node_count(), -1);
    beside_.resize(layers_.columns.size());
    is_by_bare_floor_.assign(layers_.columns.size(), 0);
    is_floor_.assign(mesh().node_count(), 0);
    std::vector<Index> column_on(mesh().node_count(), -1);
    for (std::size_t i = 0; i < layers_.columns.size(); ++i) {
      column_on[layers_.columns[i].foot] = static_cast<Index>(i);
      const auto& nodes = layers_.columns[i].nodes;
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        column_of_[nodes[k]] = static_cast<Index>(i);
        level_[nodes[k]] = static_cast<Index>(k);
      }
    }
    for (const std::vector<Index>& floor : layers_.floors)
      for (const Index a : floor) {
        is_floor_[a] = 1;
        for (const Index b : floor) {
          if (column_on[a] < 0 || a == b) continue;
          if (column_on[b] < 0)
            is_by_bare_floor_[column_on[a]] = 1;
          else
            beside_[column_on[a]].push_back(column_on[b]);
        }
      }
  }

  // Faces, edges and patches that columns stand beside on, whose other nodes follow.
  void find_sides() {
    const Association& association = base_.association();
    for (const LayerColumn& column : layers_.columns)
      for (const Index node : column.nodes) {
        if (patch_of_[node] >= 0) side_patches_.insert(patch_of_[node]);
        const RowId row = row_of_[node];
        if (row < 0 || slide_of_[node] < 0) continue;
        if (association.dimension[row] == CadDimension::Face)
          side_faces_.insert(association.face(row));
        else
          side_edges_.insert(association.edge(row));
      }
  }

  // Whether a column reaches from its wall to another one.
  bool ends_on_wall(std::size_t column) const {
    const auto free_directions = [&](Index node) {
      const RowId row = row_of_[node];
      if (row < 0) return 3;
      const CadDimension on = base_.association().dimension[row];
      return on == CadDimension::None ? 2 : static_cast<int>(on);
    };
    const auto& nodes = layers_.columns[column].nodes;
    return nodes.size() > 1 &&
           free_directions(nodes.back()) < free_directions(nodes[nodes.size() - 2]);
  }

  void count_columns(const std::vector<double>& shares, KeptLayers& report) const {
    for (std::size_t i = 0; i < shares.size(); ++i)
      if (shares[i] == 1 && kept_nodes(i).size() == layers_.columns[i].nodes.size())
        ++report.kept;
      else if (shares[i] > 0)
        ++report.partly;
  }

  // Whether a node is one that its column keeps where it belongs.
  bool is_kept(Index node) const {
    return column_of_[node] >= 0 && level_[node] < kept_nodes_[column_of_[node]];
  }

  std::span<const Index> kept_nodes(std::size_t column) const {
    return std::span(layers_.columns[column].nodes)
        .first(static_cast<std::size_t>(kept_nodes_[column]));
  }

  bool can_move(Index node) const {
    return is_inner_[node] || slide_of_[node] >= 0 || patch_of_[node] >= 0;
  }

  // Whether a node of the surface follows what the columns beside it do.
  bool follows(RowId row) const {
    const Index node = base_.boundary.nodes[row];
    if (is_floor_[node] || is_kept(node)) return false;
    if (column_of_[node] >= 0) return can_move(node);
    if (is_inner_[node]) return true;
    if (patch_of_[node] >= 0) return side_patches_.contains(patch_of_[node]);
    if (slide_of_[node] < 0) return base_.association().is_free[row];
    return base_.association().dimension[row] == CadDimension::Face
               ? side_faces_.contains(base_.association().face(row))
               : side_edges_.contains(base_.association().edge(row));
  }

  // The columns' uppermost nodes are prescribed, but not what is below them, where the field is not
  // asked: it need not go from nothing at the wall to all of a correction over a thin layer.
  void find_prescribed() {
    prescribed_.clear();
    highest_ = 0;
    std::vector<char> is_below(mesh().node_count(), 0);
    for (std::size_t i = 0; i < layers_.columns.size(); ++i) {
      const auto nodes = kept_nodes(i);
      if (nodes.empty()) continue;
      is_below[layers_.columns[i].foot] = 1;
      for (const Index node : nodes) is_below[node] = node != nodes.back();
    }
    for (Index i = 0; i < mid_nodes_.count(); ++i)
      is_below[mid_nodes_.node(i)] =
          std::ranges::all_of(mid_nodes_.corners(i), [&](Index n) { return is_below[n] != 0; });
    for (const RowId row : base_.association().dimension.ids())
      if (const Index node = base_.boundary.nodes[row]; !follows(row) && !is_below[node])
        prescribed_.push_back(node);
    for (std::size_t i = 0; i < layers_.columns.size(); ++i) {
      const auto nodes = kept_nodes(i);
      if (nodes.empty()) continue;
      if (row_of_[nodes.back()] < 0) prescribed_.push_back(nodes.back());
      const auto way = mesh().points.row(nodes.back()) - mesh().points.row(layers_.columns[i].foot);
      highest_ = std::max(highest_, way.norm());
    }
    std::ranges::sort(prescribed_);
  }

  // Of the way to its old heights that each column goes: 0 where it is left as it is, from there on
  // more with each row along the wall.
  std::vector<double> shares_of_columns() const {
    std::vector<int> rows(layers_.columns.size(), kRamp);
    std::vector<std::size_t> queue;
    const auto reach = [&](std::size_t i, int row) {
      if (row >= rows[i]) return;
      rows[i] = row;
      queue.push_back(i);
    };
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (kept_nodes_[i] == 0) reach(i, 0);
    }
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (is_by_bare_floor_[i]) reach(i, 1);
    for (std::size_t k = 0; k < queue.size(); ++k)
      for (const Index other : beside_[queue[k]]) reach(std::size_t(other), rows[queue[k]] + 1);
    std::vector<double> shares;
    for (const int row : rows) shares.push_back(double(row) / kRamp);
    return shares;
  }

  // Nothing where uppermost nodes nearly coincide.
  std::optional<MeshWithLayers> move(const std::vector<double>& shares) try {
    find_prescribed();
    const Points& from = result_.positions;
    Points to = from;
    for (std::size_t i = 0; i < shares.size(); ++i)
      for (const Index node : kept_nodes(i))
        to.row(node) += shares[i] * (target_.row(node) - from.row(node));
    put_on_surface(to, [&](Index node) { return is_kept(node); });
    const Points columns = to;
    to = from + near_displacements(from(prescribed_, Eigen::all),
                                   columns(prescribed_, Eigen::all) - from(prescribed_, Eigen::all),
                                   kReach * highest_, from);
    for (Index node = 0; node < mesh().node_count(); ++node)
      if (is_kept(node)) to.row(node) = columns.row(node);
    for (const RowId row : base_.association().dimension.ids())
      if (const Index node = base_.boundary.nodes[row]; !is_kept(node) && !follows(row))
        to.row(node) = from.row(node);
    move_mid_nodes(to);
    MeshWithLayers result;
    result.slides = put_on_surface(to, [&](Index node) {
      return is_kept(node) || mid_nodes_.contains(node) || follows(row_of_[node]);
    });
    result.validity = check_validity(mesh(), to, base_.orientation);
    result.positions = std::move(to);
    return result;
  } catch (const SolverError&) {
    return std::nullopt;
  }

  // Those whose corners are all of the layers.
  void move_mid_nodes(Points& to) const {
    for (Index i = 0; i < mid_nodes_.count(); ++i)
      if (std::ranges::all_of(mid_nodes_.corners(i),
                              [&](Index n) { return is_floor_[n] || is_kept(n); }) &&
          can_move(mid_nodes_.node(i)) && !is_floor_node(i))
        to.row(mid_nodes_.node(i)) = result_.positions.row(mid_nodes_.node(i)) +
                                     mid_nodes_.middle(i, to) -
                                     mid_nodes_.middle(i, result_.positions);
  }
  bool is_floor_node(Index i) const {
    return std::ranges::all_of(mid_nodes_.corners(i), [&](Index n) { return is_floor_[n]; });
  }

  // Puts the surface's nodes that move back onto their CAD faces and edges or their patches, images
  // of each other alike; returns their slides.
  template <class Moves>
  RowMatrix put_on_surface(Points& to, Moves moves) const {
    RowMatrix slides = sliding_.slides;
    for (Index i = 0; i < slides.rows(); ++i) {
      const Index node = sliding_.nodes[i];
      if (!moves(node)) continue;
      const Vector2d slide =
          nearest_slide(sliding_, i, to.row(node), sliding_.slides.row(i).transpose());
      if (sliding_.is_within(i, slide)) slides.row(i) = slide;
    }
    RowMatrix steps = slides - sliding_.slides;
    images_.average(steps);
    slides = sliding_.slides + steps;
    images_.hold_unlike(
        sliding_.slides,
        kImagesAlike * result_.variant->diagonal() / base_.association().mesh_unit_mm, slides);
    const Points on_patches = base_.surface->onto_sliding_patches(
        result_.positions(base_.boundary.nodes, Eigen::all), to(base_.boundary.nodes, Eigen::all));
    for (const RowId row : base_.association().dimension.ids()) {
      const Index node = base_.boundary.nodes[row];
      if (patch_of_[node] >= 0) to.row(node) = on_patches.row(row);
    }
    for (Index i = 0; i < slides.rows(); ++i)
      to.row(sliding_.nodes[i]) = slides.row(i) == sliding_.slides.row(i)
                                      ? Eigen::RowVector3d(result_.positions.row(sliding_.nodes[i]))
                                      : sliding_.at(i, slides.row(i)).point.transpose();
    return slides;
  }

  // What a mesh is refused for: the exact test takes no cells of plane meshes.
  std::vector<Index> bad_cells(const MeshWithLayers& made) const {
    const std::vector<Index> inverted =
        measure_quality(mesh(), made.positions, base_.orientation).inverted_cells;
    std::vector<Index> turned, bad;
    std::ranges::set_difference(inverted, base_.quality.inverted_cells, std::back_inserter(turned));
    std::ranges::set_union(made.validity.invalid_cells, turned, std::back_inserter(bad));
    return bad;
  }

  // Makes cells beyond the layers valid, whose nodes may move. Returns whether as few are bad as
  // were.
  bool repair(MeshWithLayers& made) const {
    if (base_.options.untangle == UntangleMode::Never) return false;
    std::vector<char> is_fixed = base_.fixed_nodes();
    for (std::size_t i = 0; i < layers_.columns.size(); ++i)
      for (const Index node : kept_nodes(i)) is_fixed[node] = 1;
    UntangleOptions how;
    how.attempts = 2;
    how.progress = base_.options.progress;
    UntangleResult repaired = untangle(mesh(), made.positions, is_fixed, base_.orientation, how);
    made.positions = std::move(repaired.positions);
    made.validity = std::move(repaired.report.validity);
    return std::ssize(bad_cells(made)) <= most_bad_;
  }

  // The columns with nodes of the cells. Cells of plane meshes beyond all columns, which no repair
  // takes, are bad where uppermost nodes jog: these have the columns nearest to them, by cells.
  std::set<Index> columns_at(const std::vector<Index>& cells) const {
    std::vector<char> is_near(mesh().node_count(), 0);
    for (const Index c : cells)
      for (const Index node : mesh().cell(c)) is_near[node] = 1;
    std::set<Index> columns;
    for (bool has_grown = true; has_grown && columns.empty();) {
      for (Index node = 0; node < mesh().node_count(); ++node)
        if (is_near[node] && column_of_[node] >= 0 && kept_nodes_[column_of_[node]] > 0)
          columns.insert(column_of_[node]);
      has_grown = is_in_plane_ && add_nodes_beside(is_near);
    }
    return columns;
  }

  // Of all cells that have one; returns whether there are any.
  bool add_nodes_beside(std::vector<char>& marks) const {
    std::vector<char> more = marks;
    for (Index c = 0; c < mesh().cell_count(); ++c)
      if (std::ranges::any_of(mesh().cell(c), [&](Index node) { return marks[node] != 0; }))
        for (const Index node : mesh().cell(c)) more[node] = 1;
    std::swap(marks, more);
    return marks != more;
  }

  // Returns whether any was lowered.
  bool lower_columns_of(const std::vector<Index>& cells) { return lower(columns_at(cells)); }

  // To the lower half of their nodes, and those round them.
  bool lower(const std::set<Index>& columns) {
    std::vector<Index> queue;
    const auto lower_to = [&](Index column, Index nodes) {
      if (nodes >= kept_nodes_[column]) return;
      kept_nodes_[column] = nodes;
      queue.push_back(column);
    };
    for (const Index column : columns) lower_to(column, kept_nodes_[column] / 2);
    for (std::size_t k = 0; k < queue.size(); ++k)
      for (const Index other : beside_[queue[k]])
        lower_to(other, kept_nodes_[queue[k]] + kMoreEachRow);
    return !queue.empty();
  }

  const BaseSide& base_;
  const MorphResult& result_;
  const SlidingNodes& sliding_;
  LayerColumns layers_;
  ImageSlides images_;
  Points target_;
  std::vector<RowId> row_of_;                // by nodes: of the boundary
  std::vector<Index> slide_of_, column_of_;  // by nodes: of SlidingNodes, of the columns; -1
  std::vector<Index> level_;                 // by nodes: in its column
  std::vector<char> is_inner_;               // by nodes: of a plane mesh within its faces, too
  bool is_in_plane_ = false;
  std::vector<int> patch_of_;               // by nodes: that slides; -1
  std::vector<char> is_floor_;              // by nodes
  std::vector<std::vector<Index>> beside_;  // columns beside a column
  std::vector<char> is_by_bare_floor_;      // by columns
  std::vector<Index> kept_nodes_;           // by columns: how many, from the foot on
  std::set<FaceId> side_faces_;
  std::set<EdgeId> side_edges_;
  std::set<int> side_patches_;
  std::vector<Index> prescribed_;
  double highest_ = 0;  // column
  Index most_bad_ = 0;  // cells, as many as there were
  MidNodes mid_nodes_;
};

}  // namespace

std::optional<MeshWithLayers> keep_layers(const MorphResult& result, const SlidingNodes& sliding) {
  const Stopwatch watch;
  LayerKeeper keeper(result, sliding);
  if (!keeper.has_layers()) return std::nullopt;
  MeshWithLayers kept = keeper.keep();
  kept.report.seconds = watch.seconds();
  return kept;
}

}  // namespace cadmorph
