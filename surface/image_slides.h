#pragma once

#include "core/boundary.h"
#include "core/sliding_nodes.h"
#include "surface/image_pairs.h"

namespace cadmorph {

/// The nodes of sides that are images of each other, where they slide: those of a periodic sector,
/// of a plate's two faces with one mesh.
class ImageSlides {
 public:
  /// `sliding` must outlive it; rows of `images` as in `boundary`.
  ImageSlides(const std::vector<ImagePair>& images, const Boundary& boundary,
              const SlidingNodes& sliding);

  /// Steps from the places where the nodes are (K x 2, as SlidingNodes::slides): images take the
  /// mean of what both ask for.
  void average(RowMatrix& steps) const;

  /// The nodes (as in SlidingNodes::nodes) that are images of each other, where all of these can
  /// slide: the planes of a swept mesh, one above the other, make groups of as many as there are.
  std::vector<std::vector<Index>> groups() const;

  /// Those with an image that can't slide, ascending.
  std::vector<Index> bound() const;

  /// Puts images back to `start` (K x 2) whose ways from there to `slides` are none of each other
  /// within `tolerance`, in the mesh's unit, and those of nodes that can't slide.
  void hold_unlike(const RowMatrix& start, double tolerance, RowMatrix& slides) const;

 private:
  struct Twins {
    Index from, to;        ///< in SlidingNodes::nodes, -1: not among them
    Eigen::Matrix3d turn;  ///< of a way of the first into that of the other
  };

  // Images of each other.
  struct Member {
    Index node;
    Eigen::Matrix3d turn;  ///< of a way of the group's first into this one's
  };
  using Group = std::vector<Member>;
  void find_groups();

  const SlidingNodes& sliding_;
  std::vector<Twins> twins_;
  std::vector<Group> groups_;   ///< of those that can slide
  std::vector<char> is_bound_;  ///< as SlidingNodes::nodes: whether an image can't
};

}  // namespace cadmorph
