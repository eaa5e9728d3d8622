#include "surface/motion_path.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <queue>
#include <set>
#include <utility>

#include "core/errors.h"
#include "core/least_squares.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector7d = Eigen::Matrix<double, 7, 1>;

// By a smaller turn, steps along chords are less than 4 % of the radius off the arc.
constexpr double kLeastTurn = std::numbers::pi / 6;
// A fitted similarity says something when it leaves less than half of what a translation leaves: of
// a square that is sheared or stretched one way it leaves 0.7.
constexpr double kGoodFit = 0.5;
// A patch moves as it is when the displacements differ by less than a quarter of their size, or by
// less than a thousandth of the patch.
constexpr double kSameMove = 0.25, kSameSize = 1e-3;
// Weight of smoothness, per edge of a facet; a patch's own motion has weight 1, per node. Patches
// of known motion keep it, except near those of another motion. The tests of paths pass with a
// tenth and ten times as much, and with half and twice of kSameMove.
constexpr double kSmoothness = 0.01;
// Keeps the system definite where a part of the surface touches no patch of known motion: far below
// kSmoothness, far above rounding.
constexpr double kLeastWeight = 1e-9;
// Below this the series of the exponential's integral is exact to rounding.
constexpr double kSmall = 1e-4;

// What a patch of facets does.
struct Patch {
  std::vector<RowId> rows;     ///< its nodes, ascending
  std::set<Index> neighbours;  ///< patches that share a node
  Matrix3d rotation;
  double log_scale = 0;
  Vector3d from, to;  ///< mean positions
  bool is_turning = false, is_moving_as_it_is = false;
  Vector3d turn = Vector3d::Zero();  ///< rotation vector, of the branch its neighbours are on
};

Matrix3d cross_matrix(const Vector3d& w) {
  Matrix3d result;
  result << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
  return result;
}

// The map x -> exp(s A) x + V(s) u of the generator (w, log k, u), A = log k + [w]: by the
// eigenvalues of A, which are log k along w and log k +- i |w| across.
struct Motion {
  Motion(const Vector7d& generator, double s) {
    const Vector3d w = generator.head<3>(), u = generator.tail<3>();
    const double angle = w.norm(), log_scale = generator[3];
    const Vector3d axis = angle > 0 ? Vector3d(w / angle) : Vector3d::UnitZ();
    linear = std::exp(s * log_scale) * Eigen::AngleAxisd(s * angle, axis).toRotationMatrix();
    shift = integral(axis, angle, log_scale, s) * u;
  }

  // V(s), the integral of exp(t A) over t in [0, s].
  static Matrix3d integral(const Vector3d& axis, double angle, double log_scale, double s) {
    const std::complex<double> along = mean_growth(log_scale * s) * s,
                               across = mean_growth({log_scale * s, angle * s}) * s;
    const Matrix3d on_axis = axis * axis.transpose();
    return along.real() * on_axis + across.real() * (Matrix3d::Identity() - on_axis) +
           across.imag() * cross_matrix(axis);
  }

  // (exp(z) - 1) / z.
  static std::complex<double> mean_growth(std::complex<double> z) {
    if (std::abs(z) < kSmall) return 1.0 + z / 2.0 + z * z / 6.0 + z * z * z / 24.0;
    return (std::exp(z) - 1.0) / z;
  }

  Vector3d operator()(const Vector3d& x) const { return linear * x + shift; }
  Vector3d back(const Vector3d& x) const { return linear.inverse() * (x - shift); }

  Matrix3d linear;
  Vector3d shift;
};

// The similarity of least squares (Umeyama 1991), and whether the patch turns by it, or moves as it
// is.
void fit(Patch& patch, const Points& start, const Points& end) {
  const double count = static_cast<double>(patch.rows.size());
  patch.from = patch.to = Vector3d::Zero();
  for (const RowId row : patch.rows) {
    patch.from += start.row(row).transpose() / count;
    patch.to += end.row(row).transpose() / count;
  }
  Matrix3d covariance = Matrix3d::Zero();
  double size = 0, size_after = 0, apart = 0, moved = 0;  // sums of squares
  for (const RowId row : patch.rows) {
    const Vector3d a = start.row(row).transpose() - patch.from;
    const Vector3d b = end.row(row).transpose() - patch.to;
    covariance += b * a.transpose();
    size += a.squaredNorm();
    size_after += b.squaredNorm();
    apart += (b - a).squaredNorm();
    moved += (end.row(row) - start.row(row)).squaredNorm();
  }
  const RotationFit best = fit_rotation(covariance);
  patch.rotation = best.rotation;
  const double scale = size > 0 ? best.singular_values.sum() / size : 1;
  patch.is_moving_as_it_is =
      apart <= std::max(kSameMove * kSameMove * moved, kSameSize * kSameSize * size);
  if (!(scale > 0) || best.singular_values[1] < kSameSize * best.singular_values[0]) return;
  patch.log_scale = std::log(scale);
  const double left = size_after - scale * scale * size;
  patch.is_turning =
      Eigen::AngleAxisd(patch.rotation).angle() > kLeastTurn && left < kGoodFit * kGoodFit * apart;
}

// Number of a patch for each facet -> the patches with their nodes.
std::vector<Patch> make_patches(const Boundary& boundary,
                                const IdVector<FacetId, FaceId>& numbers) {
  std::map<FaceId, Index> position;
  std::vector<Patch> patches;
  IdVector<RowId, std::vector<Index>> at_node(boundary.nodes.size());
  for (const FacetId f : numbers.ids()) {
    const auto [it, is_new] = position.try_emplace(numbers[f], static_cast<Index>(patches.size()));
    if (is_new) patches.emplace_back();
    for (const Index node : boundary.facet(f)) {
      const RowId row = row_of(boundary, node);
      auto& known = at_node[row];
      if (std::ranges::find(known, it->second) != known.end()) continue;
      for (const Index other : known) {
        patches[other].neighbours.insert(it->second);
        patches[it->second].neighbours.insert(other);
      }
      known.push_back(it->second);
      patches[it->second].rows.push_back(row);
    }
  }
  return patches;
}

// The rotation vector of a rotation that is nearest to another: a half-turn one way or the other.
Vector3d rotation_vector(const Matrix3d& rotation, const Vector3d& near) {
  const Eigen::AngleAxisd turn(rotation);
  const Vector3d plain = turn.angle() * turn.axis();
  const Vector3d other = (turn.angle() - 2 * std::numbers::pi) * turn.axis();
  return (plain - near).norm() <= (other - near).norm() ? plain : other;
}

// Rotation vectors that agree between patches that turn alike: from each patch to the unvisited
// neighbour whose rotation is nearest first.
void choose_turns(std::vector<Patch>& patches) {
  using Link = std::tuple<double, Index, Index>;  // angle between the rotations, from, to
  std::vector<char> is_done(patches.size(), 0);
  for (Index root = 0; root < static_cast<Index>(patches.size()); ++root) {
    if (!patches[root].is_turning || is_done[root]) continue;
    std::priority_queue<Link, std::vector<Link>, std::greater<>> links;
    links.emplace(0, root, root);
    while (!links.empty()) {
      const auto [angle, from, to] = links.top();
      links.pop();
      if (std::exchange(is_done[to], 1)) continue;
      patches[to].turn = rotation_vector(patches[to].rotation, patches[from].turn);
      for (const Index next : patches[to].neighbours)
        if (patches[next].is_turning && !is_done[next]) {
          const Matrix3d between = patches[to].rotation.transpose() * patches[next].rotation;
          links.emplace(Eigen::AngleAxisd(between).angle(), to, next);
        }
    }
  }
}

Vector7d generator(const Patch& patch) {
  Vector7d result = Vector7d::Zero();
  if (!patch.is_turning) {
    result.tail<3>() = patch.to - patch.from;
    return result;
  }
  const double angle = patch.turn.norm();
  const Matrix3d linear = std::exp(patch.log_scale) * patch.rotation;
  const Matrix3d v = Motion::integral(patch.turn / angle, angle, patch.log_scale, 1);
  result << patch.turn, patch.log_scale, v.inverse() * (patch.to - linear * patch.from);
  return result;
}

// Generators of all nodes: near to those of their patches, smooth along the facets' edges.
RowMatrix smooth_generators(const Boundary& boundary, const std::vector<Patch>& patches) {
  const Index count = static_cast<Index>(boundary.nodes.size());
  Eigen::VectorXd weights = Eigen::VectorXd::Constant(count, kLeastWeight);
  RowMatrix right = RowMatrix::Zero(count, 7);
  for (const Patch& patch : patches) {
    if (!patch.is_turning && !patch.is_moving_as_it_is) continue;
    const Vector7d g = generator(patch);
    for (const RowId row : patch.rows) {
      weights[row] += 1;
      right.row(row) += g.transpose();
    }
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (Index f = 0; f < boundary.facet_count(); ++f) {
    const auto nodes = boundary.facet(f);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const RowId a = row_of(boundary, nodes[i]);
      const RowId b = row_of(boundary, nodes[(i + 1) % nodes.size()]);
      entries.emplace_back(a, b, -kSmoothness);
      entries.emplace_back(b, a, -kSmoothness);
      weights[a] += kSmoothness;
      weights[b] += kSmoothness;
    }
  }
  for (Index i = 0; i < count; ++i) entries.emplace_back(i, i, weights[i]);
  Eigen::SparseMatrix<double> system(count, count);
  system.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(system);
  if (solver.info() != Eigen::Success)
    throw SolverError("the motion of the surface on the way can't be smoothed");
  return solver.solve(Eigen::MatrixXd(right));
}

}  // namespace

MotionPath::MotionPath(const Boundary& boundary, const Points& start, const Points& end,
                       const IdVector<FacetId, FaceId>& patch)
    : start_(start), end_(end) {
  const Index count = static_cast<Index>(boundary.nodes.size());
  if (start.rows() != count || end.rows() != count ||
      static_cast<Index>(patch.size()) != boundary.facet_count())
    throw InvalidInputError("a motion path needs two positions a surface node, a patch a facet");
  std::vector<Patch> patches = make_patches(boundary, patch);
  for (Patch& p : patches) fit(p, start, end);
  if (std::ranges::none_of(patches, &Patch::is_turning)) return;
  choose_turns(patches);
  generators_ = smooth_generators(boundary, patches);
  remainder_.resize(count, 3);
  for (Index i = 0; i < count; ++i) {
    const Motion whole(generators_.row(i).transpose(), 1);
    remainder_.row(i) = whole.back(end.row(i).transpose()).transpose() - start.row(i);
  }
}

Points MotionPath::operator()(double s) const {
  if (!is_turning()) return start_ + s * (end_ - start_);
  Points result(start_.rows(), 3);
  for (Index i = 0; i < result.rows(); ++i) {
    const Vector3d x = (start_.row(i) + s * remainder_.row(i)).transpose();
    result.row(i) = Motion(generators_.row(i).transpose(), s)(x).transpose();
  }
  return result;
}

}  // namespace cadmorph
