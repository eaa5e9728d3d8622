#include "core/kd_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>

#include "core/errors.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

bool is_closer(const Neighbour& a, const Neighbour& b) {
  return a.squared_distance != b.squared_distance ? a.squared_distance < b.squared_distance
                                                  : a.index < b.index;
}

// The k nearest, as a heap with the farthest on top. nanoflann offers only points nearer than
// worstDist(); the next larger number lets equal distances through, so that their index decides.
class NearestSet {
 public:
  explicit NearestSet(Index k) : k_(static_cast<std::size_t>(k)) { heap_.reserve(k_); }

  std::size_t size() const { return heap_.size(); }
  bool full() const { return heap_.size() == k_; }

  double worstDist() const {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    return full() ? std::nextafter(heap_.front().squared_distance, kInfinity) : kInfinity;
  }

  bool addPoint(double squared_distance, Index index) {
    const Neighbour found{index, squared_distance};
    if (full()) {
      if (!is_closer(found, heap_.front())) return true;
      std::pop_heap(heap_.begin(), heap_.end(), is_closer);
      heap_.pop_back();
    }
    heap_.push_back(found);
    std::push_heap(heap_.begin(), heap_.end(), is_closer);
    return true;
  }

  std::vector<Neighbour> sorted() && {
    std::sort_heap(heap_.begin(), heap_.end(), is_closer);
    return std::move(heap_);
  }

 private:
  std::size_t k_;
  std::vector<Neighbour> heap_;
};

class RadiusSet {
 public:
  explicit RadiusSet(double squared_radius) : squared_radius_(squared_radius) {}

  std::size_t size() const { return found_.size(); }
  bool full() const { return true; }
  double worstDist() const {
    return std::nextafter(squared_radius_, std::numeric_limits<double>::infinity());
  }

  bool addPoint(double squared_distance, Index index) {
    found_.push_back({index, squared_distance});
    return true;
  }

  std::vector<Neighbour> sorted() && {
    std::sort(found_.begin(), found_.end(), is_closer);
    return std::move(found_);
  }

 private:
  double squared_radius_;
  std::vector<Neighbour> found_;
};

struct RowCloud {
  RowMatrix points;

  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points.rows()); }
  double kdtree_get_pt(Index row, std::size_t column) const {
    return points(row, static_cast<Index>(column));
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

template <int D>
using NanoTree = nanoflann::KDTreeSingleIndexAdaptor<
    nanoflann::L2_Simple_Adaptor<double, RowCloud, double, Index>, RowCloud, D, Index>;

}  // namespace

struct KdTree::Impl {
  virtual ~Impl() = default;
  virtual void find(const double* query, NearestSet& found) const = 0;
  virtual void find(const double* query, RadiusSet& found) const = 0;
  virtual Index size() const = 0;

  template <int D>
  struct Of;
  static std::unique_ptr<Impl> make(const RowMatrix& points);
};

template <int D>
struct KdTree::Impl::Of final : KdTree::Impl {
  explicit Of(const RowMatrix& points)
      : cloud{points}, tree(static_cast<int>(points.cols()), cloud, {10}) {
    tree.buildIndex();
  }
  void find(const double* query, NearestSet& found) const override {
    tree.findNeighbors(found, query, {});
  }
  void find(const double* query, RadiusSet& found) const override {
    tree.findNeighbors(found, query, {});
  }
  Index size() const override { return cloud.points.rows(); }

  RowCloud cloud;
  NanoTree<D> tree;
};

std::unique_ptr<KdTree::Impl> KdTree::Impl::make(const RowMatrix& points) {
  if (points.cols() == 2) return std::make_unique<Of<2>>(points);
  if (points.cols() == 3) return std::make_unique<Of<3>>(points);
  return std::make_unique<Of<-1>>(points);
}

KdTree::KdTree(const RowMatrix& points) {
  if (points.size() == 0) throw InvalidInputError("kd-tree: the point set is empty");
  for (Index i = 0; i < points.rows(); ++i)
    if (!points.row(i).allFinite())
      throw InvalidInputError("kd-tree: point " + std::to_string(i) + " is not finite");
  impl_ = Impl::make(points);
}

KdTree::~KdTree() = default;
KdTree::KdTree(KdTree&&) noexcept = default;
KdTree& KdTree::operator=(KdTree&&) noexcept = default;

std::vector<Neighbour> KdTree::nearest(const double* query, Index k) const {
  if (k < 1) return {};
  NearestSet found(std::min(k, size()));
  impl_->find(query, found);
  return std::move(found).sorted();
}

std::vector<Neighbour> KdTree::within(const double* query, double radius) const {
  if (!(radius >= 0)) return {};
  RadiusSet found(radius * radius);
  impl_->find(query, found);
  return std::move(found).sorted();
}

Index KdTree::size() const { return impl_->size(); }

double squared_spacing(const KdTree& tree, const double* point) {
  constexpr Index kNeighbour = 3;  // the nearest may lie across a thin gap
  return tree.nearest(point, kNeighbour + 1).back().squared_distance;
}

Eigen::VectorXd nearest_distances(const RowMatrix& points) {
  if (points.rows() < 2) throw InvalidInputError("nearest distances need at least two points");
  const KdTree tree(points);
  Eigen::VectorXd result(points.rows());
  parallel_for(points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      result(i) = std::sqrt(tree.nearest(points.row(i).data(), 2).back().squared_distance);
  });
  return result;
}

}  // namespace cadmorph
