#include "surface/image_slides.h"

#include <algorithm>
#include <utility>

#include "surface/ids.h"

namespace cadmorph {
namespace {

// Of means over nodes with several images, as where sides of a sector meet.
constexpr int kSweeps = 20;
constexpr double kSame = 1e-15;  // of a way

}  // namespace

ImageSlides::ImageSlides(const std::vector<ImagePair>& images, const Boundary& boundary,
                         const SlidingNodes& sliding)
    : sliding_(sliding) {
  const auto find = [&](RowId row) -> Index {
    const Index node = boundary.nodes[row];
    const auto found = std::ranges::lower_bound(sliding.nodes, node);
    return found != sliding.nodes.end() && *found == node ? found - sliding.nodes.begin() : -1;
  };
  for (const ImagePair& pair : images)
    for (std::size_t i = 0; i < pair.from.size(); ++i) {
      const Twins twins{find(pair.from[i]), find(pair.to[i]), pair.after.linear};
      if (twins.from != twins.to) twins_.push_back(twins);
    }
}

void ImageSlides::average(RowMatrix& steps) const {
  const auto tangents = [&](Index i) { return sliding_.at(i, sliding_.slides.row(i)).tangents; };
  bool has_changed = true;
  for (int sweep = 0; sweep < kSweeps && std::exchange(has_changed, false); ++sweep)
    for (const auto& [from, to, turn] : twins_) {
      if (from < 0 || to < 0 || (steps.row(from).isZero(0) && steps.row(to).isZero(0))) continue;
      const Eigen::Matrix<double, 3, 2> along = tangents(from), there = tangents(to);
      const Eigen::Vector3d way = (along * steps.row(from).transpose() +
                                   turn.transpose() * there * steps.row(to).transpose()) /
                                  2;
      const Eigen::RowVector2d near = way.transpose() * along,
                               far = (turn * way).transpose() * there;
      has_changed |= (near - steps.row(from)).norm() > kSame * way.norm() ||
                     (far - steps.row(to)).norm() > kSame * way.norm();
      steps.row(from) = near;
      steps.row(to) = far;
    }
}

std::vector<Index> ImageSlides::twins() const {
  std::vector<Index> result(sliding_.nodes.size(), -1);
  for (const Twins& twins : twins_) {
    if (twins.from >= 0) result[twins.from] = twins.to;
    if (twins.to >= 0) result[twins.to] = twins.from;
  }
  return result;
}

std::vector<Index> ImageSlides::unpaired() const {
  std::vector<Index> count(sliding_.nodes.size(), 0);
  for (const Twins& twins : twins_)
    for (const Index i : {twins.from, twins.to})
      if (i >= 0) ++count[i];
  std::vector<char> is_bound(count.size(), 0);
  for (const auto& [from, to, turn] : twins_) {
    const bool is_pair = from >= 0 && to >= 0 && count[from] == 1 && count[to] == 1;
    for (const Index i : {from, to})
      if (i >= 0 && !is_pair) is_bound[i] = 1;
  }
  std::vector<Index> result;
  for (std::size_t i = 0; i < is_bound.size(); ++i)
    if (is_bound[i]) result.push_back(static_cast<Index>(i));
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
