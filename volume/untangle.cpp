#include "volume/untangle.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/foldover.h"
#include "core/lbfgs.h"
#include "core/stopwatch.h"
#include "volume/distortion.h"
#include "volume/held_cells.h"
#include "volume/mid_nodes.h"
#include "volume/node_cells.h"
#include "volume/sound_volumes.h"

namespace cadmorph {
namespace {

using Eigen::VectorXd;

// Minimisations end when they lower the energy by less than this share, all samples positive. With
// twice the value 6 pairs come out the same; with half 3 do, others gain up to 5 % in the mean of
// the worst twentieth, or lose 1 %.
constexpr double kSettled = 1e-3;
// Neighbourhoods in a row that may repair nothing: each reaches twice as far as the one before.
// With 1 or 4, 7 pairs come out the same; a piston that stays invalid takes 46 s with 4 in place of
// 12.
constexpr int kIdleAttempts = 2;
// Minimisations of a neighbourhood: each holds the nodes that slid beyond their surfaces before.
// With 1, 16 cells of a manifold repaired at once stay invalid; with 6, 6 pairs come out the same.
constexpr int kTrials = 3;
// After so many minimisations the smallest determinant is to have risen by a tenth at least. After
// 3 it has not risen in that manifold, where 17 cells stay; after 12, 14 repairs end as sound.
constexpr int kPatience = 6;
constexpr double kLeastRise = 0.1;
// Not before they took this share of the most work: small neighbourhoods cost next to nothing, and
// from three other starts that manifold was given up after six, but is repaired where it goes on.
constexpr double kPatientWork = 0.01;
// A repair ends when it has done both: counts, not times, end at the same place on every machine.
// Those that succeeded on the families up to 150 % and on real parts took 33 passes over the mesh's
// cells at most, or 5e7 nodes of samples on small meshes; what takes more fails in the end, and
// took minutes to.
constexpr double kMostPasses = 100;
constexpr double kSmallWork = 1e8;
// After the first share of its work a repair ends where, at its pace so far, kTimesAll times all of
// the work would not repair the rest. Of wrecked meshes a hundredth of the inverted cells is
// repaired by then. With half or twice of these, or of kAttemptWork, a piston that stays invalid
// takes about as long; with half, 8 repairs end the same. The tests pass with either.
constexpr double kWorkToJudge = 0.25, kTimesAll = 4;
// Of the work, the most for a repair with straight edges, or of sound cells that were turned over
// by their corners: it succeeds within that, or mostly not at all.
constexpr double kAttemptWork = 0.25;

// The cells within some rings of the seeds, and the nodes that may move.
struct Neighbourhood {
  std::vector<Index> cells;  ///< with a free node, ascending
  std::vector<Index> nodes;  ///< free ones, ascending
};

Neighbourhood grow(const Mesh& mesh, const NodeCells& incidence, const std::vector<Index>& seeds,
                   int rings, const std::vector<char>& is_fixed) {
  std::vector<char> has_cell(mesh.cell_count(), 0), has_node(mesh.node_count(), 0);
  std::vector<Index> front = seeds, nodes;
  for (const Index c : seeds) has_cell[c] = 1;
  for (int ring = 0; ring < rings && !front.empty(); ++ring) {
    std::vector<Index> next;
    for (const Index c : front)
      for (const Index node : mesh.cell(c)) {
        if (std::exchange(has_node[node], 1)) continue;
        if (!is_fixed[node]) nodes.push_back(node);
        for (const Index other : incidence.cells(node))
          if (!std::exchange(has_cell[other], 1)) next.push_back(other);
      }
    front = std::move(next);
  }
  Neighbourhood result;
  std::vector<char> is_active(mesh.cell_count(), 0);
  for (const Index node : nodes)
    for (const Index c : incidence.cells(node))
      if (dimension(mesh.types[c]) == 3) is_active[c] = 1;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (is_active[c]) result.cells.push_back(c);
  std::ranges::sort(nodes);
  result.nodes = std::move(nodes);
  return result;
}

// What an evaluation of the distortion costs.
struct Cost {
  double nodes = 0;   ///< of the samples, see Distortion::size
  double passes = 0;  ///< over all cells of the mesh
};

// How many evaluations a repair has done, of those that it may do.
class Work {
 public:
  /// `most`: as a share of what any repair may take.
  explicit Work(double most) : most_(most) {}

  void add(const Cost& one) {
    done_.nodes += one.nodes;
    done_.passes += one.passes;
  }
  // The share done; 1: all of them.
  double share() const { return share_of_any() / most_; }
  // The share done of what any repair may take.
  double share_of_any() const {
    return std::min(done_.nodes / kSmallWork, done_.passes / kMostPasses);
  }
  bool is_over() const { return fell_short_ || share() >= 1; }
  bool fell_short() const { return fell_short_; }
  // How many evaluations of `one` are left.
  int left(const Cost& one) const {
    const double by_nodes = (most_ * kSmallWork - done_.nodes) / one.nodes;
    const double by_passes = (most_ * kMostPasses - done_.passes) / one.passes;
    return int(std::clamp(std::max(by_nodes, by_passes), 1.0, 1e6));
  }
  // Ends the repair where kTimesAll times all work would not repair what remains inverted, at the
  // pace of the work since its share was `start`.
  void judge(double start, Index repaired, Index remaining) {
    fell_short_ = share() >= kWorkToJudge &&
                  kTimesAll * double(repaired) < double(remaining) * (share() - start);
  }

 private:
  double most_;
  Cost done_;
  bool fell_short_ = false;
};

// Returns the unknowns at the least distortion found, where the positions then are, too. An
// evaluation is `one` more work.
VectorXd minimise(Distortion& distortion, VectorXd x, const Cost& one,
                  const UntangleOptions& options, Work& work) {
  VectorXd gradient;
  double epsilon = 1, first_least = 0;
  bool is_rising = false;
  const double patient_until = work.share_of_any() + kPatientWork;
  distortion(x, epsilon, gradient);
  Index most_inverted = distortion.inverted();
  double start = work.share();
  if (distortion.least_determinant() > 0) epsilon = kLeastEpsilon;
  for (int outer = 0; outer < options.outer_iterations && !work.is_over(); ++outer) {
    const auto energy = [&](const VectorXd& at, VectorXd& slope) {
      work.add(one);
      return distortion(at, epsilon, slope);
    };
    const double before = energy(x, gradient);
    minimise_lbfgs(
        energy, x,
        [&](const VectorXd& at) -> const HessianGuess& {
          work.add(one);
          return distortion.guess_hessian(at, epsilon);
        },
        std::min(options.inner_iterations, work.left(one)));
    const double after = energy(x, gradient);
    const double least = distortion.least_determinant();
    if (least > 0 && epsilon <= kLeastEpsilon && after > (1 - kSettled) * before) break;
    if (distortion.inverted() > most_inverted) {  // as once more nodes may move
      most_inverted = distortion.inverted();
      start = work.share();
    } else {
      work.judge(start, most_inverted - distortion.inverted(), distortion.inverted());
      if (work.fell_short()) break;
    }
    if (outer == 0) first_least = least;
    if (outer >= kPatience && !is_rising && work.share_of_any() >= patient_until) {
      is_rising = least >= (1 - kLeastRise) * std::min(first_least, 0.0);
      if (!is_rising) break;
    }
    epsilon = next_epsilon(epsilon, least, before, after);
  }
  return x;
}

void check_sizes(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed) {
  if (positions.rows() != mesh.node_count() ||
      static_cast<Index>(is_fixed.size()) != mesh.node_count())
    throw InvalidInputError("untangling needs a position and a mark for each of the mesh's " +
                            std::to_string(mesh.node_count()) + " nodes");
}

// Puts the nodes amid edges that are straight in the base mesh back into the middle of the corners,
// wherever these are now.
void straighten(const Mesh& mesh, const MidNodes& mid_nodes, const std::vector<char>& is_fixed,
                Points& positions) {
  for (Index i = 0; i < mid_nodes.count(); ++i) {
    const Index node = mid_nodes.node(i);
    if (!is_fixed[node] && mid_nodes.is_amid(i, mesh.points))
      positions.row(node) = mid_nodes.middle(i, positions);
  }
}

// Marks the nodes of cells that only bent edges could make valid: those without a free corner.
void mark_bent(const Mesh& mesh, const MidNodes& mid_nodes, const std::vector<Index>& cells,
               const std::function<bool(Index node)>& is_free, std::vector<char>& is_bent) {
  for (const Index c : cells) {
    const auto nodes = mesh.cell(c);
    if (std::ranges::any_of(nodes,
                            [&](Index node) { return !mid_nodes.contains(node) && is_free(node); }))
      continue;
    for (const Index node : nodes) is_bent[node] = 1;
  }
}

// The cells that are inverted by their corners, but were not in the base mesh.
std::vector<Index> cells_turned_over(const Mesh& mesh, const Points& positions,
                                     const Orientation& orientation) {
  const QualityReport before = measure_quality(mesh, mesh.points, orientation),
                      now = measure_quality(mesh, positions, orientation);
  std::vector<Index> result;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (now.values[c] <= 0 && before.values[c] > 0) result.push_back(c);
  return result;
}

// How a repair differs from the plain one.
struct RepairPlan {
  MidNodes mid_nodes = {};         ///< nodes that go with their corners
  std::vector<char> is_bent = {};  ///< a flag a node: those that nevertheless do not
  std::vector<Index> others = {};  ///< valid cells for the first neighbourhood to hold, too
  double most_work = 1;            ///< see Work
};

// Where a repair begins.
struct RepairStart {
  const Points& positions;
  const RowMatrix& slides;  ///< of options.sliding, where these nodes are at `positions`
  const std::vector<char>& is_fixed;
};

// A mesh under repair: tries ever larger neighbourhoods of the cells to repair.
class Repair {
 public:
  Repair(const Mesh& mesh, const RepairStart& start, const Orientation& orientation,
         const UntangleOptions& options, RepairPlan plan)
      : mesh_(mesh),
        orientation_(orientation),
        options_(options),
        incidence_(mesh),
        is_fixed_(start.is_fixed),
        positions_(start.positions),
        slides_(start.slides),
        plan_(std::move(plan)),
        orientation_of_corners_(orientation_of_corners(mesh, orientation)),
        work_(options.most_work * plan_.most_work) {
    if (plan_.mid_nodes.count() > 0 && has_second_order(mesh))
      linear_ = with_linear_cells(mesh, plan_.mid_nodes, mesh.points, start.positions,
                                  [&](Index node) { return plan_.is_bent[node] != 0; });
    if (!options.sliding) return;
    for (const Index node : options.sliding->nodes) is_fixed_[node] = 0;
  }

  void run(UntangleReport& report) {
    std::vector<Index> seeds = report.validity.invalid_cells;
    seeds.insert(seeds.end(), options_.poor_cells.begin(), options_.poor_cells.end());
    seeds.insert(seeds.end(), plan_.others.begin(), plan_.others.end());
    seeds = movable(seeds);
    const Index invalid = report.validity.invalid;
    int idle = 0;
    for (int attempt = 0;
         attempt < options_.attempts && !seeds.empty() && idle < kIdleAttempts && !work_.is_over();
         ++attempt) {
      if (options_.progress) options_.progress("untangle", 1.0 * attempt / options_.attempts);
      const Index before = report.validity.invalid;
      if (!try_once(seeds, options_.rings << attempt, report)) break;
      idle = report.validity.invalid < before ? 0 : idle + 1;
      seeds = movable(report.validity.invalid_cells);
    }
    report.fell_short =
        work_.fell_short() || (work_.share() >= kWorkToJudge && report.validity.invalid >= invalid);
    report.slid_nodes = (slides_.rowwise().squaredNorm().array() > 0).count();
  }

  // Whether no cell is left that a move of free nodes may help.
  bool is_done(const UntangleReport& report) const {
    return movable(report.validity.invalid_cells).empty();
  }

  const Points& positions() const { return positions_; }
  const RowMatrix& slides() const { return slides_; }

 private:
  bool is_held(Index c) const {
    return cadmorph::is_held(mesh_, positions_, is_fixed_, orientation_, c);
  }

  // Seeds that a move of free nodes may help.
  std::vector<Index> movable(const std::vector<Index>& seeds) const {
    std::vector<Index> result;
    std::ranges::copy_if(seeds, std::back_inserter(result), [&](Index c) { return !is_held(c); });
    return result;
  }

  // Keeps the outcome unless it has more invalid cells. Nodes that slid off stay, and all is tried
  // once more. Returns whether any node is free.
  bool try_once(const std::vector<Index>& seeds, int rings, UntangleReport& report) {
    for (int trial = 0; trial < kTrials; ++trial) {
      Neighbourhood around = grow(mesh_, incidence_, seeds, rings, is_fixed_);
      std::erase_if(around.nodes, [&](Index node) { return follows(node); });
      if (around.nodes.empty()) return false;
      report.rings = rings;
      report.moved_nodes = static_cast<Index>(around.nodes.size());
      FreeNodes free(mesh_.node_count(), around.nodes, options_.sliding);
      free.let_follow(plan_.mid_nodes, followers(around.nodes));
      const VectorXd start = free.start(positions_, slides_);
      // Cells held inverted have no say: their energy would outweigh all others.
      Distortion distortion(linear_ ? *linear_ : mesh_, positions_, std::move(free),
                            movable(around.cells), orientation_of_corners_);
      const Cost one{distortion.size(), double(around.cells.size()) / double(mesh_.cell_count())};
      const VectorXd x = minimise(distortion, start, one, options_, work_);
      ValidityReport validity = check_validity(mesh_, distortion.positions(), orientation_);
      const Index before = report.validity.invalid;
      if (validity.invalid > before) return true;
      RowMatrix slides = slides_;
      distortion.free_nodes().read_slides(x, slides);
      if (hold_nodes_off_surface(slides) > 0) {
        if (validity.invalid == before && before > 0) return true;
        continue;
      }
      positions_ = distortion.positions();
      slides_ = std::move(slides);
      report.validity = std::move(validity);
      return true;
    }
    return true;
  }

  bool follows(Index node) const { return plan_.mid_nodes.contains(node) && !plan_.is_bent[node]; }

  // Those that go with corners that are free.
  std::vector<Index> followers(const std::vector<Index>& nodes) const {
    std::vector<Index> result;
    for (Index i = 0; i < plan_.mid_nodes.count(); ++i)
      if (!is_fixed_[plan_.mid_nodes.node(i)] && follows(plan_.mid_nodes.node(i)) &&
          std::ranges::any_of(plan_.mid_nodes.corners(i), [&](Index corner) {
            return std::ranges::binary_search(nodes, corner);
          }))
        result.push_back(i);
    return result;
  }

  // Fixes the nodes that slid beyond their surfaces; returns their number.
  Index hold_nodes_off_surface(const RowMatrix& slides) {
    std::vector<Index> off;  // ascending
    for (Index i = 0; i < slides.rows(); ++i)
      if (slides.row(i) != slides_.row(i) &&
          !options_.sliding->is_within(i, slides.row(i).transpose())) {
        is_fixed_[options_.sliding->nodes[i]] = 1;
        off.push_back(options_.sliding->nodes[i]);
      }
    for (Index i = 0; !off.empty() && i < plan_.mid_nodes.count(); ++i)
      if (std::ranges::binary_search(off, plan_.mid_nodes.node(i)))
        for (const Index corner : plan_.mid_nodes.corners(i)) is_fixed_[corner] = 1;
    return std::ssize(off);
  }

  const Mesh& mesh_;
  const Orientation& orientation_;
  const UntangleOptions& options_;
  NodeCells incidence_;
  std::vector<char> is_fixed_;
  Points positions_;
  RowMatrix slides_;  ///< of SlidingNodes::nodes
  RepairPlan plan_;
  Orientation orientation_of_corners_;
  /// with_linear_cells where the repair began: with cells that sliding bends taken out it fails
  /// where this one succeeds.
  std::optional<Mesh> linear_;
  Work work_;
};

}  // namespace

UntangleResult untangle(const Mesh& mesh, const Points& positions,
                        const std::vector<char>& is_fixed, const Orientation& orientation,
                        const UntangleOptions& options) {
  check_sizes(mesh, positions, is_fixed);
  const Stopwatch watch;
  UntangleResult result{positions, options.sliding ? options.sliding->slides : RowMatrix(), {}};
  UntangleReport& report = result.report;
  report.validity = check_validity(mesh, positions, orientation);
  report.before = report.validity.invalid;
  const auto repair_from = [&](const Points& start, RepairPlan plan = {}) {
    Repair repair(mesh, {start, result.slides, is_fixed}, orientation, options, std::move(plan));
    repair.run(report);
    result.positions = repair.positions();
    result.slides = repair.slides();
  };
  // Repairs the mesh of the corners alone, with which other nodes go; returns whether no cell of it
  // is left that a move of its nodes may help.
  const auto repair_corners = [&](Points& at) {
    const Mesh corners = corners_alone(mesh);
    const Orientation of_corners = orientation_of_corners(mesh, orientation);
    report.validity = check_validity(corners, at, of_corners);
    Repair repair(corners, {at, result.slides, is_fixed}, of_corners, options,
                  {.mid_nodes = MidNodes(mesh, at),
                   .is_bent = std::vector<char>(std::size_t(mesh.node_count()), 0),
                   .most_work = kAttemptWork});
    repair.run(report);
    at = repair.positions();
    result.slides = repair.slides();
    return repair.is_done(report);
  };
  if (mesh.is_of_finite_volumes && report.before > 0) {
    const UntangleReport first = report;
    result.positions =
        mend_volumes(mesh, positions, is_fixed, orientation, report.validity.invalid_cells);
    report.validity = check_validity(mesh, result.positions, orientation);
    const auto moves = (result.positions - positions).rowwise().squaredNorm().array() > 0;
    report.moved_nodes = moves.count();
    // Sound volumes may be turned over: what gives cells their shapes back makes them sound, too.
    if (std::vector<Index> turned = cells_turned_over(mesh, positions, orientation);
        !turned.empty()) {
      UntangleResult mended = result;
      report = first;
      repair_from(positions, {.others = std::move(turned), .most_work = kAttemptWork});
      if (report.validity.invalid > 0) result = std::move(mended);
    }
  }
  // Second-order cells with straight edges are valid where the cells of their corners are. These
  // are repaired first, as cells of first order, for a fifth to a thirtieth of the work; then, with
  // straight edges, what is left beside curved surfaces, by all samples, with an eighth of the
  // unknowns. Edges bend where that is not enough: first from there, if fewer cells are left, then
  // from the start. Where the corners find no room, straight edges have none.
  const Points start = result.positions;
  std::vector<char> is_held_fast = is_fixed;
  if (options.sliding)
    for (const Index node : options.sliding->nodes) is_held_fast[node] = 0;
  const auto is_free = [&](Index node) { return !is_held_fast[node]; };
  const bool may_repair = std::ranges::any_of(report.validity.invalid_cells, [&](Index c) {
    return !is_held(mesh, start, is_held_fast, orientation, c);
  });
  if (const MidNodes mid_nodes = may_repair ? MidNodes(mesh, start) : MidNodes();
      mid_nodes.count() > 0) {
    UntangleResult other = result;
    std::vector<char> is_bent(mesh.node_count(), 0);
    Points straight = start;
    straighten(mesh, mid_nodes, is_fixed, straight);
    const bool is_sound_by_corners = repair_corners(straight);
    report.validity = check_validity(mesh, straight, orientation);
    mark_bent(mesh, mid_nodes, report.validity.invalid_cells, is_free, is_bent);
    for (Index node = 0; node < mesh.node_count(); ++node)
      if (is_bent[node]) straight.row(node) = start.row(node);
    report.validity = check_validity(mesh, straight, orientation);
    result.positions = straight;
    const auto left = [](const UntangleResult& one) { return one.report.validity.invalid; };
    if (is_sound_by_corners)
      repair_from(straight, {.mid_nodes = MidNodes(mesh, straight),
                             .is_bent = std::move(is_bent),
                             .most_work = kAttemptWork});
    if (is_sound_by_corners && left(result) > 0 && left(result) < left(other))
      repair_from(result.positions, {.most_work = kAttemptWork});
    if (left(result) > 0) {
      std::swap(result, other);
      if (options.may_bend_all)
        repair_from(result.positions);
      else
        report.fell_short = other.report.fell_short;
      if (left(other) < left(result)) std::swap(result, other);
    }
  } else if (report.validity.invalid > 0 || !options.poor_cells.empty()) {
    repair_from(result.positions);
  }
  report.after = report.validity.invalid;
  report.max_move = (result.positions - positions).rowwise().norm().maxCoeff();
  report.seconds = watch.seconds();
  return result;
}

}  // namespace cadmorph
