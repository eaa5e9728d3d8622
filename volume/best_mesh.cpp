#include "volume/best_mesh.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "core/cell_topology.h"
#include "core/lbfgs.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"
#include "core/rbf/anchors.h"
#include "core/stopwatch.h"
#include "volume/node_cells.h"
#include "volume/shape_energy.h"

namespace cadmorph {
namespace {

using Eigen::VectorXd;

// Shares of the reference's figures below which inner nodes move: below the first in one attempt,
// which costs little, below the second for as long as it helps. To win back 2 % of one figure
// raises the sum of both shares by 1 %, the least that an attempt is taken for (kWorthwhile).
constexpr double kLostAny = 0.999, kLost = 0.98;
// Surface nodes leave the places that the CAD's parameters give them where less than the second
// share is kept of what a stretch of the part leaves, after inner nodes did what they can; where
// less than the first is kept, before inner nodes do, and with more work. With 0.5 as the first,
// hexahedra of the families that kept 0.6 after three quarters of a change came out worse than
// after the whole of it; with 0.75 as the second, too, a bracket stayed at 0.017 (now 0.188).
constexpr double kKeptLittle = 0.75, kKeptEnough = 0.9;
// A motion that differs less from an affine map is left as it is. Of the size of what moves, a body
// in a far field or the whole part: above what exchanged CAD differs by, below a change that costs
// quality.
constexpr double kAffine = 1e-4;
// Where the nearest affine map leaves less than this part of the motion over, the part is stretched
// as a whole, and what that costs is no loss. When any map counted as such, a spring that got more
// turns, all of whose sections turn, passed for one that shrank: it kept 0.069 in place of 0.191.
// With half or twice of it 5 pairs come out the same.
constexpr double kMainly = 0.1;
// The nodes of the worst cells move: of kMostSeeds of all cells at most, the twentieth whose mean
// is one of the figures, and of fewer where the cells at these nodes would be more than
// kMostNeighbours of all. Where little was lost, the first attempt, which mostly does, and others
// while kNearlyKept is kept stop at kMostNeighboursNear: a block of 5 million tetrahedra was at
// 0.979 after its first attempt, and was raised in 2.1 s in place of 3 with a tenth of its cells in
// the second, too. With 0.2 for 0.4, 9 pairs keep 4 % less of the worst twentieth on the mean, with
// 0.8 2 % less of the smallest; with 0.05 or 0.2 for 0.1 the worst twentieth of one keeps 3 % less;
// with 0.92 or 0.98 for 0.96 5 pairs come out the same.
constexpr double kMostSeeds = 0.05;
constexpr double kMostNeighbours = 0.4, kMostNeighboursNear = 0.1, kNearlyKept = 0.96;
// So many times as many are taken where cells of one bin would be parted otherwise: in a symmetric
// mesh each cell shares its bin with its mirror image. With 4, 5 pairs come out the same; with 1,
// which parts bins, they keep up to 15 % more of the smallest, one 2 % less of the worst twentieth.
constexpr double kWholeBins = 2;
// A cell that kept this share of its scaled Jacobian is left alone: it lost no more than what an
// attempt is to gain (kWorthwhile). With 0.98 or 0.995, 5 pairs keep 1 % less of the worst
// twentieth on the mean, single ones up to 31 % more of the smallest.
constexpr double kKept = 0.99;
// The work ends after so many passes over the mesh; where little was kept, after the second number.
// Four attempts by inner nodes of kIterations steps each, with kMostNeighbours of the cells, take
// 10 passes, seven by sliding nodes of kIterationsLost take 56, without guesses of Hessians and
// steps that are taken back.
constexpr double kMostPasses = 20, kMostPassesLost = 80;
// Where little was kept, it goes on to so many times as much while each attempt raises the sum of
// the shares by this factor: after 80 passes a cold plate of 136,000 tetrahedra was at 0.014, at
// last, 0.6 s later, at 0.125. With 2 or 8 for 4, or 1.01 or 1.04 for 1.02, 9 pairs come out the
// same; with 1 for 4 a stem keeps 5 % less of the smallest.
constexpr double kMoreWork = 4, kRising = 1.02;
// Evaluations of cells that small meshes may take nevertheless: kMostPasses over 10,000 cells, and
// kMostPassesLost over 100,000.
constexpr double kSmallWork = 2e5, kSmallWorkLost = 8e6;
// An evaluation of a cell with its faces takes so many times as long as without. With 3, 4 pairs
// come out the same by faces; with 12, 2 do, and the angles of the worst twentieth of a bracket's
// faces are 2 % larger, of a bore's 2 % smaller.
constexpr double kFacesWork = 6;
// Steps of an attempt; where little was kept, the second number. With 3, nodes on surfaces of 2 of
// 9 pairs slide, too; 12 raise the worst twentieth by 0.4 %. With 10 for 20, 9 pairs keep 1.4 %
// less of the smallest on the mean, with 40 they keep 1.5 % more for a fifth more time.
constexpr int kIterations = 6, kIterationsLost = 20;
// Nodes that slide beyond their faces are held, and the minimisation is done anew, so many times.
// With 1 a disc keeps 0.013 in place of 0.117; with 2 or 6 all of 12 pairs come out the same.
constexpr int kTrials = 3;
// Layers of cells round the worst that are raised alone. With a tenth of the mesh in place of a few
// thousand cells a lens between two bores kept 0.009 in place of 0.085. With 2 or 6, 7 of 9 pairs
// come out the same, the others with 3 % less to 4 % more of the smallest.
constexpr int kLayers = 3;
// An attempt by search is taken only where it raises the sum of the shares by this factor: nodes
// are not to leave their places for less. Attempts of the last power are repeated while each does.
constexpr double kWorthwhile = 1.01;
// Rows of nodes stay that are off their places by less, in parts of the wall, and nodes amid edges,
// in parts of these: far less than the 1 to 5 % by which a smooth warp bends rows in a pipe's wall.
// With half or twice of it, or half or twice the losses below, 3 meshes of hexahedra are the same.
constexpr double kBent = 1e-4;
// Straight rows are taken where this share of each figure is kept; after raising, and those of a
// sweep, the second: they may cost as little as is not raised at all (kLostAny), or no further
// (kLost).
constexpr double kForRows = 0.999, kForRowsRaised = 0.98;
// Rounds in which nodes of cells that fell too low are taken back. In the first ones they go half
// of their way back, since the cells beside come off worst where a node goes back as a whole; after
// 8 halvings 0.4 % of a move is left. In the others they go all of it, a ring of cells a round.
constexpr int kHalvings = 8, kTakeBacks = 16;
// A cell with a smaller scaled Jacobian q has no shape to start from. Its energy q^-p with the
// largest power p = 32 would be 1e288, about the most that a sum of doubles holds (1.8e308).
constexpr double kFlat = 1e-9;

// Ascending.
std::vector<Index> marked(const std::vector<char>& marks) {
  std::vector<Index> result;
  for (Index i = 0; i < std::ssize(marks); ++i)
    if (marks[i]) result.push_back(i);
  return result;
}

// The nodes that move, and all cells that these change.
struct Patch {
  std::vector<Index> nodes, cells;  ///< ascending
  std::vector<Index> followers;     ///< nodes amid these, as numbers of MidNodes
  bool is_of_mid_nodes = false;     ///< the nodes themselves
};

class BestMesh {
 public:
  BestMesh(const Mesh& mesh, const MeasuredShape& reference, const MeasuredShape& came,
           std::vector<char> is_fixed, const Orientation& orientation,
           const BestMeshOptions& options)
      : mesh_(mesh),
        reference_(reference),
        came_(came),
        orientation_(orientation),
        orientation_of_corners_(orientation_of_corners(mesh, orientation)),
        options_(options),
        is_fixed_(std::move(is_fixed)),
        is_flat_(is_fixed_.size(), 0) {
    result_.positions = at_.positions = came.points;
    result_.quality = at_.quality = options.volumes ? measure(came.points) : came.quality;
    result_.report.is_by_faces = options.volumes;
    if (options.volumes) of_faces_ = measure(reference.points);
    can_keep_ = result_.report.base = worst_cells(reference_quality());
    for (Index n = 0; n < mesh.node_count(); ++n)
      reach_ = std::max(reach_, (is_fixed_[n] ? kMostOvershoot : 1) * moved(came.points, n));
    result_.report.plain = result_.report.best = worst_cells(result_.quality);
  }

  BestMeshResult run() {
    if (kept() < kLost) straighten_edges();
    straighten_all_rows();
    if (kept() < kLostAny && compare_with_stretch()) {
      prepare();
      lost_much_ = has_lost_much();
      hold_rows();
      if (is_shell()) let_slide(false);  // nodes within faces are its inner nodes
      raise(RaiseBy::InnerNodes, 2);
      const auto raise_inner = [&] {
        for (const int doublings : {3, 4, 5}) raise(RaiseBy::InnerNodes, doublings);
      };
      if (!has_lost_much()) {
        raise_inner();
        if (least_share(result_.report.best, can_keep_) < kKeptEnough) {
          release_rows();
          raise_by_sliding();
        }
      } else {
        const bool held_rows = release_rows();
        if (!raise_by_sliding()) {
          if (held_rows) raise(RaiseBy::InnerNodes, 2);
          raise_inner();
        }
      }
      if (sliding_) keep_slides();
      has_raised_ = has_taken_search();
      if (has_raised_) straighten_all_rows();
    }
    if (options_.volumes)
      result_.quality = result_.positions == came_.points
                            ? came_.quality
                            : measure_quality(mesh_, result_.positions, orientation_);
    return std::move(result_);
  }

 private:
  struct State {
    Points positions;
    QualityReport quality;  ///< of faces: their smallest and all values alone
    RowMatrix slides;
  };

  QualityReport measure(const Points& positions) const {
    if (!options_.volumes) return measure_quality(mesh_, positions, orientation_);
    return quality_of_faces(face_quality(*options_.volumes, positions));
  }
  QualityReport measure_after(QualityReport before, const Points& positions,
                              const std::vector<Index>& cells) const {
    if (!options_.volumes)
      return measure_again(std::move(before), mesh_, positions, orientation_, cells);
    return quality_of_faces(
        face_quality_again(std::move(before.values), *options_.volumes, positions, cells));
  }
  const QualityReport& reference_quality() const {
    return options_.volumes ? of_faces_ : reference_.quality;
  }

  // Whether the mesh has no solid cells, and does not lie in one plane, in which it was before,
  // too.
  bool is_shell() const {
    return dimension(mesh_) < 3 && plane_normal(mesh_, reference_.points, came_.points).isZero(0);
  }

  // Cells of a plane mesh that turned over are not valid.
  std::vector<Index> invalid_cells(const Points& positions, const std::vector<Index>& cells) const {
    if (flat_axis(mesh_, positions) < 0)
      return check_validity(mesh_, positions, orientation_, cells).invalid_cells;
    const Mesh layer = one_layer(mesh_, positions);
    return check_validity(layer, layer.points, Orientation(orientation_.size(), 1), cells)
        .invalid_cells;
  }

  std::vector<Index> all_invalid_cells() const {
    if (options_.validity && flat_axis(mesh_, result_.positions) < 0)
      return options_.validity->invalid_cells;
    std::vector<Index> all(mesh_.cell_count());
    std::iota(all.begin(), all.end(), Index{0});
    return invalid_cells(result_.positions, all);
  }

  // Lets nodes within faces slide, and those on edges; false where there are none.
  bool let_slide(bool on_edges) {
    if (!sliding_) {
      if (!options_.sliding || !(sliding_ = options_.sliding())) return false;
      at_.slides = slides_ = sliding_->slides;
      if (options_.images) images_ = options_.images();
      find_columns();
    }
    for (std::size_t i = 0; i < sliding_->nodes.size(); ++i)
      if (on_edges || !is_on_edge(static_cast<Index>(i)))
        is_fixed_[sliding_->nodes[i]] = is_flat_[sliding_->nodes[i]];
    for (const Index node : options_.held) is_fixed_[node] = 1;
    for (const Index i : images_.bound) is_fixed_[sliding_->nodes[i]] = 1;
    for (const Index node : options_.resting)
      if (!mid_nodes_.contains(node)) is_fixed_[node] = 1;  // those rest with their corners
    for (const std::vector<Index>& column : columns_)
      if (std::ranges::any_of(column, [&](Index node) { return is_fixed_[node]; }))
        for (const Index node : column) is_fixed_[node] = 1;
    return true;
  }

  // Lets resting nodes of the cells with least slide; false where there are none.
  bool release_resting() {
    std::vector<char> is_resting(is_fixed_.size(), 0), stays = is_flat_;
    for (const Index node : options_.resting) is_resting[node] = 1;
    for (const Index node : options_.held) stays[node] = 1;
    for (const Index i : images_.bound) stays[sliding_->nodes[i]] = 1;
    bool has_any = false;
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (result_.quality.values[c] < kKeptLittle * can_keep_.min)
        for (const Index node : mesh_.cell(c))
          if (is_fixed_[node] && is_resting[node] && is_slider(node)) {
            bool may_move = true;
            for_column(node, [&](Index one) { may_move &= !stays[one]; });
            if (!may_move) continue;
            for_column(node, [&](Index one) { is_fixed_[one] = 0; });
            has_any = true;
          }
    return has_any;
  }

  void raise_while_worthwhile() {
    // Powers 4 and 32, the smallest and the largest tried: the mean of many cells, the worst cell.
    constexpr int kForMean = 2, kForSmallest = 5;
    const auto raise_by = [&](int doublings) {
      for (double before = 0; kept() > kWorthwhile * before;) {
        before = kept();
        raise(RaiseBy::SlidingNodes, doublings);
      }
    };
    const WorstCells &best = result_.report.best, &base = result_.report.base;
    for (double before = 0; sum_of_shares(best, base) > kWorthwhile * before;) {
      before = sum_of_shares(best, base);
      raise_by(kForSmallest);
      if (best.min * base.worst_twentieth > best.worst_twentieth * base.min) raise_by(kForMean);
    }
  }

  void start_from_result() {
    at_ = {result_.positions, result_.quality, slides_};
    is_at_result_ = true;
    spoilt_.reset();
  }

  // A search over much of the mesh is slow to raise the few cells that are still below the worst of
  // the reference: those are raised alone at last, with passes of their own.
  void raise_few() {
    work_ = std::min(work_, (kMostPassesLost - kMostPasses) * double(result_.quality.cells));
    are_few_ = true;
    for (double before = 0; result_.report.best.min > kWorthwhile * before;) {
      before = result_.report.best.min;
      start_from_result();
      for (const int doublings : {2, 3, 4, 5}) raise(RaiseBy::SlidingNodes, doublings);
    }
    are_few_ = false;
  }

  bool is_on_edge(Index slider) const {
    return sliding_->at(slider, Eigen::Vector2d::Zero()).tangents.col(1).isZero(0);
  }

  void keep_slides() {
    result_.report.slid_nodes =
        ((slides_ - sliding_->slides).rowwise().squaredNorm().array() > 0).count();
    if (result_.report.slid_nodes > 0) result_.slides = slides_;
  }

  // False where no node slid.
  bool raise_by_sliding() {
    const std::vector<char> was_fixed = is_fixed_;
    const bool slid_before = sliding_;
    if (!let_slide(true)) return false;
    for (const int doublings : {2, 2, 3, 3, 4, 4, 5}) raise(RaiseBy::SlidingNodes, doublings);
    raise_while_worthwhile();
    if (result_.report.best.min < kKeptLittle * can_keep_.min && release_resting()) {
      start_from_result();
      for (const int doublings : {2, 3, 4}) raise(RaiseBy::SlidingNodes, doublings);
      raise_while_worthwhile();
    }
    if (!options_.volumes)
      raise_few();  // faces raised that far keep shapes from being raised later
    keep_slides();
    if (slid_before || result_.report.slid_nodes > 0) return true;
    is_fixed_ = was_fixed;
    sliding_ = nullptr;
    columns_.clear();
    slid_rows_.clear();
    at_ = {result_.positions, result_.quality, {}};
    is_at_result_ = true;
    return false;
  }

  // What moving any node needs, once.
  void prepare() {
    if (!incidence_) {
      incidence_.emplace(mesh_);
      mid_nodes_ = MidNodes(mesh_, came_.points);
    }
    if (!std::exchange(holds_flat_cells_, true)) hold_flat_cells();
  }

  // A field moves all nodes alike and so bends edges which their corners would leave straight.
  void straighten_edges() {
    mid_nodes_ = MidNodes(mesh_, came_.points);
    if (mid_nodes_.count() == 0) return;
    incidence_.emplace(mesh_);
    const MidNodes from_reference(mesh_, reference_.points);
    State next = at_;
    Patch around;
    around.is_of_mid_nodes = true;
    std::vector<char> has_cell(mesh_.cell_count(), 0);
    for (Index i = 0; i < mid_nodes_.count(); ++i) {
      const Index node = mid_nodes_.node(i);
      if (is_fixed_[node]) continue;
      from_reference.follow({i}, nullptr, next.positions, next.slides);
      const auto corners = mid_nodes_.corners(i);
      const double length =
          (came_.points.row(corners.front()) - came_.points.row(corners.back())).norm();
      if ((next.positions.row(node) - came_.points.row(node)).norm() <= kBent * length) {
        next.positions.row(node) = came_.points.row(node);
        continue;
      }
      around.nodes.push_back(node);
      for (const Index c : incidence_->cells(node))
        if (is_measured(result_.quality.values[c]) && !std::exchange(has_cell[c], 1))
          around.cells.push_back(c);
    }
    if (around.nodes.empty()) return;
    std::ranges::sort(around.nodes);
    std::ranges::sort(around.cells);
    was_invalid_.assign(mesh_.cell_count(), 0);
    for (const Index c : all_invalid_cells()) was_invalid_[c] = 1;
    try_at_once(RaiseBy::MidNodes, std::move(next), around);
    was_invalid_.clear();
    mid_nodes_ = MidNodes(mesh_, result_.positions);
  }

  // An attempt that takes no search. The next one starts from the result.
  void try_at_once(RaiseBy by, State next, const Patch& around) {
    RaiseAttempt attempt;
    attempt.by = by;
    attempt.cells = std::ssize(around.cells);
    attempt.passes = double(attempt.cells) / double(result_.quality.cells);
    judge(std::move(next), around, 0, attempt);
    result_.report.attempts.push_back(attempt);
    start_from_result();
  }

  // A smooth warp bends rows of nodes through a wall that changes shape and thickness at once.
  // So does raising, whose samples feel the shape of a cell more than its thickness.
  void straighten_all_rows() {
    straighten_rows(RaiseBy::SweptRows, options_.swept_rows);
    straighten_rows(RaiseBy::WallRows, options_.wall_rows);
  }
  void straighten_rows(RaiseBy by, const std::vector<NodeRow>& rows) {
    const Points& now = result_.positions;
    std::vector<const NodeRow*> bent;
    for (const NodeRow& row : rows)
      if (deviation(row, reference_.points, now) > kBent) bent.push_back(&row);
    if (bent.empty()) return;
    prepare();
    at_ = {result_.positions, result_.quality, slides_};
    State next = at_;
    std::vector<char> has_node(mesh_.node_count(), 0);
    Patch around;
    for (const NodeRow* row : bent) {
      const std::span inner(row->begin() + 1, row->end() - 1);
      if (std::ranges::any_of(inner, [&](Index n) { return is_fixed_[n]; })) continue;
      straighten(*row, next);
      for (const Index node : inner) has_node[node] = 1;
      around.nodes.insert(around.nodes.end(), inner.begin(), inner.end());
    }
    if (around.nodes.empty()) return;
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (is_measured(result_.quality.values[c]) &&
          std::ranges::any_of(mesh_.cell(c), [&](Index n) { return has_node[n]; }))
        around.cells.push_back(c);
    std::ranges::sort(around.nodes);
    add_followers(around, has_node);
    carry_followers(around, next);
    if (by == RaiseBy::WallRows && distorts(next.positions, around.cells)) return;
    try_at_once(by, std::move(next), around);
  }

  void straighten(const NodeRow& row, State& state) const {
    const Points places = straight_places(row, reference_.points, state.positions);
    for (Index i = 0; i < places.rows(); ++i) put_at(row[std::size_t(i) + 1], places.row(i), state);
  }

  // A node that slides as near as its surface lets it, if within its bounds.
  void put_at(Index node, const Eigen::RowVector3d& place, State& state) const {
    const Index slider = find_slider(sliding_, node);
    if (slider < 0) {
      state.positions.row(node) = place;
      return;
    }
    const Eigen::Vector2d slide =
        slide_below(*sliding_, slider, state.slides.row(slider).transpose(), place.transpose());
    if (!slide.allFinite() || !sliding_->is_within(slider, slide)) return;
    state.slides.row(slider) = slide.transpose();
    state.positions.row(node) = sliding_->at(slider, slide).point.transpose();
  }

  // Whether these cells are farther from their shapes of reference than where they came. Thin ones
  // can be sheared flat at no loss of their scaled Jacobian.
  bool distorts(const Points& positions, const std::vector<Index>& cells) const {
    const auto energy_at = [&](const Points& at) {
      ShapeEnergy energy(mesh_, reference_.points, at, FreeNodes(mesh_.node_count(), {}, nullptr),
                         cells, orientation_);
      energy.set_power(2);
      VectorXd slope;
      return energy(VectorXd(), slope);
    };
    return energy_at(positions) > energy_at(came_.points);
  }

  // Images of each other, and the nodes of the swept rows between them.
  void find_columns() {
    column_of_.assign(mesh_.node_count(), -1);
    for (const std::vector<Index>& group : images_.groups) {
      std::vector<Index>& column = columns_.emplace_back();
      for (const Index i : group) {
        column.push_back(sliding_->nodes[i]);
        column_of_[column.back()] = std::ssize(columns_) - 1;
      }
    }
    if (are_lost(RaiseBy::SweptRows)) return;
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

  // Holds rows until surface nodes slide: those of a sweep, which move only with their ends, and
  // those across walls whose cells are of even height. Where little is kept the latter are given
  // up, as the surface nodes' places are.
  void hold_rows() {
    const auto hold = [&](const NodeRow& row) {
      for (const Index node : row)
        if (!std::exchange(is_fixed_[node], 1)) of_held_rows_.push_back(node);
    };
    if (!are_lost(RaiseBy::SweptRows)) std::ranges::for_each(options_.swept_rows, hold);
    if (lost_much_ || are_lost(RaiseBy::WallRows)) return;
    for (const NodeRow& row : options_.wall_rows)
      if (is_even(row, reference_.points)) hold(row);
  }
  bool are_lost(RaiseBy rows) const {
    return std::ranges::any_of(result_.report.attempts, [&](const RaiseAttempt& tried) {
      return tried.by == rows && !tried.is_taken;
    });
  }
  // Whether any were held.
  bool release_rows() {
    for (const Index node : of_held_rows_) is_fixed_[node] = 0;
    return !std::exchange(of_held_rows_, {}).empty();
  }

  bool has_taken_search() const {
    return std::ranges::any_of(result_.report.attempts, [](const RaiseAttempt& attempt) {
      return attempt.power > 0 && attempt.is_taken;
    });
  }
  bool has_lost_much() const { return least_share(result_.report.best, can_keep_) < kKeptLittle; }
  double kept() const { return least_share(result_.report.best, result_.report.base); }

  // Finds what the affine map nearest to the motion leaves of the reference, where it tells of most
  // of the motion: what a stretch of the whole part costs is no loss. Returns whether there is more
  // to the motion than that map.
  bool compare_with_stretch() {
    const Index n = mesh_.node_count();
    Eigen::MatrixX4d from(n, 4);
    from << reference_.points, VectorXd::Ones(n);
    Eigen::Matrix4d square = from.transpose() * from;
    Eigen::Matrix<double, 4, 3> product = from.transpose() * result_.positions;
    // A plane's normal is to stay.
    const Eigen::Vector3d normal = plane_normal(mesh_, reference_.points);
    const Eigen::Matrix3d across = square.trace() * normal * normal.transpose();
    square.topLeftCorner<3, 3>() += across;
    product.topRows<3>() += across;
    const Eigen::Matrix<double, 4, 3> map = square.ldlt().solve(product);
    const Points image = from * map;
    if ((image - result_.positions).rowwise().norm().maxCoeff() <= kAffine * size_of_moved())
      return false;
    const double left_over = (image - result_.positions).squaredNorm();
    const double motion = (reference_.points - result_.positions).squaredNorm();
    if (left_over < kMainly * kMainly * motion && map.topRows<3>().determinant() > 0) {
      const WorstCells left = worst_cells(measure(image));
      can_keep_.min = std::min(can_keep_.min, left.min);
      can_keep_.worst_twentieth = std::min(can_keep_.worst_twentieth, left.worst_twentieth);
    }
    return true;
  }

  // Of the box round the fixed nodes that are not where the reference has them.
  double size_of_moved() const {
    Eigen::AlignedBox3d box;
    for (Index n = 0; n < mesh_.node_count(); ++n)
      if (is_fixed_[n] && result_.positions.row(n) != reference_.points.row(n))
        box.extend(Eigen::Vector3d(result_.positions.row(n)));
    return box.isEmpty() ? 0 : box.diagonal().norm();
  }

  double work_left() const {
    const double cells = double(result_.quality.cells);
    const double most = lost_much_ ? std::max(kMostPassesLost * cells, kSmallWorkLost)
                                   : std::max(kMostPasses * cells, kSmallWork);
    return (is_rising_ ? kMoreWork : 1) * most - work_;
  }

  // Nodes of solid cells without a shape to start from, that no move here is to make worse.
  void hold_flat_cells() {
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (result_.quality.values[c] <= kFlat ||
          (options_.volumes && came_.quality.values[c] <= kFlat))
        for (const Index node : mesh_.cell(c)) is_flat_[node] = is_fixed_[node] = 1;
    for (const Index c : all_invalid_cells())
      for (const Index node : mesh_.cell(c)) is_flat_[node] = is_fixed_[node] = 1;
  }

  // The worst cells of those that lost, worst first. Those of a bin come together: mirror images in
  // a mesh, which differ by rounding.
  std::vector<Index> seeds() const {
    const std::vector<double>& values = at_.quality.values;
    std::vector<Index> result;
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (is_measured(values[c]) && values[c] < kKept * reference_quality().values[c])
        result.push_back(c);
    const double most = std::max(1.0, kMostSeeds * double(result_.quality.cells));
    const auto first = [&](Index c) { return std::pair(quality_bin(values[c]), c); };
    std::size_t count = std::size_t(std::ceil(kWholeBins * most));
    if (result.size() > count) {
      std::ranges::nth_element(result, result.begin() + std::ptrdiff_t(count), {}, first);
      result.resize(count);
    }
    std::ranges::sort(result, {}, first);
    count = 0;
    while (count < result.size() && has_room(double(count), most, result, count)) ++count;
    result.resize(count);
    return result;
  }

  // Whether the cell at `next` is still taken where `most` are to be and `taken` are: to the end of
  // the bin of the one before, up to kWholeBins times as many.
  bool has_room(double taken, double most, const std::vector<Index>& cells,
                std::size_t next) const {
    const std::vector<double>& values = at_.quality.values;
    return taken < most ||
           (taken < kWholeBins * most && next > 0 &&
            quality_bin(values[cells[next - 1]]) == quality_bin(values[cells[next]]));
  }

  // The nodes of `seeds` that may move, of the first until so many cells change, and of layers of
  // cells round them.
  Patch patch_round(std::vector<Index> seeds, int layers, double most) const {
    std::vector<char> has_node(mesh_.node_count(), 0), has_cell(mesh_.cell_count(), 0);
    std::vector<Index> cells = std::move(seeds);
    Index changed = 0;
    const auto take = [&](Index node) {
      if (is_fixed_[node] || mid_nodes_.contains(node) || std::exchange(has_node[node], 1)) return;
      for (const Index c : incidence_->cells(node))
        if (is_measured(result_.quality.values[c]) && !std::exchange(has_cell[c], 1)) {
          cells.push_back(c);
          ++changed;
        }
    };
    std::size_t next = 0;
    for (int layer = 0; layer < layers; ++layer)
      for (const std::size_t last = cells.size();
           next < last && has_room(double(changed), most, cells, next); ++next) {
        const Index cell = cells[next];
        for (const Index node : mesh_.cell(cell)) for_column(node, take);
      }
    Patch result;
    result.nodes = marked(has_node);
    result.cells = marked(has_cell);
    add_followers(result, has_node);
    return result;
  }

  Patch patch(bool is_first) const {
    std::vector<Index> worst = seeds();
    if (are_few_) {
      std::erase_if(worst, [&](Index c) { return at_.quality.values[c] >= can_keep_.min; });
      return patch_round(std::move(worst), kLayers, double(mesh_.cell_count()) + 1);
    }
    const bool is_near = !lost_much_ && (is_first || kept() >= kNearlyKept);
    const double share = is_near ? kMostNeighboursNear : kMostNeighbours;
    return patch_round(std::move(worst), 1, share * double(result_.quality.cells));
  }

  // `has_node`: of all nodes, those of the patch.
  void add_followers(Patch& around, const std::vector<char>& has_node) const {
    for (Index i = 0; i < mid_nodes_.count(); ++i)
      if (!is_fixed_[mid_nodes_.node(i)] &&
          std::ranges::any_of(mid_nodes_.corners(i), [&](Index node) { return has_node[node]; }))
        around.followers.push_back(i);
  }

  void carry_followers(const Patch& around, State& state) const {
    for (const Index i : around.followers)
      mid_nodes_.follow(mid_nodes_.follower(i, sliding_), sliding_, state.positions, state.slides);
  }

  void raise(RaiseBy by, int doublings) {
    const bool is_first = std::ranges::all_of(
        result_.report.attempts, [](const RaiseAttempt& tried) { return tried.power == 0; });
    if (kept() >= (is_first ? kLostAny : kLost)) return;
    if (spoilt_ == std::pair(by, doublings)) return;
    const std::vector<char> was_fixed = is_fixed_;
    for (int trial = 0; trial < kTrials && work_left() > 0; ++trial) {
      const Patch around = patch(is_first);
      if (around.nodes.empty()) break;
      // The first attempt goes by shapes alone, which raises faces, too, and costs less.
      const FiniteVolumes* volumes = is_first ? nullptr : options_.volumes;
      FreeNodes free(mesh_.node_count(), around.nodes, sliding_);
      free.let_follow(mid_nodes_, around.followers);
      VectorXd x = free.start(at_.positions, at_.slides);
      std::optional<Mesh> linear;  // of faces all nodes count
      if (mid_nodes_.count() > 0 && !volumes)
        linear = with_linear_cells(mesh_, mid_nodes_, reference_.points, at_.positions);
      ShapeEnergy energy(linear ? *linear : mesh_, reference_.points, at_.positions,
                         std::move(free), around.cells, orientation_of_corners_, volumes);
      energy.set_power(doublings);
      energy.keep_flatness(came_.points);
      RaiseAttempt attempt;
      attempt.by = by;
      attempt.power = 1 << doublings;
      attempt.cells = std::ssize(around.cells);
      minimise(energy, x, volumes ? kFacesWork : 1, attempt);
      RowMatrix slides = at_.slides;
      energy.free_nodes().read_slides(x, slides);
      if (hold_nodes_off_surface(slides)) continue;
      judge({energy.positions_at(x), {}, std::move(slides)}, around, doublings, attempt);
      result_.report.attempts.push_back(attempt);
      break;
    }
    is_fixed_ = was_fixed;  // nodes held here may stay on their faces in the next attempt
  }

  // `work`: of a cell, in evaluations of its shape.
  void minimise(ShapeEnergy& energy, VectorXd& x, double work, RaiseAttempt& attempt) {
    const double one = work * double(attempt.cells), before = work_;
    const auto counted = [&](const VectorXd& at, VectorXd& slope) {
      const double value = energy(at, slope);
      work_ += std::isfinite(value) ? one : one / 2;  // it ends at the first cell that is not valid
      return value;
    };
    const int iterations = lost_much_ ? kIterationsLost : kIterations;
    const int most = std::min(iterations, int(work_left() / one / 2) + 1);
    const auto guess = [&](const VectorXd& at) -> const HessianGuess& {
      work_ += one;
      return energy.guess_hessian(at);
    };
    minimise_lbfgs(counted, x, guess, most);
    attempt.passes = (work_ - before) / double(result_.quality.cells);
  }

  bool hold_nodes_off_surface(const RowMatrix& slides) {
    bool has_any = false;
    for (Index i = 0; i < slides.rows(); ++i)
      if (slides.row(i) != at_.slides.row(i) && !sliding_->is_within(i, slides.row(i).transpose()))
        is_fixed_[sliding_->nodes[i]] = has_any = true;
    for (Index i = 0; has_any && i < mid_nodes_.count(); ++i)
      if (is_fixed_[mid_nodes_.node(i)] && is_slider(mid_nodes_.node(i)))
        for (const Index corner : mid_nodes_.corners(i)) is_fixed_[corner] = 1;
    return has_any;
  }

  // Takes the attempt into the result where it is better. The next one starts where this one ended,
  // taken or not; only where its cells are still too low or not valid, or the surface folds, does
  // it start from the result.
  void judge(State next, const Patch& around, int doublings, RaiseAttempt& attempt) {
    BestMeshReport& report = result_.report;
    is_rising_ = false;
    make_images_alike(around, next);
    straighten_swept(around, next);
    take_back_far(around, next);
    next.quality = measure_after(std::move(at_.quality), next.positions, around.cells);
    if (!take_back_bad(around, next) ||
        (sliding_ && options_.is_folded && options_.is_folded(next.positions, next.slides))) {
      at_ = {result_.positions, result_.quality, slides_};
      if (is_at_result_) spoilt_ = {attempt.by, doublings};
      is_at_result_ = true;
      return;
    }
    spoilt_.reset();
    is_at_result_ = false;
    at_ = std::move(next);
    const WorstCells now = attempt.after = worst_cells(at_.quality);
    // Straight rows and edges are worth having where they cost next to nothing.
    const bool is_straight = attempt.power == 0;
    const double kept = !is_straight                                      ? 1
                        : has_raised_ || attempt.by == RaiseBy::SweptRows ? kForRowsRaised
                                                                          : kForRows;
    const double before = sum_of_shares(report.best, report.base);
    const double sum = sum_of_shares(now, report.base);
    const double worth = attempt.power > 0 ? kWorthwhile * before : before;
    if (now.min < kept * report.plain.min ||
        now.worst_twentieth < kept * report.plain.worst_twentieth ||
        (is_straight ? sum < kept * before : sum <= worth))
      return;
    attempt.is_taken = is_at_result_ = true;
    is_rising_ = lost_much_ && sum > kRising * before;
    report.best = now;
    result_.positions = at_.positions;
    result_.quality = at_.quality;
    slides_ = at_.slides;
  }

  double moved(const Points& positions, Index node) const {
    return (positions.row(node) - reference_.points.row(node)).norm();
  }

  Index column(Index node) const { return columns_.empty() ? -1 : column_of_[node]; }

  // For a node and all that are to move alike.
  void for_column(Index node, const auto& act) const {
    if (column(node) < 0) return act(node);
    std::ranges::for_each(columns_[column(node)], act);
  }

  void straighten_swept(const Patch& around, State& state) const {
    if (slid_rows_.empty()) return;
    std::vector<char> has_node(mesh_.node_count(), 0);
    for (const Index node : around.nodes) has_node[node] = 1;
    for (const NodeRow* row : slid_rows_)
      if (std::ranges::any_of(*row, [&](Index node) { return has_node[node]; }))
        straighten(*row, state);
    carry_followers(around, state);
  }

  void make_images_alike(const Patch& around, State& state) const {
    if (!sliding_ || images_.groups.empty()) return;
    const RowMatrix alike = images_.alike(state.slides);
    // Only the patch's: nodes amid edges go with their corners, and others are where they were.
    for (const Index node : around.nodes) {
      const Index i = find_slider(sliding_, node);
      if (i < 0 || alike.row(i) == state.slides.row(i)) continue;
      state.positions.row(node) = sliding_->at(i, alike.row(i)).point;
      state.slides.row(i) = alike.row(i);
    }
    carry_followers(around, state);
  }

  // In large cells far from a small change nodes could move farther than anything of the part does:
  // such moves are taken back.
  void take_back_far(const Patch& around, State& state) const {
    bool has_any = false;
    for (const Index n : around.nodes)
      if (moved(state.positions, n) > reach_) has_any |= take_back(n, state, 0);
    if (has_any) carry_followers(around, state);
  }

  // Puts the nodes of cells that fell below the smallest of the motion that came, or are not valid,
  // back to where the result has them: where few are, the rest of the attempt is worth taking.
  // Returns whether none is left.
  bool take_back_bad(const Patch& around, State& state) const {
    const double least = result_.report.plain.min;
    std::vector<Index> to_check = around.cells;
    for (int round = 0; round <= kTakeBacks; ++round) {
      // Cells that were not valid have no node that moves, but one amid an edge.
      std::vector<Index> bad = invalid_cells(state.positions, to_check);
      if (!was_invalid_.empty()) std::erase_if(bad, [&](Index c) { return was_invalid_[c]; });
      if (state.quality.min < least)
        for (Index c = 0; c < mesh_.cell_count(); ++c)
          if (state.quality.values[c] < least) bad.push_back(c);
      if (bad.empty()) return true;
      if (round == kTakeBacks) break;
      const double kept = round < kHalvings ? 0.5 : 0;
      std::vector<Index> changed;
      std::vector<char> is_back(columns_.size(), 0);  // once a round, for all bad cells of one
      for (const Index c : bad)
        for (const Index node : mesh_.cell(c)) {
          if (is_fixed_[node] || mid_nodes_.contains(node) != around.is_of_mid_nodes ||
              (column(node) >= 0 && std::exchange(is_back[column(node)], 1)) ||
              !take_back(node, state, kept))
            continue;
          for_column(node, [&](Index back) {
            const auto cells = incidence_->cells(back);
            changed.insert(changed.end(), cells.begin(), cells.end());
          });
        }
      if (changed.empty()) break;
      carry_followers(around, state);
      std::ranges::sort(changed);
      changed.erase(std::ranges::unique(changed).begin(), changed.end());
      state.quality = measure_after(std::move(state.quality), state.positions, changed);
      to_check = std::move(changed);
    }
    return false;
  }

  // Leaves the node, and its images, that share of its move; returns whether any had moved.
  bool take_back(Index node, State& state, double kept) const {
    bool has_moved = false;
    for_column(node, [&](Index one) { has_moved |= take_back_alone(one, state, kept); });
    return has_moved;
  }
  bool take_back_alone(Index node, State& state, double kept) const {
    const Eigen::RowVector3d home = result_.positions.row(node);
    const Eigen::RowVector3d move = state.positions.row(node) - home;
    if (move.isZero(0)) return false;
    state.positions.row(node) = home + kept * move;
    const Index i = find_slider(sliding_, node);
    if (i < 0) return true;
    state.slides.row(i) = slides_.row(i) + kept * (state.slides.row(i) - slides_.row(i));
    if (kept > 0) state.positions.row(node) = sliding_->at(i, state.slides.row(i)).point;
    return true;
  }

  bool is_slider(Index node) const { return find_slider(sliding_, node) >= 0; }

  const Mesh& mesh_;
  const MeasuredShape &reference_, &came_;
  QualityReport of_faces_;  ///< of the reference
  const Orientation& orientation_;
  const Orientation orientation_of_corners_;
  const BestMeshOptions& options_;
  std::vector<char> is_fixed_, is_flat_;
  std::vector<char> was_invalid_;    ///< of all cells, while those that were so may stay so
  std::vector<Index> of_held_rows_;  ///< nodes that are fixed for that alone
  std::optional<NodeCells> incidence_;
  MidNodes mid_nodes_;
  const SlidingNodes* sliding_ = nullptr;
  SlidingImages images_;
  std::vector<std::vector<Index>> columns_;  ///< nodes that are to move alike
  std::vector<Index> column_of_;             ///< of all nodes, -1 where there is none
  std::vector<const NodeRow*> slid_rows_;    ///< of the columns
  bool holds_flat_cells_ = false, has_raised_ = false;
  bool lost_much_ = false;  ///< by the motion that came
  WorstCells can_keep_;     ///< of the reference, where the part is stretched as a whole
  State at_;                ///< where the last attempt ended
  bool is_at_result_ = true;
  bool are_few_ = false;                           ///< cells that are raised
  bool is_rising_ = false;                         ///< by the last attempt, and by much
  std::optional<std::pair<RaiseBy, int>> spoilt_;  ///< failed from the result: not to be repeated
  RowMatrix slides_;                               ///< of the result
  double work_ = 0, reach_ = 0;
  BestMeshResult result_;
};

}  // namespace

BestMeshResult find_best_mesh(const Mesh& mesh, const MeasuredShape& reference,
                              const MeasuredShape& moved, const std::vector<char>& is_fixed,
                              const Orientation& orientation, const BestMeshOptions& options) {
  const Stopwatch watch;
  BestMeshResult result = BestMesh(mesh, reference, moved, is_fixed, orientation, options).run();
  result.report.seconds = watch.seconds();
  return result;
}

}  // namespace cadmorph
