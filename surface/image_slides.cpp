#include "surface/image_slides.h"

#include <algorithm>

#include "surface/ids.h"

namespace cadmorph {
namespace {

// Of means over nodes with several images, as where sides of a sector meet.
constexpr int kSweeps = 20;

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
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (const auto& [from, to, turn] : twins_) {
      if (from < 0 || to < 0) continue;
      const Eigen::Matrix<double, 3, 2> along = tangents(from), there = tangents(to);
      const Eigen::Vector3d way = (along * steps.row(from).transpose() +
                                   turn.transpose() * there * steps.row(to).transpose()) /
                                  2;
      steps.row(from) = way.transpose() * along;
      steps.row(to) = (turn * way).transpose() * there;
    }
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
