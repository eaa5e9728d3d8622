#include "apps/pipeline/nearest_face.h"

namespace cadmorph {

Eigen::Vector3d centre_of(std::span<const Index> nodes, const Points& positions) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Index node : nodes) sum += positions.row(node).transpose();
  return sum / static_cast<double>(nodes.size());
}

NearestFace::NearestFace(const Boundary& boundary, const IdVector<FacetId, FaceId>& facet_face,
                         const Points& positions) {
  std::vector<FacetId> facets;
  for (const FacetId f : facet_face.ids()) {
    if (facet_face[f] < 0) continue;
    facets.push_back(f);
    faces_.push_back(facet_face[f]);
  }
  if (facets.empty()) return;
  RowMatrix centres(facets.size(), 3);
  for (std::size_t i = 0; i < facets.size(); ++i)
    centres.row(i) = centre_of(boundary.facet(facets[i]), positions).transpose();
  tree_.emplace(centres);
}

FaceId NearestFace::operator()(const Eigen::Vector3d& x) const {
  return tree_ ? faces_[tree_->nearest(x.data(), 1).front().index] : FaceId();
}

}  // namespace cadmorph
