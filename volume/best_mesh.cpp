#include "volume/best_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "core/cell_topology.h"
#include "core/lbfgs.h"
#include "core/plane_mesh.h"
#include "core/rbf/anchors.h"
#include "core/stopwatch.h"
#include "volume/cell_judge.h"
#include "volume/moving_nodes.h"
#include "volume/nearest_affine.h"
#include "volume/node_cells.h"
#include "volume/shape_energy.h"
#include "volume/worst_patch.h"

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
// The nodes of the worst twentieth of the cells move, and of fewer where the cells at these nodes
// would be more than kMostNeighbours of all. Where little was lost, the first attempt, which mostly
// does, and others while kNearlyKept is kept stop at kMostNeighboursNear: a block of 5 million
// tetrahedra was at 0.979 after its first attempt, and was raised in 2.1 s in place of 3 with a
// tenth of its cells in the second, too. With 0.2 for 0.4, 9 pairs keep 4 % less of the worst
// twentieth on the mean, with 0.8 2 % less of the smallest; with 0.05 or 0.2 for 0.1 the worst
// twentieth of one keeps 3 % less; with 0.92 or 0.98 for 0.96 5 pairs come out the same.
constexpr double kMostNeighbours = 0.4, kMostNeighboursNear = 0.1, kNearlyKept = 0.96;
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
        judge_(mesh, orientation, options.volumes, options.validity),
        moving_(mesh, reference.points, std::move(is_fixed), options) {
    best_.positions = at_.positions = came.points;
    best_.quality = at_.quality = options.volumes ? judge_.measure(came.points) : came.quality;
    report_.is_by_faces = options.volumes;
    if (options.volumes) of_faces_ = judge_.measure(reference.points);
    can_keep_ = report_.base = worst_cells(reference_quality());
    for (Index n = 0; n < mesh.node_count(); ++n)
      reach_ = std::max(reach_, (moving_.is_fixed(n) ? kMostOvershoot : 1) * moved(came.points, n));
    report_.plain = report_.best = worst_cells(best_.quality);
  }

  BestMeshResult run() {
    if (kept() < kLost) straighten_edges();
    straighten_all_rows();
    if (kept() < kLostAny && compare_with_stretch()) {
      raise_all();
      has_raised_ = has_taken_search();
      if (has_raised_) straighten_all_rows();
    }
    if (options_.volumes)
      best_.quality = best_.positions == came_.points
                          ? came_.quality
                          : measure_quality(mesh_, best_.positions, orientation_);
    report_.slid_nodes = slid_nodes();
    if (report_.slid_nodes == 0) best_.slides.resize(0, 0);
    return {std::move(best_.positions), std::move(best_.slides), std::move(best_.quality),
            std::move(report_)};
  }

 private:
  struct State : NodePlaces {
    QualityReport quality;  ///< see CellJudge
  };

  const QualityReport& reference_quality() const {
    return options_.volumes ? of_faces_ : reference_.quality;
  }
  // The least share of the reference's figures that is left; of what a stretch of the whole leaves.
  double kept() const { return least_share(report_.best, report_.base); }
  double kept_of_stretch() const { return least_share(report_.best, can_keep_); }

  // Whether the mesh has no solid cells, and does not lie in one plane, in which it was before,
  // too.
  bool is_shell() const {
    return dimension(mesh_) < 3 && plane_normal(mesh_, reference_.points, came_.points).isZero(0);
  }

  // What a stretch of the whole part costs is no loss. Returns whether there is more to the motion.
  bool compare_with_stretch() {
    const NearestAffine stretch = nearest_affine(mesh_, reference_.points, best_.positions);
    if (stretch.farthest <= kAffine * size_of_moved()) return false;
    if (stretch.is_whole) {
      const WorstCells left = worst_cells(judge_.measure(stretch.image));
      can_keep_.min = std::min(can_keep_.min, left.min);
      can_keep_.worst_twentieth = std::min(can_keep_.worst_twentieth, left.worst_twentieth);
    }
    return true;
  }

  // Of the box round the fixed nodes that are not where the reference has them.
  double size_of_moved() const {
    Eigen::AlignedBox3d box;
    for (Index n = 0; n < mesh_.node_count(); ++n)
      if (moving_.is_fixed(n) && best_.positions.row(n) != reference_.points.row(n))
        box.extend(Eigen::Vector3d(best_.positions.row(n)));
    return box.isEmpty() ? 0 : box.diagonal().norm();
  }

  // What moving any node needs, once.
  void prepare() {
    if (!cells_at_) {
      cells_at_.emplace(mesh_);
      moving_.find_mid_nodes(came_.points);
    }
    if (!std::exchange(holds_flat_cells_, true)) hold_flat_cells();
  }

  // Nodes of solid cells without a shape to start from, that no move here is to make worse.
  void hold_flat_cells() {
    const auto hold = [&](Index cell) {
      for (const Index node : mesh_.cell(cell)) moving_.fix_for_good(node);
    };
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (best_.quality.values[c] <= kFlat ||
          (options_.volumes && came_.quality.values[c] <= kFlat))
        hold(c);
    std::ranges::for_each(judge_.find_invalid(best_.positions), hold);
  }

  void raise_all() {
    prepare();
    lost_much_ = kept_of_stretch() < kKeptLittle;
    hold_rows();
    if (is_shell()) let_slide(false);  // nodes within faces are its inner nodes
    raise(RaiseBy::InnerNodes, 2);
    const auto raise_inner = [&] {
      for (const int doublings : {3, 4, 5}) raise(RaiseBy::InnerNodes, doublings);
    };
    if (kept_of_stretch() >= kKeptLittle) {
      raise_inner();
      if (kept_of_stretch() >= kKeptEnough) return;
      moving_.release_rows();
      raise_by_sliding();
      return;
    }
    const bool held_rows = moving_.release_rows();
    if (raise_by_sliding()) return;
    if (held_rows) raise(RaiseBy::InnerNodes, 2);
    raise_inner();
  }

  bool let_slide(bool on_edges) {
    const bool slid_before = moving_.sliding();
    if (!moving_.let_slide(on_edges, !are_refused(RaiseBy::SweptRows))) return false;
    if (!slid_before) at_.slides = best_.slides = moving_.sliding()->slides;
    return true;
  }

  Index slid_nodes() const {
    if (!moving_.sliding()) return 0;
    return ((best_.slides - moving_.sliding()->slides).rowwise().squaredNorm().array() > 0).count();
  }

  // False where no node slid.
  bool raise_by_sliding() {
    const std::vector<char> was_fixed = moving_.fixed();
    const bool slid_before = moving_.sliding();
    if (!let_slide(true)) return false;
    for (const int doublings : {2, 2, 3, 3, 4, 4, 5}) raise(RaiseBy::SlidingNodes, doublings);
    raise_while_worthwhile();
    if (report_.best.min < kKeptLittle * can_keep_.min &&
        moving_.release_resting(cells_below(kKeptLittle * can_keep_.min))) {
      start_from_best();
      for (const int doublings : {2, 3, 4}) raise(RaiseBy::SlidingNodes, doublings);
      raise_while_worthwhile();
    }
    if (!options_.volumes)
      raise_few();  // faces raised that far keep shapes from being raised later
    if (slid_before || slid_nodes() > 0) return true;
    moving_.set_fixed(was_fixed);
    moving_.end_sliding();
    best_.slides.resize(0, 0);
    start_from_best();
    return false;
  }

  std::vector<Index> cells_below(double quality) const {
    std::vector<Index> result;
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (best_.quality.values[c] < quality) result.push_back(c);
    return result;
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
    const WorstCells &best = report_.best, &base = report_.base;
    for (double before = 0; sum_of_shares(best, base) > kWorthwhile * before;) {
      before = sum_of_shares(best, base);
      raise_by(kForSmallest);
      if (best.min * base.worst_twentieth > best.worst_twentieth * base.min) raise_by(kForMean);
    }
  }

  // A search over much of the mesh is slow to raise the few cells that are still below the worst of
  // the reference: those are raised alone at last, with passes of their own.
  void raise_few() {
    work_ = std::min(work_, (kMostPassesLost - kMostPasses) * double(best_.quality.cells));
    are_few_ = true;
    for (double before = 0; report_.best.min > kWorthwhile * before;) {
      before = report_.best.min;
      start_from_best();
      for (const int doublings : {2, 3, 4, 5}) raise(RaiseBy::SlidingNodes, doublings);
    }
    are_few_ = false;
  }

  void start_from_best() {
    at_ = best_;
    is_at_best_ = true;
    spoilt_.reset();
  }

  // Holds rows until surface nodes slide: those of a sweep, which move only with their ends, and
  // those across walls whose cells are of even height. Where little is kept the latter are given
  // up, as the surface nodes' places are.
  void hold_rows() {
    if (!are_refused(RaiseBy::SweptRows))
      for (const NodeRow& row : options_.swept_rows) moving_.hold(row);
    if (lost_much_ || are_refused(RaiseBy::WallRows)) return;
    for (const NodeRow& row : options_.wall_rows)
      if (is_even(row, reference_.points)) moving_.hold(row);
  }

  // Whether it was tried to straighten them, and not taken.
  bool are_refused(RaiseBy rows) const {
    return std::ranges::any_of(report_.attempts, [&](const RaiseAttempt& tried) {
      return tried.by == rows && !tried.is_taken;
    });
  }

  // A field moves all nodes alike and so bends edges which their corners would leave straight.
  void straighten_edges() {
    moving_.find_mid_nodes(came_.points);
    const MidNodes& mid_nodes = moving_.mid_nodes();
    if (mid_nodes.count() == 0) return;
    cells_at_.emplace(mesh_);
    const MidNodes from_reference(mesh_, reference_.points);
    State next = at_;
    Patch around;
    around.is_of_mid_nodes = true;
    std::vector<char> has_cell(mesh_.cell_count(), 0);
    for (Index i = 0; i < mid_nodes.count(); ++i) {
      const Index node = mid_nodes.node(i);
      if (moving_.is_fixed(node)) continue;
      from_reference.follow({i}, nullptr, next.positions, next.slides);
      const auto corners = mid_nodes.corners(i);
      const double length =
          (came_.points.row(corners.front()) - came_.points.row(corners.back())).norm();
      if ((next.positions.row(node) - came_.points.row(node)).norm() <= kBent * length) {
        next.positions.row(node) = came_.points.row(node);
        continue;
      }
      around.nodes.push_back(node);
      for (const Index c : cells_at_->cells(node))
        if (is_measured(best_.quality.values[c]) && !std::exchange(has_cell[c], 1))
          around.cells.push_back(c);
    }
    if (around.nodes.empty()) return;
    std::ranges::sort(around.nodes);
    std::ranges::sort(around.cells);
    was_invalid_.assign(mesh_.cell_count(), 0);
    for (const Index c : judge_.find_invalid(best_.positions)) was_invalid_[c] = 1;
    try_at_once(RaiseBy::MidNodes, std::move(next), around);
    was_invalid_.clear();
    moving_.find_mid_nodes(best_.positions);
  }

  // A smooth warp bends rows of nodes through a wall that changes shape and thickness at once.
  // So does raising, whose samples feel the shape of a cell more than its thickness.
  void straighten_all_rows() {
    straighten_rows(RaiseBy::SweptRows, options_.swept_rows);
    straighten_rows(RaiseBy::WallRows, options_.wall_rows);
  }
  void straighten_rows(RaiseBy by, const std::vector<NodeRow>& rows) {
    std::vector<const NodeRow*> bent;
    for (const NodeRow& row : rows)
      if (deviation(row, reference_.points, best_.positions) > kBent) bent.push_back(&row);
    if (bent.empty()) return;
    prepare();
    start_from_best();
    State next = at_;
    std::vector<char> has_node(mesh_.node_count(), 0);
    Patch around;
    for (const NodeRow* row : bent) {
      const std::span inner(row->begin() + 1, row->end() - 1);
      if (std::ranges::any_of(inner, [&](Index n) { return moving_.is_fixed(n); })) continue;
      moving_.straighten(*row, next);
      for (const Index node : inner) has_node[node] = 1;
      around.nodes.insert(around.nodes.end(), inner.begin(), inner.end());
    }
    if (around.nodes.empty()) return;
    for (Index c = 0; c < mesh_.cell_count(); ++c)
      if (is_measured(best_.quality.values[c]) &&
          std::ranges::any_of(mesh_.cell(c), [&](Index n) { return has_node[n]; }))
        around.cells.push_back(c);
    std::ranges::sort(around.nodes);
    moving_.add_followers(around, has_node);
    moving_.carry_followers(around, next);
    if (by == RaiseBy::WallRows && distorts(next.positions, around.cells)) return;
    try_at_once(by, std::move(next), around);
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

  // An attempt that takes no search. The next one starts from the best.
  void try_at_once(RaiseBy by, State next, const Patch& around) {
    RaiseAttempt attempt;
    attempt.by = by;
    attempt.cells = std::ssize(around.cells);
    attempt.passes = double(attempt.cells) / double(best_.quality.cells);
    judge(std::move(next), around, 0, attempt);
    report_.attempts.push_back(attempt);
    start_from_best();
  }

  bool has_taken_search() const {
    return std::ranges::any_of(report_.attempts, [](const RaiseAttempt& attempt) {
      return attempt.power > 0 && attempt.is_taken;
    });
  }

  double work_left() const {
    const double cells = double(best_.quality.cells);
    const double most = lost_much_ ? std::max(kMostPassesLost * cells, kSmallWorkLost)
                                   : std::max(kMostPasses * cells, kSmallWork);
    return (is_rising_ ? kMoreWork : 1) * most - work_;
  }

  Patch patch(bool is_first) const {
    std::vector<Index> worst = worst_that_lost(at_.quality, reference_quality());
    int layers = 1;
    double most = double(mesh_.cell_count()) + 1;
    if (are_few_) {
      std::erase_if(worst, [&](Index c) { return at_.quality.values[c] >= can_keep_.min; });
      layers = kLayers;
    } else {
      const bool is_near = !lost_much_ && (is_first || kept() >= kNearlyKept);
      most = (is_near ? kMostNeighboursNear : kMostNeighbours) * double(best_.quality.cells);
    }
    return patch_round(std::move(worst), layers, most, at_.quality, *cells_at_, moving_);
  }

  // One attempt by a search with the power 2^doublings.
  void raise(RaiseBy by, int doublings) {
    const bool is_first = std::ranges::all_of(
        report_.attempts, [](const RaiseAttempt& tried) { return tried.power == 0; });
    if (kept() >= (is_first ? kLostAny : kLost)) return;
    if (spoilt_ == std::pair(by, doublings)) return;
    const std::vector<char> was_fixed = moving_.fixed();
    for (int trial = 0; trial < kTrials && work_left() > 0; ++trial) {
      const Patch around = patch(is_first);
      if (around.nodes.empty()) break;
      // The first attempt goes by shapes alone, which raises faces, too, and costs less.
      const FiniteVolumes* volumes = is_first ? nullptr : options_.volumes;
      FreeNodes free(mesh_.node_count(), around.nodes, moving_.sliding());
      free.let_follow(moving_.mid_nodes(), around.followers);
      VectorXd x = free.start(at_.positions, at_.slides);
      std::optional<Mesh> linear;  // of faces all nodes count
      if (moving_.mid_nodes().count() > 0 && !volumes)
        linear = with_linear_cells(mesh_, moving_.mid_nodes(), reference_.points, at_.positions);
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
      if (moving_.fix_those_beyond(at_.slides, slides)) continue;
      judge({{energy.positions_at(x), std::move(slides)}, {}}, around, doublings, attempt);
      report_.attempts.push_back(attempt);
      break;
    }
    moving_.set_fixed(was_fixed);  // nodes held here may stay on their faces in the next attempt
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
    attempt.passes = (work_ - before) / double(best_.quality.cells);
  }

  // Takes the attempt for the best where it is better. The next one starts where this one ended,
  // taken or not; only where its cells are still too low or not valid, or the surface folds, does
  // it start from the best.
  void judge(State next, const Patch& around, int doublings, RaiseAttempt& attempt) {
    is_rising_ = false;
    moving_.align_columns(around, next);
    take_back_far(around, next);
    next.quality = judge_.measure_again(std::move(at_.quality), next.positions, around.cells);
    if (!take_back_bad(around, next) || (moving_.sliding() && options_.is_folded &&
                                         options_.is_folded(next.positions, next.slides))) {
      const bool was_at_best = is_at_best_;
      start_from_best();
      if (was_at_best) spoilt_ = {attempt.by, doublings};
      return;
    }
    spoilt_.reset();
    is_at_best_ = false;
    at_ = std::move(next);
    const WorstCells now = attempt.after = worst_cells(at_.quality);
    // Straight rows and edges are worth having where they cost next to nothing.
    const bool is_straight = attempt.power == 0;
    const double kept = !is_straight                                      ? 1
                        : has_raised_ || attempt.by == RaiseBy::SweptRows ? kForRowsRaised
                                                                          : kForRows;
    const double before = sum_of_shares(report_.best, report_.base);
    const double sum = sum_of_shares(now, report_.base);
    const double worth = attempt.power > 0 ? kWorthwhile * before : before;
    if (now.min < kept * report_.plain.min ||
        now.worst_twentieth < kept * report_.plain.worst_twentieth ||
        (is_straight ? sum < kept * before : sum <= worth))
      return;
    attempt.is_taken = is_at_best_ = true;
    is_rising_ = lost_much_ && sum > kRising * before;
    report_.best = now;
    best_ = at_;
  }

  double moved(const Points& positions, Index node) const {
    return (positions.row(node) - reference_.points.row(node)).norm();
  }

  // In large cells far from a small change nodes could move farther than anything of the part does:
  // such moves are taken back.
  void take_back_far(const Patch& around, State& state) const {
    bool has_any = false;
    for (const Index n : around.nodes)
      if (moved(state.positions, n) > reach_) has_any |= moving_.take_back(n, best_, 0, state);
    if (has_any) moving_.carry_followers(around, state);
  }

  // Puts the nodes of cells that fell below the smallest of the motion that came, or are not valid,
  // back to where the best has them: where few are, the rest of the attempt is worth taking.
  // Returns whether none is left.
  bool take_back_bad(const Patch& around, State& state) const {
    const double least = report_.plain.min;
    std::vector<Index> to_check = around.cells;
    for (int round = 0; round <= kTakeBacks; ++round) {
      // Cells that were not valid have no node that moves, but one amid an edge.
      std::vector<Index> bad = judge_.find_invalid(state.positions, to_check);
      if (!was_invalid_.empty()) std::erase_if(bad, [&](Index c) { return was_invalid_[c]; });
      if (state.quality.min < least)
        for (Index c = 0; c < mesh_.cell_count(); ++c)
          if (state.quality.values[c] < least) bad.push_back(c);
      if (bad.empty()) return true;
      if (round == kTakeBacks) break;
      const std::vector<Index> changed =
          take_back(bad, round < kHalvings ? 0.5 : 0, around.is_of_mid_nodes, state);
      if (changed.empty()) break;
      moving_.carry_followers(around, state);
      state.quality = judge_.measure_again(std::move(state.quality), state.positions, changed);
      to_check = changed;
    }
    return false;
  }

  // Leaves the nodes of these cells that share of their moves. Returns the cells that changed.
  std::vector<Index> take_back(const std::vector<Index>& cells, double kept, bool are_mid_nodes,
                               State& state) const {
    std::vector<Index> changed;
    std::vector<char> is_back(moving_.column_count(), 0);  // once, for all cells of a column
    for (const Index c : cells)
      for (const Index node : mesh_.cell(c)) {
        const Index column = moving_.column(node);
        if (moving_.is_fixed(node) || moving_.mid_nodes().contains(node) != are_mid_nodes ||
            (column >= 0 && std::exchange(is_back[column], 1)) ||
            !moving_.take_back(node, best_, kept, state))
          continue;
        moving_.for_column(node, [&](Index back) {
          const auto at = cells_at_->cells(back);
          changed.insert(changed.end(), at.begin(), at.end());
        });
      }
    std::ranges::sort(changed);
    changed.erase(std::ranges::unique(changed).begin(), changed.end());
    return changed;
  }

  const Mesh& mesh_;
  const MeasuredShape &reference_, &came_;
  QualityReport of_faces_;  ///< of the reference
  const Orientation& orientation_;
  const Orientation orientation_of_corners_;
  const BestMeshOptions& options_;
  const CellJudge judge_;
  MovingNodes moving_;
  std::optional<NodeCells> cells_at_;
  std::vector<char> was_invalid_;  ///< of all cells, while those that were so may stay so
  bool holds_flat_cells_ = false, has_raised_ = false;
  bool lost_much_ = false;  ///< by the motion that came
  WorstCells can_keep_;     ///< of the reference, where the part is stretched as a whole
  State best_;
  State at_;  ///< where the last attempt ended
  bool is_at_best_ = true;
  bool are_few_ = false;                           ///< cells that are raised
  bool is_rising_ = false;                         ///< by the last attempt, and by much
  std::optional<std::pair<RaiseBy, int>> spoilt_;  ///< failed from the best: not to be repeated
  double work_ = 0, reach_ = 0;
  BestMeshReport report_;
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
