#include "surface/image_slides.h"

#include <algorithm>
#include <utility>

#include "surface/ids.h"

namespace cadmorph {
namespace {

// Of means over images whose tangents differ: where they agree, the second one changes nothing. The
// tests of images pass with 2 or 40.
constexpr int kSweeps = 20;
constexpr double kSame = 1e-15;  // of a way: some roundings

}  // namespace

ImageSlides::ImageSlides(const std::vector<ImagePair>& images, const Boundary& boundary,
                         const SlidingNodes& sliding)
    : sliding_(sliding) {
  const auto find = [&](RowId row) { return sliding.find(boundary.nodes[row]); };
  for (const ImagePair& pair : images)
    for (std::size_t i = 0; i < pair.from.size(); ++i) {
      const Twins twins{find(pair.from[i]), find(pair.to[i]), pair.after.linear};
      if (twins.from != twins.to) twins_.push_back(twins);
    }
  find_groups();
}

void ImageSlides::find_groups() {
  const std::size_t count = sliding_.nodes.size();
  std::vector<std::vector<Member>> beside(count);  // by a node: its images, turned from it
  is_bound_.assign(count, 0);
  for (const auto& [from, to, turn] : twins_) {
    if (from >= 0) is_bound_[from] |= to < 0;
    if (to >= 0) is_bound_[to] |= from < 0;
    if (from < 0 || to < 0) continue;
    beside[from].push_back({to, turn});
    beside[to].push_back({from, turn.transpose()});
  }
  std::vector<char> is_found(count, 0);
  for (std::size_t first = 0; first < count; ++first) {
    if (beside[first].empty() || is_found[first]) continue;
    Group group{{static_cast<Index>(first), Eigen::Matrix3d::Identity()}};
    is_found[first] = 1;
    for (std::size_t k = 0; k < group.size(); ++k)
      for (const Member& next : beside[group[k].node])
        if (!std::exchange(is_found[next.node], 1))
          group.push_back({next.node, next.turn * group[k].turn});
    const bool is_bound =
        std::ranges::any_of(group, [&](const Member& one) { return is_bound_[one.node]; });
    for (const Member& one : group) is_bound_[one.node] = is_bound;
    groups_.push_back(std::move(group));
  }
}

void ImageSlides::average(RowMatrix& steps) const {
  bool has_changed = true;
  for (int sweep = 0; sweep < kSweeps && std::exchange(has_changed, false); ++sweep)
    for (const Group& group : groups_) {
      if (std::ranges::all_of(group,
                              [&](const Member& one) { return steps.row(one.node).isZero(0); }))
        continue;
      std::vector<Eigen::Matrix<double, 3, 2>> along;  // seen from the first
      Eigen::Vector3d way = Eigen::Vector3d::Zero();
      for (const auto& [node, turn] : group) {
        along.push_back(turn.transpose() * sliding_.at(node, sliding_.slides.row(node)).tangents);
        way += along.back() * steps.row(node).transpose() / static_cast<double>(group.size());
      }
      for (std::size_t k = 0; k < group.size(); ++k) {
        const Eigen::RowVector2d step = way.transpose() * along[k];
        has_changed |= (step - steps.row(group[k].node)).norm() > kSame * way.norm();
        steps.row(group[k].node) = step;
      }
    }
}

std::vector<std::vector<Index>> ImageSlides::groups() const {
  std::vector<std::vector<Index>> result;
  for (const Group& group : groups_) {
    if (is_bound_[group.front().node]) continue;
    std::vector<Index>& nodes = result.emplace_back();
    for (const Member& one : group) nodes.push_back(one.node);
  }
  return result;
}

std::vector<Index> ImageSlides::bound() const {
  std::vector<Index> result;
  for (std::size_t i = 0; i < is_bound_.size(); ++i)
    if (is_bound_[i]) result.push_back(static_cast<Index>(i));
  return result;
}

void ImageSlides::hold_unlike(const RowMatrix& start, double tolerance, RowMatrix& slides) const {
  const auto stays = [&](Index i) { return i < 0 || slides.row(i) == start.row(i); };
  const auto way = [&](Index i) -> Eigen::Vector3d {
    if (stays(i)) return Eigen::Vector3d::Zero();
    return sliding_.at(i, slides.row(i)).point - sliding_.at(i, start.row(i)).point;
  };
  for (bool has_any = true; has_any;) {
    has_any = false;
    for (const auto& [from, to, turn] : twins_) {
      if ((stays(from) && stays(to)) || (turn * way(from) - way(to)).norm() <= tolerance) continue;
      has_any = true;
      for (const Index i : {from, to})
        if (i >= 0) slides.row(i) = start.row(i);
    }
  }
}

}  // namespace cadmorph
