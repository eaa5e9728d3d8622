#include "volume/moving_nodes.h"

#include <algorithm>
#include <span>
#include <utility>

namespace cadmorph {

MovingNodes::MovingNodes(const Mesh& mesh, const Points& reference, std::vector<char> is_fixed,
                         const BestMeshOptions& options)
    : mesh_(mesh),
      reference_(reference),
      options_(options),
      is_fixed_(std::move(is_fixed)),
      is_fixed_for_good_(is_fixed_.size(), 0) {}

bool MovingNodes::is_on_edge(Index slider) const {
  return sliding_->at(slider, Eigen::Vector2d::Zero()).tangents.col(1).isZero(0);
}

bool MovingNodes::let_slide(bool on_edges, bool with_sweeps) {
  if (!sliding_) {
    if (!options_.sliding || !(sliding_ = options_.sliding())) return false;
    if (options_.images) images_ = options_.images();
    find_columns(with_sweeps);
  }
  for (std::size_t i = 0; i < sliding_->nodes.size(); ++i)
    if (on_edges || !is_on_edge(static_cast<Index>(i)))
      is_fixed_[sliding_->nodes[i]] = is_fixed_for_good_[sliding_->nodes[i]];
  for (const Index node : options_.held) is_fixed_[node] = 1;
  for (const Index i : images_.bound) is_fixed_[sliding_->nodes[i]] = 1;
  for (const Index node : options_.resting)
    if (!mid_nodes_.contains(node)) is_fixed_[node] = 1;  // those rest with their corners
  for (const std::vector<Index>& column : columns_)
    if (std::ranges::any_of(column, [&](Index node) { return is_fixed_[node]; }))
      for (const Index node : column) is_fixed_[node] = 1;
  return true;
}

void MovingNodes::end_sliding() {
  sliding_ = nullptr;
  columns_.clear();
  slid_rows_.clear();
}

void MovingNodes::find_columns(bool with_sweeps) {
  column_of_.assign(mesh_.node_count(), -1);
  for (const std::vector<Index>& group : images_.groups) {
    std::vector<Index>& column = columns_.emplace_back();
    for (const Index i : group) {
      column.push_back(sliding_->nodes[i]);
      column_of_[column.back()] = std::ssize(columns_) - 1;
    }
  }
  if (!with_sweeps) return;
  for (const NodeRow& row : options_.swept_rows) {
    const Index column = column_of_[row.front()];
    if (column < 0 || column != column_of_[row.back()]) continue;
    slid_rows_.push_back(&row);
    for (const Index node : std::span(row.begin() + 1, row.end() - 1)) {
      column_of_[node] = column;
      columns_[column].push_back(node);
    }
  }
}

bool MovingNodes::fix_those_beyond(const RowMatrix& before, const RowMatrix& slides) {
  bool has_any = false;
  for (Index i = 0; i < slides.rows(); ++i)
    if (slides.row(i) != before.row(i) && !sliding_->is_within(i, slides.row(i).transpose()))
      is_fixed_[sliding_->nodes[i]] = has_any = true;
  for (Index i = 0; has_any && i < mid_nodes_.count(); ++i)
    if (is_fixed_[mid_nodes_.node(i)] && is_slider(mid_nodes_.node(i)))
      for (const Index corner : mid_nodes_.corners(i)) is_fixed_[corner] = 1;
  return has_any;
}

bool MovingNodes::release_resting(const std::vector<Index>& cells) {
  std::vector<char> is_resting(is_fixed_.size(), 0), stays = is_fixed_for_good_;
  for (const Index node : options_.resting) is_resting[node] = 1;
  for (const Index node : options_.held) stays[node] = 1;
  for (const Index i : images_.bound) stays[sliding_->nodes[i]] = 1;
  bool has_any = false;
  for (const Index c : cells)
    for (const Index node : mesh_.cell(c)) {
      if (!is_fixed_[node] || !is_resting[node] || !is_slider(node)) continue;
      bool may_move = true;
      for_column(node, [&](Index one) { may_move &= !stays[one]; });
      if (!may_move) continue;
      for_column(node, [&](Index one) { is_fixed_[one] = 0; });
      has_any = true;
    }
  return has_any;
}

void MovingNodes::hold(const NodeRow& row) {
  for (const Index node : row)
    if (!std::exchange(is_fixed_[node], 1)) of_held_rows_.push_back(node);
}

bool MovingNodes::release_rows() {
  for (const Index node : of_held_rows_) is_fixed_[node] = 0;
  return !std::exchange(of_held_rows_, {}).empty();
}

void MovingNodes::add_followers(Patch& patch, const std::vector<char>& has_node) const {
  for (Index i = 0; i < mid_nodes_.count(); ++i)
    if (!is_fixed_[mid_nodes_.node(i)] &&
        std::ranges::any_of(mid_nodes_.corners(i), [&](Index node) { return has_node[node]; }))
      patch.followers.push_back(i);
}

void MovingNodes::carry_followers(const Patch& patch, NodePlaces& places) const {
  for (const Index i : patch.followers)
    mid_nodes_.follow(mid_nodes_.follower(i, sliding_), sliding_, places.positions, places.slides);
}

void MovingNodes::put_at(Index node, const Eigen::RowVector3d& place, NodePlaces& places) const {
  const Index slider = find_slider(sliding_, node);
  if (slider < 0) {
    places.positions.row(node) = place;
    return;
  }
  const Eigen::Vector2d slide =
      slide_below(*sliding_, slider, places.slides.row(slider).transpose(), place.transpose());
  if (!slide.allFinite() || !sliding_->is_within(slider, slide)) return;
  places.slides.row(slider) = slide.transpose();
  places.positions.row(node) = sliding_->at(slider, slide).point.transpose();
}

void MovingNodes::straighten(const NodeRow& row, NodePlaces& places) const {
  const Points straight = straight_places(row, reference_, places.positions);
  for (Index i = 0; i < straight.rows(); ++i)
    put_at(row[std::size_t(i) + 1], straight.row(i), places);
}

void MovingNodes::align_columns(const Patch& patch, NodePlaces& places) const {
  make_images_alike(patch, places);
  straighten_sweeps(patch, places);
}

void MovingNodes::make_images_alike(const Patch& patch, NodePlaces& places) const {
  if (!sliding_ || images_.groups.empty()) return;
  const RowMatrix alike = images_.alike(places.slides);
  // Only the patch's: nodes amid edges go with their corners, and others are where they were.
  for (const Index node : patch.nodes) {
    const Index i = find_slider(sliding_, node);
    if (i < 0 || alike.row(i) == places.slides.row(i)) continue;
    places.positions.row(node) = sliding_->at(i, alike.row(i)).point;
    places.slides.row(i) = alike.row(i);
  }
  carry_followers(patch, places);
}

void MovingNodes::straighten_sweeps(const Patch& patch, NodePlaces& places) const {
  if (slid_rows_.empty()) return;
  std::vector<char> has_node(mesh_.node_count(), 0);
  for (const Index node : patch.nodes) has_node[node] = 1;
  for (const NodeRow* row : slid_rows_)
    if (std::ranges::any_of(*row, [&](Index node) { return has_node[node]; }))
      straighten(*row, places);
  carry_followers(patch, places);
}

bool MovingNodes::take_back(Index node, const NodePlaces& home, double kept,
                            NodePlaces& places) const {
  bool has_moved = false;
  for_column(node, [&](Index one) { has_moved |= take_back_alone(one, home, kept, places); });
  return has_moved;
}

bool MovingNodes::take_back_alone(Index node, const NodePlaces& home, double kept,
                                  NodePlaces& places) const {
  const Eigen::RowVector3d start = home.positions.row(node);
  const Eigen::RowVector3d move = places.positions.row(node) - start;
  if (move.isZero(0)) return false;
  places.positions.row(node) = start + kept * move;
  const Index i = find_slider(sliding_, node);
  if (i < 0) return true;
  places.slides.row(i) = home.slides.row(i) + kept * (places.slides.row(i) - home.slides.row(i));
  if (kept > 0) places.positions.row(node) = sliding_->at(i, places.slides.row(i)).point;
  return true;
}

}  // namespace cadmorph
