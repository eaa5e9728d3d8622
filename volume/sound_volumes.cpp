#include "volume/sound_volumes.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "core/finite_volumes.h"
#include "volume/node_cells.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// Over the unsound cells, each with what became unsound in the last. The tests pass with half or
// twice of kRounds, kLastStep and kEnough, and with twice kFirstStep; with half, one fails.
constexpr int kRounds = 10;
// Steps of the search: the first of the mean distance to the cell's nodes, half of the way to them,
// the last of the first: less than a hundredth of that way.
constexpr double kFirstStep = 0.5;
constexpr double kLastStep = 1.0 / 64;
// It ends after this many passes over all cells, or on a small mesh evaluations of a cell: what
// takes more is wrecked.
constexpr double kMostPasses = 50, kSmallWork = 3e6;
// Cells that are this sound are sound enough: an eighth of a cube's 1/6, twenty times the
// thousandth of snapped wall cells, which are made no worse, but need not be better than they were.
constexpr double kEnough = 0.02;

class Mender {
 public:
  Mender(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed,
         const Orientation& orientation)
      : mesh_(mesh),
        positions_(positions),
        is_fixed_(is_fixed),
        orientation_(orientation),
        incidence_(mesh) {}

  // Returns the cells that stay unsound, of those and of those round them.
  Index run(const std::vector<Index>& unsound) {
    std::set<Index> left(unsound.begin(), unsound.end());
    for (int round = 0; round < kRounds && !left.empty() && !is_over(); ++round) {
      std::set<Index> touched;
      for (const Index c : left)
        for (const Index node : mesh_.cell(c))
          if (!is_fixed_[node] && !is_over() && improve(node, c))
            for (const Index other : incidence_.cells(node)) touched.insert(other);
      if (touched.empty()) break;
      for (const Index c : touched)
        if (soundness(c, positions_) > 0)
          left.erase(c);
        else
          left.insert(c);
    }
    return std::ssize(left);
  }

  Points take() { return std::move(positions_); }

 private:
  bool is_over() const {
    return double(evaluations_) > std::max(kMostPasses * double(mesh_.cell_count()), kSmallWork);
  }

  double soundness(Index c, const Points& points) {
    ++evaluations_;
    if (!finite_volume::is_volume(mesh_, mesh_.types[c])) return kEnough;
    return finite_volume::soundness(mesh_, points, c,
                                    orientation_[static_cast<std::size_t>(mesh_.types[c])]);
  }

  // A compass search. Returns whether the node moved.
  bool improve(Index node, Index c) {
    const auto cells = incidence_.cells(node);
    std::vector<double> enough;
    for (const Index other : cells)
      enough.push_back(std::clamp(soundness(other, mesh_.points), 0.0, kEnough));
    // By how much the cells at the node are sounder than they have to be, the least of them.
    const auto margin = [&] {
      double least = 1;
      for (std::size_t i = 0; i < cells.size(); ++i)
        least = std::min(least, soundness(cells[i], positions_) - enough[i]);
      return least;
    };
    double best = margin();
    const Vector3d start = positions_.row(node);
    double size = 0;
    for (const Index other : mesh_.cell(c))
      size += (positions_.row(other) - start.transpose()).norm();
    const double first = kFirstStep * size / static_cast<double>(mesh_.cell(c).size());
    for (double step = first; step >= kLastStep * first && best < 0 && !is_over();) {
      const Vector3d from = positions_.row(node);
      Vector3d to = from;
      for (const Vector3d& way : directions()) {
        positions_.row(node) = from + step * way;
        if (const double found = margin(); found > best) {
          best = found;
          to = positions_.row(node);
        }
      }
      positions_.row(node) = to;
      if (to == from) step /= 2;
    }
    return positions_.row(node) != start.transpose();
  }

  // To the faces and corners of a cube.
  static const std::array<Vector3d, 14>& directions() {
    static const auto all = [] {
      std::array<Vector3d, 14> ways;
      for (int a = 0; a < 3; ++a) {
        ways[2 * a] = Vector3d::Unit(a);
        ways[2 * a + 1] = -Vector3d::Unit(a);
      }
      for (int i = 0; i < 8; ++i)
        ways[6 + i] = Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1).normalized();
      return ways;
    }();
    return all;
  }

  const Mesh& mesh_;
  Points positions_;
  const std::vector<char>& is_fixed_;
  const Orientation& orientation_;
  NodeCells incidence_;
  Index evaluations_ = 0;  ///< of soundness
};

}  // namespace

Points mend_volumes(const Mesh& mesh, const Points& positions, const std::vector<char>& is_fixed,
                    const Orientation& orientation, const std::vector<Index>& unsound) {
  Mender mender(mesh, positions, is_fixed, orientation);
  return mender.run(unsound) < std::ssize(unsound) ? mender.take() : positions;
}

}  // namespace cadmorph
