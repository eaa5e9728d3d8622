#include "surface/free_patches.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <sstream>
#include <utility>

#include "cad/alignment.h"
#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "core/errors.h"
#include "core/kd_tree.h"
#include "core/remedies.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

constexpr double kSameShape = 0.02;  // coarse meshes cut corners: a circle of 16 facets 2 %
// Cosine of 30 degrees: facets of a curved wall turn by less, those of a circle of 12 by as much.
constexpr double kSmoothJoint = 0.86;
// Of two planes that meet in a line, radians: below, what their normals are known to (1e-6) leaves
// the line's direction unsure by more than 1e-3.
constexpr double kLeastAngle = 1e-3;
constexpr int kNoPatch = -1, kPartOfCurved = -2;
// A mesh with a boundary of its own (far field) is larger than the CAD by at least this factor. One
// on the CAD alone is as large as that, but for chords and strays. With 1.1 or 1.4 the tests of far
// fields pass, with 3 meshes of four are refused.
constexpr double kBeyondCad = 1.2;
// Nodes that a mesher left far off the CAD, in a gap narrower than its cells: at most this part of
// the outside's nodes, and at most so many side by side. A face that the CAD lacks has more. The
// tests of strays and far fields pass with half and twice of these, and of the two constants by
// kOffCad.
constexpr double kMostStranded = 0.005;
constexpr std::ptrdiff_t kMostInCluster = 12;
// Part of the CAD's faces that a mesh of this CAD covers at least, however large its far field is.
// Of a body between two symmetry planes the faces at its ends have no facets. With 0.5, 11 tests of
// far fields and planes fail, with half of it none.
constexpr double kLeastCovered = 0.25;
// Unmatched nodes belong to the CAD, not to a far field, where they are off it by kOffCad of their
// shortest mesh edge at most, or by kSamplesApart spacings of its samples more: in an even grid a
// point is within 0.7 of them, where parameters run unevenly farther.
constexpr double kOffCad = 0.5, kSamplesApart = 1.5;
// Of the CAD: 0.3 and 1 % of the square root of its area apart.
constexpr Index kSamples = 100'000, kCoverSamples = 10'000;

bool is_unmatched_node(const Association& association, RowId n) {
  return association.dimension[n] == CadDimension::None && !association.is_amid[n];
}

// Whether something else than its patch moves it.
bool is_given(const Association& association, const PatchMarks& marks, RowId n) {
  return association.dimension[n] != CadDimension::None ||
         (!marks.is_moved.empty() && marks.is_moved[n]);
}

IdVector<FacetId, char> unmatched_facets(const SurfaceMesh& surface, const Boundary& boundary,
                                         const Association& association,
                                         const PatchMarks& marks = {}) {
  IdVector<FacetId, char> is_unmatched(surface.facets.size(), 0);
  const IdVector<FacetId, char> is_crack = find_cracks(surface, boundary, association);
  for (const FacetId f : surface.facets.ids())
    is_unmatched[f] =
        (boundary.neighbour[f] < 0 || (!marks.is_inner.empty() && marks.is_inner[f])) &&
        !is_crack[f] &&
        std::any_of(surface.facets[f].begin(), surface.facets[f].end(),
                    [&](RowId n) { return is_unmatched_node(association, n); });
  return is_unmatched;
}

// The first of the nodes at each place, of those that are asked about.
IdVector<RowId, RowId> first_at_place(const SurfaceMesh& surface, const std::vector<RowId>& nodes) {
  std::vector<RowId> order = nodes;
  IdVector<RowId, RowId> first(static_cast<std::size_t>(surface.points.rows()));
  std::iota(first.begin(), first.end(), RowId(0));
  const auto place = [&](RowId n) {
    const Vector3d x = surface.points.row(n);
    return std::array{x[0], x[1], x[2]};
  };
  std::ranges::sort(
      order, [&](RowId a, RowId b) { return place(a) != place(b) ? place(a) < place(b) : a < b; });
  for (std::size_t i = 1; i < order.size(); ++i)
    if (place(order[i]) == place(order[i - 1])) first[order[i]] = first[order[i - 1]];
  return first;
}

double size_of(const SurfaceMesh& surface) {
  return (surface.points.colwise().maxCoeff() - surface.points.colwise().minCoeff()).norm();
}

double off_plane(const SurfaceMesh& surface, FacetId facet, const FreePatch& patch) {
  double worst = 0;
  for (int i = 0; i < surface.corners[facet]; ++i) {
    const Vector3d x = surface.points.row(surface.facets[facet][i]);
    worst = std::max(worst, std::abs((x - patch.origin).dot(patch.normal)));
  }
  return worst;
}

// Open facets, the largest first: their planes are the surest.
std::vector<FacetId> seeds(const SurfaceMesh& surface, const IdVector<FacetId, char>& is_open) {
  std::vector<FacetId> result;
  IdVector<FacetId, double> area(surface.facets.size(), 0);
  for (const FacetId f : is_open.ids()) {
    if (!is_open[f]) continue;
    area[f] = area_vector(surface, surface.points, f).norm();
    result.push_back(f);
  }
  std::ranges::stable_sort(result, std::greater<>(), [&](FacetId f) { return area[f]; });
  return result;
}

// Mean plane of facets: rounding tilts small ones.
struct MeanPlane {
  Vector3d area = Vector3d::Zero(), moment = Vector3d::Zero();
  double weight = 0;

  void add(const SurfaceMesh& surface, FacetId facet) {
    const Vector3d own = area_vector(surface, surface.points, facet);
    area += own.dot(area) < 0 ? Vector3d(-own) : own;
    moment += own.norm() * centroid(surface, surface.points, facet);
    weight += own.norm();
  }
};

// Patches over open facets.
struct PatchGrowth {
  // Grows a patch from `seed`, over facets of its plane if is_planar, else smoothly over what is
  // left.
  FreePatch grow(FacetId seed, bool is_planar, int id);
  // A part of a curved boundary: facets beside it go on smoothly, but leave its plane.
  bool is_bent(const FreePatch& patch, int id) const;

  const SurfaceMesh& surface;
  const PatchMarks& marks;
  IdVector<FacetId, char> is_open;
  double tolerance;
  IdVector<FacetId, int> patch_of;
};

FreePatch PatchGrowth::grow(FacetId seed, bool is_planar, int id) {
  FreePatch patch;
  patch.is_planar = is_planar;
  patch.origin = centroid(surface, surface.points, seed);
  patch.normal = area_vector(surface, surface.points, seed).normalized();
  MeanPlane plane;
  const int waiting = patch_of[seed];
  const auto normal_of = [&](FacetId g) -> Vector3d {
    return area_vector(surface, surface.points, g).normalized();
  };
  const auto belongs = [&](FacetId from, FacetId g) {
    if (!is_open[g] || patch_of[g] != waiting || !marks.is_one_group(seed, g)) return false;
    if (!is_planar) return normal_of(g).dot(normal_of(from)) > kSmoothJoint;
    return std::abs(normal_of(g).dot(patch.normal)) > kSmoothJoint &&
           off_plane(surface, g, patch) <= tolerance;
  };
  const auto add = [&](FacetId g) {
    patch_of[g] = id;
    patch.facets.push_back(g);
    plane.add(surface, g);
    if (!is_planar || plane.weight == 0) return;
    patch.origin = plane.moment / plane.weight;
    patch.normal = plane.area.normalized();
  };
  add(seed);
  for (std::size_t before = 0; before < patch.facets.size();) {  // the plane became surer
    before = patch.facets.size();
    for (std::size_t k = 0; k < patch.facets.size(); ++k)
      for (const RowId n : surface.facets[patch.facets[k]])
        for (const FacetId g : surface.facets_at(n))
          if (belongs(patch.facets[k], g)) add(g);
  }
  return patch;
}

bool PatchGrowth::is_bent(const FreePatch& patch, int id) const {
  for (const FacetId f : patch.facets)
    for (const RowId n : surface.facets[f])
      for (const FacetId g : surface.facets_at(n)) {
        if (!is_open[g] || patch_of[g] == id || !marks.is_one_group(f, g)) continue;
        const Vector3d normal = area_vector(surface, surface.points, g).normalized();
        if (normal.dot(patch.normal) > kSmoothJoint && off_plane(surface, g, patch) > tolerance)
          return true;
      }
  return false;
}

void sort_nodes(const SurfaceMesh& surface, const Association& association, const PatchMarks& marks,
                const IdVector<FacetId, int>& patch_of, int id, FreePatch& patch) {
  std::vector<RowId> nodes;
  for (const FacetId f : patch.facets)
    nodes.insert(nodes.end(), surface.facets[f].begin(), surface.facets[f].end());
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  for (const RowId n : nodes) {
    if (association.is_amid[n]) continue;
    if (is_given(association, marks, n)) {
      patch.touched.push_back(n);
      continue;
    }
    bool is_shared = false;
    for (const FacetId f : surface.facets_at(n)) is_shared |= patch_of[f] >= 0 && patch_of[f] != id;
    (is_shared ? patch.border : patch.inner).push_back(n);
  }
}

std::vector<int> patches_at(const SurfaceMesh& surface, const IdVector<FacetId, int>& patch_of,
                            RowId n) {
  std::vector<int> ids;
  for (const FacetId f : surface.facets_at(n))
    if (patch_of[f] >= 0) ids.push_back(patch_of[f]);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

void sort_along(const SurfaceMesh& surface, FreeLine& line) {
  const auto sort = [&] {
    std::ranges::stable_sort(line.nodes, std::less<>(),
                             [&](RowId n) { return surface.points.row(n).dot(line.direction); });
  };
  sort();
  // Its own nodes tell the direction better than planes that meet at a small angle.
  const Vector3d span =
      surface.points.row(line.nodes.back()) - surface.points.row(line.nodes.front());
  if (span.norm() == 0) return;
  line.direction = span.normalized();
  sort();
}

// Finds the lines between two planar patches and gives both patches a copy.
void add_lines(const SurfaceMesh& surface, const Association& association, const PatchMarks& marks,
               const IdVector<FacetId, int>& patch_of, std::vector<FreePatch>& patches) {
  std::map<std::pair<int, int>, FreeLine> lines;
  IdVector<RowId, char> is_free(association.dimension.size(), 0), is_seen(is_free);
  for (const FreePatch& patch : patches)
    for (const auto* nodes : {&patch.border, &patch.touched})
      for (const RowId n : *nodes) {
        if (std::exchange(is_seen[n], 1)) continue;
        const std::vector<int> ids = patches_at(surface, patch_of, n);
        is_free[n] = ids.size() == 2 && is_unmatched_node(association, n) &&
                     !is_given(association, marks, n);
        for (std::size_t i = 0; i < ids.size(); ++i)
          for (std::size_t j = i + 1; j < ids.size(); ++j)
            if (patches[ids[i]].is_planar && patches[ids[j]].is_planar)
              lines[{ids[i], ids[j]}].nodes.push_back(n);
      }
  for (auto& [pair, line] : lines) {
    const auto is_touched = [&](RowId n) {
      return !is_unmatched_node(association, n) || is_given(association, marks, n);
    };
    const Vector3d along = patches[pair.first].normal.cross(patches[pair.second].normal);
    if (along.norm() < kLeastAngle || std::ranges::none_of(line.nodes, is_touched)) continue;
    line.direction = along.normalized();
    sort_along(surface, line);
    for (const RowId n : line.nodes) line.is_free.push_back(is_free[n]);
    line.is_free.front() = line.is_free.back() = 0;
    patches[pair.first].lines.push_back(line);
    patches[pair.second].lines.push_back(line);
  }
}

// Of the CAD's faces that reach into the box round the mesh: the part that the mesh covers by half
// or more of the area that they have in there. So a half model of a body, cut by symmetry planes,
// counts like the whole.
double covered_faces(const CadModel& base, const SurfaceMesh& surface,
                     const Association& association) {
  std::vector<double> area(base.faces().size(), 0);
  for (const FacetId f : association.facet_face.ids())
    if (association.facet_face[f] >= 0)
      area[association.facet_face[f]] += area_vector(surface, surface.points, f).norm();
  const double margin = plane_tolerance(surface);
  const Eigen::AlignedBox3d box(Vector3d(surface.points.colwise().minCoeff().array() - margin),
                                Vector3d(surface.points.colwise().maxCoeff().array() + margin));
  const FaceSamples samples = sample_faces(base, kCoverSamples);
  std::vector<double> all(area.size(), 0), inside(area.size(), 0);
  for (Index i = 0; i < samples.points.rows(); ++i) {
    ++all[samples.face[i]];
    inside[samples.face[i]] += box.contains(Vector3d(samples.points.row(i)));
  }
  const auto features = entity_features(base);
  double reaching = 0, covered = 0;
  for (std::size_t f = 0; f < area.size(); ++f) {
    if (inside[f] == 0) continue;
    ++reaching;
    covered += area[f] >= 0.5 * features[f].size * features[f].size * inside[f] / all[f];
  }
  return reaching > 0 ? covered / reaching : 0;
}

// Surface nodes on no face.
struct NodesOff {
  RowId row;             ///< of one of them
  Index count, outside;  ///< so many of those on the outside
};

// Of a node that is off the CAD: how far, and the part of the mesh that names it.
std::string describe_off(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                         const SurfaceMesh& surface, RowId row) {
  const FaceSamples samples = sample_faces(base, kSamples);
  const Vector3d x = surface.points.row(row);
  const Index near = KdTree(samples.points).nearest(x.data(), 1)[0].index;
  const FaceFoot foot = project_on_face(base, samples.face[near], x, samples.uv[near]);
  const double distance =
      std::hypot(foot.distance, distance_to_trimmed(base, samples.face[near], foot.uv));
  std::ostringstream text;
  text.precision(3);
  text << distance << " mm from face " << samples.face[near] + 1 << " ("
       << distance / surface.local_length[row] << " of its shortest mesh edge)";
  const auto group = std::ranges::find_if(mesh.groups, [&](const NodeGroup& one) {
    return std::ranges::binary_search(one.nodes, boundary.nodes[row]);
  });
  if (group != mesh.groups.end()) text << ", of " << group->kind << " '" << group->name << "'";
  return text.str();
}

[[noreturn]] void refuse(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                         const SurfaceMesh& surface, const NodesOff& off, const std::string& why) {
  std::ostringstream text;
  text.precision(6);
  const Vector3d lower = surface.points.colwise().minCoeff(),
                 upper = surface.points.colwise().maxCoeff();
  // What is rounding beside the size of the CAD is 0.
  const auto plain = [&](const Vector3d& x) {
    const Eigen::IOFormat format(Eigen::StreamPrecision, Eigen::DontAlignCols, " ", " ");
    const double rounding = 1e-9 * base.diagonal();
    const Eigen::RowVector3d shown =
        (x.array().abs() > rounding).select(x.array(), 0.0).matrix().transpose();
    std::ostringstream line;
    line.precision(6);
    line << shown.format(format);
    return line.str();
  };
  text << "the mesh does not lie on " << base.file_name() << ": " << off.count << " of "
       << off.outside << " surface nodes are on no CAD face, such as "
       << node_name(mesh, boundary.nodes[off.row]) << " at " << plain(surface.points.row(off.row))
       << " mm, " << describe_off(base, mesh, boundary, surface, off.row) << why << " Mesh bounds "
       << plain(lower) << " .. " << plain(upper) << " mm, CAD bounds " << plain(base.lower())
       << " .. " << plain(base.upper())
       << " mm. Check that the mesh belongs to this CAD model, its unit ("
       << words_for(Remedy::MeshUnit) << "), and " << words_for(Remedy::AssociationTolerance)
       << ".";
  throw AssociationError(text.str());
}

// Why a mesh that is not on the CAD may not be: in a unit that is not known, it has the same shape.
std::string other_part(const CadModel& base, const SurfaceMesh& surface, double unit_mm) {
  const Eigen::Array3d cad = base.upper() - base.lower();
  const Eigen::Array3d mesh =
      surface.points.colwise().maxCoeff() - surface.points.colwise().minCoeff();
  const Eigen::Array3d ratio = mesh / cad.max(kSamePlane * base.diagonal());
  const double factor = ratio.mean();
  const bool is_similar = (ratio - factor).abs().maxCoeff() < kSameShape * factor;
  if (!is_similar || std::abs(factor - 1) < kSameShape)
    return "; it seems to be the mesh of another part.";
  std::ostringstream text;
  text.precision(4);
  text << "; it has the CAD's proportions at " << factor << " times its size: try "
       << words_for(Remedy::MeshUnit) << " " << unit_mm / factor << " (millimetres).";
  return text.str();
}

// A far field or symmetry plane leads away from the CAD. Nodes that all lie near it belong to it,
// though they are off it: they would be left behind.
void refuse_left_behind(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                        const SurfaceMesh& surface, const Association& association, Index outside) {
  const FaceSamples samples = sample_faces(base, kSamples);
  const KdTree tree(samples.points);
  const auto is_open = unmatched_facets(surface, boundary, association);
  IdVector<RowId, char> is_seen(association.dimension.size(), 0);
  const auto is_near = [&](RowId n) {
    const double reach = kOffCad * surface.local_length[n] + kSamplesApart * samples.spacing;
    const Vector3d x = surface.points.row(n);
    return tree.nearest(x.data(), 1)[0].squared_distance <= reach * reach;
  };
  for (const FacetId f : is_open.ids()) {
    if (!is_open[f]) continue;
    for (const RowId n : surface.facets[f]) {
      if (!is_unmatched_node(association, n) || is_seen[n]) continue;
      const auto nodes = unmatched_around(surface, association, is_open, n, is_seen);
      if (std::all_of(nodes.begin(), nodes.end(), is_near))
        refuse(base, mesh, boundary, surface, {n, std::ssize(nodes), outside},
               "; they lie near it amid nodes that are on it, so they are no far field.");
    }
  }
}

// All unmatched nodes, where they are few, in small clusters: what a mesher made of a gap that is
// narrower than its cells. Else none.
std::vector<RowId> find_stranded(const SurfaceMesh& surface, const Boundary& boundary,
                                 const Association& association, Index outside) {
  const auto is_open = unmatched_facets(surface, boundary, association);
  IdVector<RowId, char> is_seen(association.dimension.size(), 0);
  std::vector<RowId> result;
  for (const FacetId f : is_open.ids()) {
    if (!is_open[f]) continue;
    for (const RowId n : surface.facets[f]) {
      if (!is_unmatched_node(association, n) || is_seen[n]) continue;
      const auto nodes = unmatched_around(surface, association, is_open, n, is_seen);
      if (std::ssize(nodes) > kMostInCluster) return {};
      result.insert(result.end(), nodes.begin(), nodes.end());
    }
  }
  if (double(result.size()) > kMostStranded * double(outside)) return {};
  std::ranges::sort(result);
  return result;
}

// Whether unmatched nodes bound a space of their own: the facets at them use no other nodes.
bool is_hole(const SurfaceMesh& surface, const Association& association,
             const IdVector<FacetId, char>& is_open) {
  for (const FacetId f : is_open.ids())
    if (is_open[f] && !std::ranges::all_of(surface.facets[f], [&](RowId n) {
          return is_unmatched_node(association, n);
        }))
      return false;
  return true;
}

}  // namespace

IdVector<FacetId, char> find_cracks(const SurfaceMesh& surface, const Boundary& boundary,
                                    const Association& association) {
  IdVector<FacetId, char> is_crack(surface.facets.size(), 0);
  std::vector<FacetId> open;
  std::vector<RowId> nodes;
  for (const FacetId f : surface.facets.ids()) {
    const std::vector<RowId>& facet = surface.facets[f];
    if (boundary.neighbour[f] >= 0 ||
        std::ranges::none_of(facet, [&](RowId n) { return is_unmatched_node(association, n); }))
      continue;
    open.push_back(f);
    nodes.insert(nodes.end(), facet.begin(), facet.end());
  }
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  const IdVector<RowId, RowId> first = first_at_place(surface, nodes);
  std::map<std::vector<RowId>, std::vector<FacetId>> by_place;
  for (const FacetId f : open) {
    std::vector<RowId> key;
    for (const RowId n : surface.facets[f]) key.push_back(first[n]);
    std::ranges::sort(key);
    by_place[key].push_back(f);
  }
  for (const auto& [key, facets] : by_place)
    if (facets.size() == 2 && area_vector(surface, surface.points, facets[0])
                                      .dot(area_vector(surface, surface.points, facets[1])) < 0)
      is_crack[facets[0]] = is_crack[facets[1]] = 1;
  return is_crack;
}

std::string describe_cracks(const Mesh& mesh, const SurfaceMesh& surface, const Boundary& boundary,
                            const Association& association) {
  const IdVector<FacetId, char> is_crack = find_cracks(surface, boundary, association);
  std::vector<RowId> nodes;
  for (const FacetId f : is_crack.ids())
    if (is_crack[f]) nodes.insert(nodes.end(), surface.facets[f].begin(), surface.facets[f].end());
  if (nodes.empty()) return {};
  std::ranges::sort(nodes);
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  // At its border its two sides meet in one node.
  const IdVector<RowId, RowId> first = first_at_place(surface, nodes);
  std::map<RowId, int> at_place;
  for (const RowId n : nodes) ++at_place[first[n]];
  std::erase_if(nodes, [&](RowId n) { return at_place[first[n]] < 2; });
  constexpr std::size_t kNamed = 10;  // as many as a line or two hold
  std::ostringstream text;
  text << "the mesh has a crack inside: " << std::ranges::count(is_crack, 1)
       << " facets cancel in pairs, and nodes lie two at a place; both sides move together as "
          "interior nodes do. These nodes are:";
  for (std::size_t i = 0; i < std::min(nodes.size(), kNamed); ++i)
    text << (i > 0 ? ", " : " ") << node_name(mesh, boundary.nodes[nodes[i]]).substr(5);
  if (nodes.size() > kNamed) text << " and " << nodes.size() - kNamed << " more";
  return text.str();
}

double plane_tolerance(const SurfaceMesh& surface) {
  return kSamePlane * std::max(size_of(surface), surface.points.cwiseAbs().maxCoeff());
}

std::vector<RowId> unmatched_around(const SurfaceMesh& surface, const Association& association,
                                    const IdVector<FacetId, char>& is_open, RowId seed,
                                    IdVector<RowId, char>& is_seen) {
  std::vector<RowId> nodes{seed};
  is_seen[seed] = 1;
  for (std::size_t k = 0; k < nodes.size(); ++k)
    for (const FacetId f : surface.facets_at(nodes[k])) {
      if (!is_open[f]) continue;
      for (const RowId n : surface.facets[f])
        if (is_unmatched_node(association, n) && !std::exchange(is_seen[n], 1)) nodes.push_back(n);
    }
  return nodes;
}

std::vector<FreePatch> find_free_patches(const SurfaceMesh& surface, const Boundary& boundary,
                                         const Association& association, const PatchMarks& marks) {
  PatchGrowth growth{.surface = surface,
                     .marks = marks,
                     .is_open = unmatched_facets(surface, boundary, association, marks),
                     .tolerance = plane_tolerance(surface),
                     .patch_of = IdVector<FacetId, int>(surface.facets.size(), kNoPatch)};
  IdVector<FacetId, int>& patch_of = growth.patch_of;
  std::vector<FreePatch> patches;
  const std::vector<FacetId> order = seeds(surface, growth.is_open);
  for (const bool is_planar : {true, false})
    for (const FacetId f : order) {
      if (patch_of[f] != (is_planar ? kNoPatch : kPartOfCurved)) continue;
      const int id = static_cast<int>(patches.size());
      FreePatch patch = growth.grow(f, is_planar, id);
      if (is_planar && growth.is_bent(patch, id)) {
        for (const FacetId g : patch.facets) patch_of[g] = kPartOfCurved;
        continue;
      }
      patches.push_back(std::move(patch));
    }
  for (std::size_t i = 0; i < patches.size(); ++i)
    sort_nodes(surface, association, marks, patch_of, static_cast<int>(i), patches[i]);
  add_lines(surface, association, marks, patch_of, patches);
  std::erase_if(patches, [](const FreePatch& p) { return p.inner.empty() && p.border.empty(); });
  return patches;
}

void check_unmatched(const CadModel& base, const Mesh& mesh, const Boundary& boundary,
                     const SurfaceMesh& surface, const AssociationOptions& options,
                     Association& association) {
  Index outside = 0, unmatched = 0, unexpected = 0;
  RowId example;
  const IdVector<FacetId, char> is_crack = find_cracks(surface, boundary, association);
  for (const RowId n : association.dimension.ids()) {
    bool is_outside = false;
    for (const FacetId f : surface.facets_at(n))
      is_outside |= boundary.neighbour[f] < 0 && !is_crack[f];
    outside += is_outside;
    if (!is_unmatched_node(association, n)) continue;
    association.is_free[n] = !is_outside;
    if (!is_outside) continue;
    ++unmatched;
    const bool is_unexpected = !options.expects_any_off &&
                               !std::ranges::binary_search(options.expected_off, boundary.nodes[n]);
    if (example < 0 || (is_unexpected && unexpected == 0)) example = n;
    unexpected += is_unexpected;
  }
  if (unmatched == 0) return;
  if (covered_faces(base, surface, association) < kLeastCovered)
    refuse(base, mesh, boundary, surface, {example, unmatched, outside},
           other_part(base, surface, association.mesh_unit_mm));
  if (unexpected == 0) return;
  const bool is_larger = size_of(surface) >= kBeyondCad * base.diagonal();
  if (!is_larger && is_hole(surface, association, unmatched_facets(surface, boundary, association)))
    refuse(base, mesh, boundary, surface, {example, unmatched, outside},
           dimension(mesh) == 3
               ? "; they bound a hole inside of the mesh that the CAD does not have."
               : "; they are of shells apart from the others, which the CAD does not have. If they "
                 "are meant, as those of a tool that no CAD tells of, say so: " +
                     words_for(Remedy::ExpectUnmatched) + ".");
  if (options.takes_strays && unexpected == unmatched)
    association.stranded = find_stranded(surface, boundary, association, outside);
  for (const RowId n : association.stranded) association.is_free[n] = 1;
  if (!association.stranded.empty()) return;
  if (!is_larger)
    refuse(base, mesh, boundary, surface, {example, unmatched, outside},
           "; the mesh is hardly larger than the CAD, so they are no far field. If they are meant, "
           "as those of a symmetry plane that cuts the CAD, say so: " +
               words_for(Remedy::ExpectUnmatched) + ".");
  refuse_left_behind(base, mesh, boundary, surface, association, outside);
}

}  // namespace cadmorph
