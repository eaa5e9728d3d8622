#include "core/rbf/point_order.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/kd_tree.h"
#include "core/parallel.h"
#include "core/rbf/box_tree.h"

namespace cadmorph {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A point as far from those before it as half of its neighbours' distance, measured to the third: a
// twin or two do not count. With 0.25 thin sheets do not converge; with 1 the tests pass, and
// canisters of 15,666 and 21,124 centres take as many iterations, or one fewer.
constexpr double kLeaderSpacing = 0.5;
constexpr Index kSpacingNeighbour = 3;

// The distance of every point to the chosen ones, with its maximum in every node of a tree.
class DistanceField {
 public:
  explicit DistanceField(const Points& points)
      : tree_(points, points.rows()),
        distance_(points.rows(), kInfinity),
        maximum_(tree_.nodes().size(), kInfinity) {}

  const BoxTree& tree() const { return tree_; }

  void choose(Index position) {
    distance_[position] = -1;
    update(0, tree_.point(position));
  }

  // Position and squared distance of the farthest point.
  std::pair<Index, double> farthest() const {
    int id = 0;
    while (tree_.nodes()[id].left >= 0) {
      const BoxTree::Node& node = tree_.nodes()[id];
      id = maximum_[node.left] >= maximum_[node.right] ? node.left : node.right;
    }
    const BoxTree::Node& leaf = tree_.nodes()[id];
    const auto found =
        std::max_element(distance_.begin() + leaf.begin, distance_.begin() + leaf.end);
    return {found - distance_.begin(), *found};
  }

 private:
  double update(int id, const double* chosen) {
    const BoxTree::Node& node = tree_.nodes()[id];
    // A box beyond the maximum changes nothing, save that it may hold the chosen point itself.
    if (squared_distance(node, chosen) > maximum_[id]) return maximum_[id];
    if (node.left >= 0)
      return maximum_[id] = std::max(update(node.left, chosen), update(node.right, chosen));
    double largest = -1;
    for (Index i = node.begin; i < node.end; ++i) {
      const double* p = tree_.point(i);
      const double x = p[0] - chosen[0], y = p[1] - chosen[1], z = p[2] - chosen[2];
      distance_[i] = std::min(distance_[i], x * x + y * y + z * z);
      largest = std::max(largest, distance_[i]);
    }
    return maximum_[id] = largest;
  }

  BoxTree tree_;
  std::vector<double> distance_;  // squared; -1 for chosen points
  std::vector<double> maximum_;
};

Index farthest_from_middle(const BoxTree& tree) {
  const BoxTree::Node& root = tree.nodes()[0];
  Eigen::RowVector3d middle;
  for (int d = 0; d < 3; ++d) middle(d) = 0.5 * (root.low[d] + root.high[d]);
  Index best = 0;
  double largest = -1;
  for (Index i = 0; i < tree.size(); ++i) {
    const double distance =
        (Eigen::Map<const Eigen::RowVector3d>(tree.point(i)) - middle).squaredNorm();
    if (distance > largest) {
      largest = distance;
      best = i;
    }
  }
  return best;
}

// Corners of a large simplex: each the farthest from the point, line or plane of those before it.
std::vector<Index> maximal_simplex(const Points& points, int corners) {
  std::vector<Index> result = {0};
  Points offsets = points.rowwise() - points.row(0);
  while (static_cast<int>(result.size()) < corners) {
    Index best = 0;
    offsets.rowwise().squaredNorm().maxCoeff(&best);
    result.push_back(best);
    const Eigen::RowVector3d direction = offsets.row(best).normalized();
    offsets -= (offsets * direction.transpose()) * direction;
  }
  return result;
}

std::vector<char> find_leaders(const Points& points, const std::vector<double>& separation) {
  const KdTree tree{points};
  std::vector<char> is_leader(points.rows());
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto near = tree.nearest(points.row(i).data(), kSpacingNeighbour + 1);
      is_leader[i] = separation[i] >= kLeaderSpacing * std::sqrt(near.back().squared_distance);
    }
  });
  is_leader[0] = true;
  return is_leader;
}

// Followers of each leader (by the leader's position among the leaders), closest first.
std::vector<std::vector<Neighbour>> assign_followers(const Points& points,
                                                     const std::vector<Index>& leaders,
                                                     const std::vector<char>& is_leader) {
  RowMatrix leader_points(static_cast<Index>(leaders.size()), 3);
  for (Index i = 0; i < leader_points.rows(); ++i) leader_points.row(i) = points.row(leaders[i]);
  const KdTree tree(leader_points);
  std::vector<Neighbour> nearest(points.rows());
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      if (!is_leader[i]) nearest[i] = tree.nearest(points.row(i).data(), 1).front();
  });
  std::vector<std::vector<Neighbour>> followers(leaders.size());
  for (Index i = 0; i < points.rows(); ++i)
    if (!is_leader[i]) followers[nearest[i].index].push_back({i, nearest[i].squared_distance});
  for (auto& list : followers)
    std::stable_sort(list.begin(), list.end(), [](const Neighbour& a, const Neighbour& b) {
      return a.squared_distance < b.squared_distance;
    });
  return followers;
}

}  // namespace

PointOrder farthest_point_order(const Points& points) {
  PointOrder result;
  if (points.rows() == 0) return result;
  result.rows.reserve(points.rows());
  result.separation.reserve(points.rows());
  DistanceField field(points);
  Index next = farthest_from_middle(field.tree());
  double squared = kInfinity;
  while (true) {
    result.rows.push_back(field.tree().row(next));
    result.separation.push_back(std::sqrt(squared));
    if (static_cast<Index>(result.rows.size()) == points.rows()) return result;
    field.choose(next);
    std::tie(next, squared) = field.farthest();
  }
}

std::vector<Index> leader_follower_order(const Points& points,
                                         const std::vector<double>& separation, int simplex) {
  const std::vector<char> is_leader = find_leaders(points, separation);
  std::vector<Index> leaders;
  for (Index i = 0; i < points.rows(); ++i)
    if (is_leader[i]) leaders.push_back(i);
  const auto followers = assign_followers(points, leaders, is_leader);

  std::vector<Index> order = maximal_simplex(points, simplex);
  std::vector<char> is_placed(points.rows(), 0);
  for (const Index i : order) is_placed[i] = 1;
  const auto place = [&](Index i) {
    if (!is_placed[i]) order.push_back(i);
  };
  for (std::size_t l = 0; l < leaders.size(); ++l) {
    place(leaders[l]);
    for (const Neighbour& follower : followers[l]) place(follower.index);
  }
  return order;
}

}  // namespace cadmorph
