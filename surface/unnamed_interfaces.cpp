#include "surface/unnamed_interfaces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <optional>
#include <span>

#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "core/kd_tree.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Index kGrain = 1 << 12;  // nodes or cells: most are far from the faces sought
// Of the CAD, to look near them: 0.7 % of the square root of its area apart.
constexpr Index kSamples = 20'000;
// Cosine of the angle between a facet and the CAD at its corners: a chord of a coarse circle turns
// by less, a facet across a rod by more.
constexpr double kSameWay = 0.5;
// Of a CAD face's area, that facets make up: a coarse circle's are two thirds.
constexpr double kMost = 0.5;
// A CAD face lies inside of the mesh where so many of its samples do, and on another face where
// they are that near, in parts of the model's diagonal: ten times what files keep.
constexpr double kInside = 0.5, kSamePlace = 1e-6;
constexpr int kProbes = 8;        // in each direction of a face: the shares asked for are halves
constexpr Index kFewSamples = 8;  // about a place, looked at first to save time

// A node on a CAD face.
struct Lies {
  FaceId face;
  Vector2d uv;
  double distance;
};

// A face of a cell on a CAD face.
struct Candidate {
  InnerFace face;
  FaceId on;
  double area;
};

class Search {
 public:
  Search(const CadModel& base, const Mesh& mesh, const CellNeighbours& neighbours,
         const Boundary& boundary, const Association& association, double tolerance)
      : base_(base),
        mesh_(mesh),
        neighbours_(neighbours),
        boundary_(boundary),
        unit_(association.mesh_unit_mm),
        tolerance_(tolerance),
        is_sought_(base.faces().size(), 1) {
    for (const FaceId face : association.facet_face)
      if (face >= 0) is_sought_[face] = 0;
    for (const FaceId face : association.held_faces) is_sought_[face] = 0;
    for (const RowId row : association.entity.ids())
      if (association.dimension[row] == CadDimension::Face) is_sought_[association.face(row)] = 0;
  }

  UnnamedInterfaces run() {
    if (std::ranges::none_of(is_sought_, [](char sought) { return sought != 0; })) return {};
    samples_ = sample_faces(base_, kSamples);
    all_.emplace(samples_.points);
    leave_twins();
    take_samples();
    if (near_.empty()) return {};
    find_nodes();
    UnnamedInterfaces result{find_faces(), {}};
    for (const FaceId f : is_sought_.ids())
      if (is_sought_[f] && is_inside(f)) result.crossed.push_back(f);
    return result;
  }

 private:
  Vector3d position(Index node) const { return unit_ * mesh_.points.row(node).transpose(); }

  // Two solids that touch have a face each in the same place: facets lie on one of them.
  void leave_twins() {
    const auto faces = static_cast<Index>(is_sought_.size());
    std::vector<char> is_twin(is_sought_.size(), 0);
    parallel_for(faces, 1, [&](Index begin, Index end) {
      for (Index f = begin; f < end; ++f) {
        const FaceId face(static_cast<int>(f));
        is_twin[f] = is_sought_[face] &&
                     std::ranges::all_of(sample_domain(base_, face, kProbes), [&](auto& uv) {
                       return is_on_other(face, base_.evaluate(face, uv).point);
                     });
      }
    });
    for (const FaceId face : is_sought_.ids())
      if (is_twin[static_cast<std::size_t>(face)]) is_sought_[face] = 0;
  }

  // Those of the faces sought, with a tree; and their box.
  void take_samples() {
    std::vector<Index> kept;
    for (std::size_t i = 0; i < samples_.face.size(); ++i)
      if (is_sought_[samples_.face[i]]) kept.push_back(static_cast<Index>(i));
    Eigen::AlignedBox3d of_mesh;
    for (const Index node : boundary_.nodes) of_mesh.extend(position(node));
    RowMatrix points(std::ssize(kept), 3);
    for (Index i = 0; i < std::ssize(kept); ++i) {
      points.row(i) = samples_.points.row(kept[i]);
      const double spacing = samples_.face_spacing[samples_.face[kept[i]]];
      reach_ = std::max(reach_, spacing);
      box_.extend(Vector3d(points.row(i)));
    }
    if (kept.empty() || !box_.intersects(of_mesh)) return;
    box_ = Eigen::AlignedBox3d(box_.min().array() - reach_, box_.max().array() + reach_);
    near_ = std::move(kept);
    tree_.emplace(points);
  }

  void find_nodes() {
    lies_.resize(static_cast<std::size_t>(mesh_.node_count()));
    parallel_for(mesh_.node_count(), kGrain, [&](Index begin, Index end) {
      for (Index n = begin; n < end; ++n)
        if (const Vector3d x = position(n); box_.contains(x)) find_feet(x, lies_[n]);
    });
  }

  // From the nearest sample of each face.
  void find_feet(const Vector3d& x, std::vector<Lies>& lies) const {
    std::vector<FaceId> tried;
    for (const Neighbour& near : tree_->within(x.data(), reach_)) {
      const Index sample = near_[near.index];
      const FaceId face = samples_.face[sample];
      if (std::ranges::find(tried, face) != tried.end()) continue;
      tried.push_back(face);
      const FaceFoot foot = project_on_face(base_, face, x, samples_.uv[sample]);
      if (foot.distance <= samples_.face_spacing[face])
        lies.push_back({face, foot.uv, foot.distance});
    }
  }

  std::vector<InnerFace> find_faces() {
    const Index cells = mesh_.cell_count();
    std::vector<std::vector<Candidate>> found((cells + kGrain - 1) / kGrain);
    parallel_for(cells, kGrain, [&](Index begin, Index end) {
      for (Index c = begin; c < end; ++c) add_faces(c, found[begin / kGrain]);
    });
    IdVector<FaceId, double> area(is_sought_.size(), 0);
    for (const auto& some : found)
      for (const Candidate& one : some) area[one.on] += one.area;
    for (const FaceId f : is_sought_.ids())
      if (is_sought_[f] && area[f] >= kMost * area_of(f)) is_sought_[f] = 0;  // found
    std::vector<InnerFace> result;
    for (const auto& some : found)
      for (const Candidate& one : some)
        if (!is_sought_[one.on] && (result.empty() || result.back() != one.face))
          result.push_back(one.face);
    return result;
  }

  double area_of(FaceId face) const {
    const CadFace& of = base_.faces()[face];
    double sum = 0;
    for (const Vector2d& uv : sample_domain(base_, face, kProbes)) {
      const SurfacePoint at = base_.evaluate(face, uv);
      sum += at.du.cross(at.dv).norm();
    }
    return sum * (of.upper - of.lower).prod() / (kProbes * kProbes);
  }

  void add_faces(Index c, std::vector<Candidate>& found) const {
    const auto is_near = [&](Index node) { return !lies_[node].empty(); };
    if (dimension(mesh_.types[c]) < 3 || std::ranges::count_if(mesh_.cell(c), is_near) < 3) return;
    const std::span others = neighbours_.of(c);
    const std::vector<Facet> facets = cell_facets(mesh_, c);
    for (std::size_t f = 0; f < facets.size(); ++f) {
      if (others[f] <= c || mesh_.region(others[f]) != mesh_.region(c)) continue;
      const auto corners =
          std::span(facets[f].nodes)
              .first(std::size_t(corner_count(facets[f].type, std::ssize(facets[f].nodes))));
      if (!std::ranges::all_of(corners, is_near)) continue;
      const Vector3d vector = area_vector(corners);
      for (const FaceId on : faces_below(corners, vector))
        found.push_back({{c, static_cast<Index>(f)}, on, vector.norm()});
    }
  }

  Vector3d area_vector(std::span<const Index> corners) const {
    Vector3d sum = Vector3d::Zero();
    const Vector3d first = position(corners[0]);
    for (std::size_t i = 1; i + 1 < corners.size(); ++i)
      sum += 0.5 * (position(corners[i]) - first).cross(position(corners[i + 1]) - first);
    return sum;
  }

  // The CAD faces that a facet lies on: two where solids that touch have one each.
  std::vector<FaceId> faces_below(std::span<const Index> corners, const Vector3d& vector) const {
    double edge = std::numeric_limits<double>::infinity();
    Vector3d middle = Vector3d::Zero();
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vector3d x = position(corners[i]);
      edge = std::min(edge, (position(corners[(i + 1) % corners.size()]) - x).norm());
      middle += x / double(corners.size());
    }
    std::vector<FaceId> result;
    for (const Lies& first : lies_[corners[0]]) {
      const bool is_on = std::ranges::all_of(corners, [&](Index node) {
        const auto lies = std::ranges::find(lies_[node], first.face, &Lies::face);
        if (lies == lies_[node].end() || lies->distance > tolerance_ * edge) return false;
        const SurfacePoint at = base_.evaluate(lies->face, lies->uv);
        const Vector3d normal = at.du.cross(at.dv);
        // A pole has no normal.
        return std::abs(normal.dot(vector)) >= kSameWay * normal.norm() * vector.norm();
      });
      if (!is_on) continue;
      const FaceFoot foot = project_on_face(base_, first.face, middle, first.uv);
      if (distance_to_trimmed(base_, first.face, foot.uv) <= tolerance_ * edge)
        result.push_back(first.face);
    }
    return result;
  }

  // Whether most of a face lies amid cells: the nodes next to it are not those of the outside. One
  // that lies where another does, which has facets, is its twin.
  bool is_inside(FaceId face) {
    if (!nodes_) {
      nodes_.emplace(unit_ * mesh_.points);
      is_outer_.assign(static_cast<std::size_t>(mesh_.node_count()), 0);
      for (Index f = 0; f < boundary_.facet_count(); ++f)
        if (boundary_.neighbour[f] < 0)
          for (const Index node : boundary_.facet(f)) is_outer_[node] = 1;
    }
    const std::vector<Vector2d> probes = sample_domain(base_, face, kProbes);
    const auto inside = std::ranges::count_if(probes, [&](const Vector2d& uv) {
      const Vector3d x = base_.evaluate(face, uv).point;
      return !is_outer_[nodes_->nearest(x.data(), 1).front().index] && !is_on_other(face, x);
    });
    return double(inside) > kInside * double(probes.size());
  }

  // Whether x lies on a face that has facets, too: mostly it is that of a sample next to x.
  bool is_on_other(FaceId face, const Vector3d& x) const {
    const double least = kSamePlace * base_.diagonal();
    const auto lies_there = [&](const Neighbour& near) {
      const FaceId other = samples_.face[near.index];
      if (other == face || is_sought_[other]) return false;
      const FaceFoot foot = project_on_face(base_, other, x, samples_.uv[near.index]);
      return foot.distance <= least && distance_to_trimmed(base_, other, foot.uv) <= least;
    };
    return std::ranges::any_of(all_->nearest(x.data(), kFewSamples), lies_there) ||
           std::ranges::any_of(all_->within(x.data(), 2 * samples_.spacing), lies_there);
  }

  const CadModel& base_;
  const Mesh& mesh_;
  const CellNeighbours& neighbours_;
  const Boundary& boundary_;
  double unit_, tolerance_;
  IdVector<FaceId, char> is_sought_;  ///< CAD faces without a facet
  FaceSamples samples_;
  std::vector<Index> near_;  ///< samples of the faces sought, as tree_ has them
  std::optional<KdTree> tree_, nodes_, all_;
  double reach_ = 0;
  Eigen::AlignedBox3d box_;
  std::vector<std::vector<Lies>> lies_;
  std::vector<char> is_outer_;
};

}  // namespace

UnnamedInterfaces find_unnamed_interfaces(const CadModel& base, const Mesh& mesh,
                                          const CellNeighbours& neighbours,
                                          const Boundary& boundary, const Association& association,
                                          double tolerance) {
  return Search(base, mesh, neighbours, boundary, association, tolerance).run();
}

}  // namespace cadmorph
