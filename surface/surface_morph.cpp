#include "surface/surface_morph.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

#include "cad/projector.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/remedies.h"
#include "surface/curve_maps.h"
#include "surface/face_nodes.h"
#include "surface/face_placement.h"
#include "surface/free_patches.h"
#include "surface/image_pairs.h"
#include "surface/joint_motion.h"
#include "surface/joints.h"
#include "surface/junctions.h"
#include "surface/node_feet.h"
#include "surface/periodic_sides.h"
#include "surface/placement.h"
#include "surface/surface_mesh.h"
#include "surface/surface_remarks.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// A node that moved by no more than the rounding of its way through the CAD has not moved.
void keep_still(const Points& start, Points& positions) {
  const double least = kWayRounding * start.cwiseAbs().maxCoeff();
  for (Index n = 0; n < start.rows(); ++n)
    if ((positions.row(n) - start.row(n)).cwiseAbs().maxCoeff() <= least)
      positions.row(n) = start.row(n);
}

std::string text_of(const Vector3d& point) {
  std::ostringstream text;
  text << point.transpose();
  return text.str();
}

// What the options say of nodes on no CAD face vouches for these.
AssociationOptions for_association(const Mesh& mesh, const SurfaceMorphOptions& options) {
  AssociationOptions result = options.association;
  result.expects_any_off =
      options.unmatched == UnmatchedPolicy::Fix || options.unmatched == UnmatchedPolicy::Slide;
  result.takes_strays = options.unmatched != UnmatchedPolicy::Error;
  result.expected_off = named_nodes(mesh, options.groups);
  return result;
}

// A node that is held where the CAD has a face.
struct HeldNode {
  RowId row;
  FaceId face;
  Vector2d uv;
};

std::vector<HeldNode> held_on_faces(const IdVector<RowId, GroupConstraint>& constraints,
                                    const Association& association) {
  std::vector<HeldNode> result;
  for (const RowId n : constraints.ids())
    if (constraints[n] == GroupConstraint::Hold && association.dimension[n] == CadDimension::Face)
      result.push_back({n, association.face(n), association.uv.row(n)});
  return result;
}

}  // namespace

struct SurfaceMorph::Impl {
  std::shared_ptr<const CadModel> base;
  SurfaceMorphOptions options;
  Points start;  // the nodes' positions, in the mesh's unit
  SurfaceMesh surface;
  double tolerance = 0;  // of planes and images, millimetres
  Association association;
  IdVector<RowId, GroupConstraint> constraints;  // by the nodes' groups
  std::vector<HeldNode> held;                    // on CAD faces
  std::vector<FreePatch> patches;
  std::vector<RigidGroup> rigid;
  std::vector<PeriodicSides> periodic;  // those that have names
  std::string crack;                    // what to tell of one inside of the mesh
  std::vector<std::string> idle;        // what to tell of the base with every variant
  IdVector<FaceId, FaceNodes> faces;
  Joints joints;
  Points feet;     // of all nodes on the base CAD, millimetres
  Points offsets;  // of the nodes from these; of those on faces in the face's own frame

  BasePlacement base_placement() const {
    return {*base, surface, association, faces, feet, offsets};
  }
  void find_feet();
  void find_offsets();
  void find_forms();
  void check_policy() const;
  GroupConstraint constraint(const FreePatch& patch) const;
  bool slides(const FreePatch& patch) const;

  void move_corners(const ModelPair& pair, const CurveMaps& maps, Placement& placed) const;
  void move_edges(const ModelPair& pair, const CurveMaps& maps, Placement& placed) const;
  std::vector<ImagePair> image_faces(const ModelPair& pair, const Points& moved) const;
  void place_images(const ModelPair& pair, const std::vector<ImagePair>& images,
                    Placement& placed) const;
  void settle_images(const std::vector<ImagePair>& images, Points& moved) const;
  SurfaceMorphResult morph(const CadModel& variant, const TopologyMatch& match,
                           const std::vector<PeriodicSides>& sides,
                           std::vector<std::string>& apart) const;
  std::vector<ImagePair> named_pairs(const std::vector<PeriodicSides>& sides,
                                     const Points& moved) const;
  void follow_named(Points& moved) const;
  VectorXd distances_beyond_wires(const ModelPair& pair, const Placement& placed) const;
  double least_stretch(RowId row, const Points& moved_feet) const;
  void move_amid(Points& moved) const;
  std::vector<FreePatch> sliding_patches() const;
  std::vector<ImagePair> slide(Points& moved) const;
  Index dragged_patches(const Points& moved) const;
  std::string describe_patches(Index dragged) const;
  std::string describe_held(const ModelPair& pair) const;
};

void SurfaceMorph::Impl::find_feet() {
  feet = surface.points;
  parallel_for(feet.rows(), 1024, [&](Index begin, Index end) {
    for (RowId n(begin); n < end; ++n) {
      const Vector2d uv = association.uv.row(n);
      switch (association.dimension[n]) {
        case CadDimension::Vertex:
          feet.row(n) = base->vertices()[association.vertex(n)].point;
          break;
        case CadDimension::Edge:
          feet.row(n) = base->evaluate_edge(association.edge(n), uv[0]).point;
          break;
        case CadDimension::Face:
          feet.row(n) = base->evaluate(association.face(n), uv).point;
          break;
        case CadDimension::None:
          break;
      }
    }
  });
}

void SurfaceMorph::Impl::find_offsets() {
  offsets = surface.points - feet;
  if (options.snap) offsets.setZero();
  parallel_for(offsets.rows(), 1024, [&](Index begin, Index end) {
    for (RowId n(begin); n < end; ++n)
      if (association.dimension[n] == CadDimension::Face && !offsets.row(n).isZero(0))
        offsets.row(n) *= surface_frame(base->evaluate(association.face(n), association.uv.row(n)));
  });
}

void SurfaceMorph::Impl::check_policy() const {
  if (patches.empty() || options.unmatched != UnmatchedPolicy::Error) return;
  const FreePatch& patch = patches.front();
  throw AssociationError("the mesh has " + std::to_string(patches.size()) +
                         " boundary patches that lie on no face of " + base->file_name() +
                         ", the first (" + std::to_string(patch.facets.size()) + " facets) near " +
                         text_of(patch.origin) + " mm. They are refused as asked for (" +
                         words_for(Remedy::Unmatched) +
                         "); to keep them: " + words_for(Remedy::KeepUnmatched) + ".");
}

// What the groups say of a patch: one node that is held holds it.
GroupConstraint SurfaceMorph::Impl::constraint(const FreePatch& patch) const {
  GroupConstraint result = GroupConstraint::None;
  for (const auto* nodes : {&patch.inner, &patch.border})
    for (const RowId n : *nodes) {
      const GroupConstraint wanted = constraints[n];
      const bool is_own = nodes == &patch.inner || patch.inner.empty();
      if (is_own && wanted == GroupConstraint::Hold) return wanted;
      if (is_own && wanted != GroupConstraint::None) result = wanted;
    }
  return result;
}

bool SurfaceMorph::Impl::slides(const FreePatch& patch) const {
  if (patch.touched.empty()) return false;
  const GroupConstraint named = constraint(patch);
  if (named != GroupConstraint::None) return named == GroupConstraint::Slide;
  if (options.unmatched == UnmatchedPolicy::Slide) return true;
  return patch.is_planar && options.unmatched != UnmatchedPolicy::Fix;
}

void SurfaceMorph::Impl::find_forms() {
  for (FreePatch& patch : patches)
    if (!patch.is_planar && slides(patch))
      patch.form = std::make_shared<OwnSurface>(surface, patch.facets, tolerance);
}

void SurfaceMorph::Impl::move_corners(const ModelPair& pair, const CurveMaps& maps,
                                      Placement& placed) const {
  const Similarity& a = pair.match.alignment;
  for (const RowId n : association.dimension.ids()) {
    if (association.dimension[n] != CadDimension::Vertex) continue;
    placed.feet.row(n) = map_vertex(pair, maps, association.vertex(n));
    placed.offsets.row(n) = a.rotation * offsets.row(n).transpose();
  }
}

void SurfaceMorph::Impl::move_edges(const ModelPair& pair, const CurveMaps& maps,
                                    Placement& placed) const {
  const Similarity& a = pair.match.alignment;
  parallel_for(placed.feet.rows(), 256, [&](Index begin, Index end) {
    for (RowId n(begin); n < end; ++n) {
      if (association.dimension[n] != CadDimension::Edge) continue;
      const EdgeId edge = association.edge(n);
      const CurveLocation l =
          maps[pair.base.skeleton().curve_of_edge[edge]]({edge, association.t(n)});
      placed.feet.row(n) = pair.variant.evaluate_edge(l.edge, l.t).point;
      placed.uv.row(n) << l.t, 0;
      placed.entity[n] = l.edge;
      placed.offsets.row(n) = a.rotation * offsets.row(n).transpose();
    }
  });
}

// The sides of a periodic or extruded mesh that move.
std::vector<ImagePair> SurfaceMorph::Impl::image_faces(const ModelPair& pair,
                                                       const Points& moved) const {
  std::vector<Sheet> sheets;
  for (const FaceId f : faces.ids()) {
    const FaceNodes& nodes = faces[f];
    Sheet sheet;
    sheet.facets = nodes.facets;
    sheet.is_planar = base->faces()[f].type == SurfaceType::Plane &&
                      pair.variant.faces()[pair.match.faces[f]].type == SurfaceType::Plane;
    if (!(moved - surface.points)(nodes.rows, Eigen::all).isZero(0)) sheet.inner = nodes.rows;
    sheet.border = nodes.around;
    sheets.push_back(std::move(sheet));
  }
  return find_image_pairs(surface, moved, sheets, tolerance);
}

// They move alike, whatever the parameters of the CAD say of the second: within its own edge or
// face.
void SurfaceMorph::Impl::place_images(const ModelPair& pair, const std::vector<ImagePair>& images,
                                      Placement& placed) const {
  const Points moved = surface.points + (placed.feet - feet);
  for (const ImagePair& found : images) {
    for (std::size_t i = 0; i < found.inner; ++i) {
      const RowId to = found.to[i];
      const int entity = placed.entity[to];
      const Vector3d motion = found.place(surface, moved, i) - moved.row(to).transpose();
      if (motion.norm() <= kWayRounding * tolerance || entity < 0 || to == found.from[i]) continue;
      const Vector3d place = placed.feet.row(to).transpose() + motion;
      const Vector2d uv = placed.uv.row(to);
      if (association.dimension[to] == CadDimension::Face) {
        const FaceFoot foot = project_on_face(pair.variant, FaceId(entity), place, uv);
        placed.feet.row(to) = foot.point;
        placed.uv.row(to) = foot.uv;
      } else {
        const EdgeFoot foot = project_on_edge(pair.variant, EdgeId(entity), place, uv[0]);
        placed.feet.row(to) = foot.point;
        placed.uv.row(to) << foot.t, 0;
      }
    }
  }
}

// Of the nodes on faces: how far the warp put them on the carrier surface beyond the trimmed face.
VectorXd SurfaceMorph::Impl::distances_beyond_wires(const ModelPair& pair,
                                                    const Placement& placed) const {
  VectorXd distances = VectorXd::Zero(placed.feet.rows());
  parallel_for(distances.size(), 256, [&](Index begin, Index end) {
    for (RowId n(begin); n < end; ++n) {
      if (association.dimension[n] != CadDimension::Face) continue;
      const FaceId face(placed.entity[n]);
      const double distance = distance_to_trimmed(pair.variant, face, placed.uv.row(n));
      if (distance > pair.variant.faces()[face].tolerance + kOnEntity * surface.local_length[n])
        distances[n] = distance;
    }
  });
  return distances;
}

// Least ratio of a facet edge's new length to its old one round a node: the scale of a similarity,
// and no growth where the surface stretches one way only.
double SurfaceMorph::Impl::least_stretch(RowId row, const Points& moved_feet) const {
  double least = std::numeric_limits<double>::infinity();
  if (offsets.row(row).isZero(0)) return 1;
  for (const FacetId f : surface.facets_at(row))
    for (const RowId other : surface.facets[f]) {
      if (association.dimension[other] == CadDimension::None) continue;
      const double before = (feet.row(other) - feet.row(row)).norm();
      if (before > 0)
        least = std::min(least, (moved_feet.row(other) - moved_feet.row(row)).norm() / before);
    }
  return std::isfinite(least) ? least : 1;
}

// Nodes amid straight edges and facets stay amid them.
void SurfaceMorph::Impl::move_amid(Points& moved) const {
  for (const RowId n : association.is_amid.ids())
    if (association.is_amid[n])
      moved.row(n) += surface.middle(n, moved) - surface.middle(n, surface.points);
}

// Makes images exact to rounding, except where the CAD's own faces move otherwise.
void SurfaceMorph::Impl::settle_images(const std::vector<ImagePair>& images, Points& moved) const {
  for (const ImagePair& pair : images)
    for (std::size_t i = 0; i < pair.to.size(); ++i) {
      const Vector3d place = pair.place(surface, moved, i);
      if (pair.to[i] != pair.from[i] &&
          (place - moved.row(pair.to[i]).transpose()).norm() <= kSameMotion * tolerance)
        moved.row(pair.to[i]) = place;
    }
}

// The sides that are named as periodic, with the period they have at `moved`.
std::vector<ImagePair> SurfaceMorph::Impl::named_pairs(const std::vector<PeriodicSides>& sides,
                                                       const Points& moved) const {
  std::vector<ImagePair> pairs;
  for (const PeriodicSides& each : sides)
    pairs.push_back(with_period_at(each, surface, association, moved));
  return pairs;
}

// Nodes on no CAD face alone.
void SurfaceMorph::Impl::follow_named(Points& moved) const {
  const std::vector<ImagePair> pairs = named_pairs(periodic, moved);
  for (std::size_t k = 0; k < pairs.size(); ++k)
    for (std::size_t i = 0; i < pairs[k].to.size(); ++i)
      if (!periodic[k].is_given[i] && pairs[k].to[i] != pairs[k].from[i])
        moved.row(pairs[k].to[i]) = pairs[k].place(surface, moved, i);
}

std::vector<FreePatch> SurfaceMorph::Impl::sliding_patches() const {
  std::vector<FreePatch> result;
  for (const FreePatch& patch : patches)
    if (constraint(patch) != GroupConstraint::Follow && slides(patch)) result.push_back(patch);
  return result;
}

// Returns the pairs of patches that are images of each other.
std::vector<ImagePair> SurfaceMorph::Impl::slide(Points& moved) const {
  std::vector<Sheet> sheets;
  for (const FreePatch& patch : sliding_patches()) {
    slide_patch(surface, patch, moved);
    std::vector<RowId> border = patch.touched;
    border.insert(border.end(), patch.border.begin(), patch.border.end());
    sheets.push_back({patch.inner, std::move(border), patch.facets, patch.is_planar});
  }
  auto pairs = find_image_pairs(surface, moved, sheets, tolerance);
  for (const ImagePair& pair : pairs)
    for (std::size_t i = 0; i < pair.inner; ++i)
      moved.row(pair.to[i]) = pair.place(surface, moved, i);
  return pairs;
}

// Those that stay fixed, unasked, though what moves touches them.
Index SurfaceMorph::Impl::dragged_patches(const Points& moved) const {
  return std::ranges::count_if(patches, [&](const FreePatch& patch) {
    return !slides(patch) && constraint(patch) == GroupConstraint::None &&
           std::ranges::any_of(patch.touched, [&](RowId n) {
             return (moved.row(n) - surface.points.row(n)).norm() > tolerance;
           });
  });
}

// What the patches on no CAD face do; empty where there are none.
std::string SurfaceMorph::Impl::describe_patches(Index dragged) const {
  const auto follows = [&](const FreePatch& patch) {
    return constraint(patch) == GroupConstraint::Follow;
  };
  const auto slid = sliding_patches().size();
  const auto fixed = patches.size() - slid - std::ranges::count_if(patches, follows);
  if (slid + fixed == 0) return {};
  const bool has_taken = std::ranges::any_of(constraints, is_taken_from_cad);
  std::string text = std::to_string(association.unmatched_nodes) + " surface nodes " +
                     (has_taken ? "are held, rigid or" : "lie") +
                     " on no CAD face: " + std::to_string(fixed) + " patches stay fixed, " +
                     std::to_string(slid) + " slide along their surface (" +
                     words_for(Remedy::Unmatched) + ")";
  if (dragged > 0)
    text += "; what moves touches " + std::to_string(dragged) +
            " of the fixed ones, which may slide, too (" + words_for(Remedy::SlideUnmatched) + ")";
  return text;
}

// Held nodes that the variant's CAD leaves behind; empty where there are none.
std::string SurfaceMorph::Impl::describe_held(const ModelPair& pair) const {
  Index count = 0;
  double most = 0;
  for (const HeldNode& node : held) {
    const FaceId face = pair.match.faces[node.face];
    const Vector3d x = surface.points.row(node.row);
    const double allowed = (base->evaluate(node.face, node.uv).point - x).norm() +
                           pair.variant.faces()[face].tolerance +
                           kOnEntity * surface.local_length[node.row];
    double after = project_on_face(pair.variant, face, x, node.uv).distance;
    if (after > allowed) after = project_globally(pair.variant, face, x).distance;
    if (after <= allowed) continue;
    ++count;
    most = std::max(most, after);
  }
  if (count == 0) return {};
  std::ostringstream text;
  text << count << " held nodes lie off the variant's CAD, by up to " << most
       << " mm: where they were held, it changed";
  return text.str();
}

SurfaceMorph::SurfaceMorph(const std::shared_ptr<const CadModel>& base, const Mesh& mesh,
                           const Boundary& boundary, const SurfaceMorphOptions& options)
    : SurfaceMorph(base, mesh, boundary,
                   associate(*base, mesh, boundary, for_association(mesh, options)), options) {}

SurfaceMorph::SurfaceMorph(std::shared_ptr<const CadModel> base, const Mesh& mesh,
                           const Boundary& boundary, Association association,
                           SurfaceMorphOptions options)
    : impl_(std::make_unique<Impl>()) {
  impl_->base = std::move(base);
  impl_->options = std::move(options);
  impl_->association = std::move(association);
  impl_->start = mesh.points(boundary.nodes, Eigen::all);
  require_groups_on_boundary(mesh, boundary, impl_->options.groups);
  impl_->constraints = find_constraints(mesh, boundary, impl_->options.groups);
  for (const RowId row : impl_->association.stranded)
    if (impl_->constraints[row] == GroupConstraint::None)
      impl_->constraints[row] = GroupConstraint::Follow;
  impl_->surface = make_surface_mesh(mesh, boundary, impl_->association.mesh_unit_mm);
  const BodiesInGroups bodies = find_bodies_in_rigid_groups(
      mesh, boundary, impl_->surface, impl_->options.groups.rigid, impl_->association);
  for (const auto& [group, rows] : bodies)
    for (const RowId row : rows)
      if (impl_->constraints[row] == GroupConstraint::Rigid)
        impl_->constraints[row] = GroupConstraint::None;
  impl_->held = held_on_faces(impl_->constraints, impl_->association);
  // Before constraints take nodes off the CAD: their faces would look like cracks.
  impl_->crack = describe_cracks(mesh, impl_->surface, boundary, impl_->association);
  if (!impl_->options.groups.is_empty())
    apply_constraints(impl_->constraints, boundary, impl_->association);
  impl_->tolerance = plane_tolerance(impl_->surface);
  impl_->patches =
      find_free_patches(impl_->surface, boundary, impl_->association,
                        mark_patches(mesh, boundary, impl_->options.groups, impl_->constraints));
  impl_->rigid = find_rigid_groups(mesh, boundary, impl_->surface, impl_->association,
                                   impl_->options.groups.rigid, bodies);
  IdVector<RowId, char> held(impl_->constraints.size());
  std::ranges::transform(impl_->constraints, held.begin(), is_taken_from_cad);
  const MeshOnCad on_cad{mesh, boundary, impl_->surface, impl_->association, held};
  impl_->periodic = find_periodic_sides(on_cad, impl_->options.groups.periodic);
  std::vector<std::string> unpaired;
  for (PeriodicSides& sides : find_sides_of_file(on_cad, impl_->options.groups, unpaired))
    impl_->periodic.push_back(std::move(sides));
  impl_->find_forms();
  impl_->idle = describe_idle_groups(mesh, boundary, impl_->options.groups, impl_->association,
                                     impl_->patches);
  std::ranges::move(unpaired, std::back_inserter(impl_->idle));
  if (impl_->association.stray_nodes > 0)
    impl_->idle.push_back(describe_strays(mesh, boundary, impl_->association));
  if (!impl_->association.stranded.empty())
    impl_->idle.push_back(describe_stranded(mesh, boundary, impl_->association));
  // With regions, who holds an interface takes its facets from the CAD.
  if (mesh.regions.empty())
    if (std::string text = describe_face_off_mesh(*impl_->base, impl_->association); !text.empty())
      impl_->idle.push_back(std::move(text));
  impl_->check_policy();
  impl_->find_feet();
  impl_->find_offsets();
  impl_->joints = find_joints(*impl_->base, impl_->surface, impl_->association);
  impl_->faces = collect_face_nodes(*impl_->base, impl_->surface, impl_->association, impl_->joints,
                                    impl_->feet);
}

SurfaceMorph::~SurfaceMorph() = default;
SurfaceMorph::SurfaceMorph(SurfaceMorph&&) noexcept = default;
SurfaceMorph& SurfaceMorph::operator=(SurfaceMorph&&) noexcept = default;

const Association& SurfaceMorph::association() const { return impl_->association; }

SurfaceMorphResult SurfaceMorph::morph(const CadModel& variant, const TopologyMatch& match) const {
  // Sides that only the mesh file pairs are no pair where they are not a period apart in the
  // variant.
  std::vector<PeriodicSides> sides = impl_->periodic;
  std::vector<std::string> warnings;
  for (;;) {
    std::vector<std::string> apart;  // of each pair what is wrong
    SurfaceMorphResult result = impl_->morph(variant, match, sides, apart);
    std::vector<PeriodicSides> left;
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (apart[i].empty())
        left.push_back(std::move(sides[i]));
      else
        warnings.push_back(std::move(apart[i]));
    if (left.size() == sides.size()) {
      std::ranges::move(warnings, std::back_inserter(result.warnings));
      return result;
    }
    sides = std::move(left);
  }
}

// `apart`: of each of `sides` why it is not periodic in the variant; empty where it is.
SurfaceMorphResult SurfaceMorph::Impl::morph(const CadModel& variant, const TopologyMatch& match,
                                             const std::vector<PeriodicSides>& sides,
                                             std::vector<std::string>& apart) const {
  const Impl& self = *this;
  const CadModel base = match.joins_edges ? self.base->with_joined_edges() : *self.base;
  const CadModel joined = match.joins_edges ? variant.with_joined_edges() : variant;
  const MotionPrediction prediction(base, joined, match);
  const ModelPair pair{base, joined, match, prediction};
  CurveMaps maps = map_curves(pair);
  join_curves(pair, self.joints, self.association, maps);
  Placement placed(self.feet);
  self.move_corners(pair, maps, placed);
  self.move_edges(pair, maps, placed);
  for (const auto& [row, to] :
       cross_faces(pair, maps, self.joints, self.faces, {self.surface, self.feet, placed.feet}))
    placed.cross(row, to);
  SurfaceMorphResult result;
  PlacedFaces placed_faces = FacePlacement(pair, maps, self.base_placement()).place_all(placed);
  result.folded_facets = std::move(placed_faces.folded);
  result.remedies = std::move(placed_faces.remedies);
  const auto images = self.image_faces(pair, self.surface.points + (placed.feet - self.feet));
  self.place_images(pair, images, placed);
  const auto named = self.named_pairs(sides, self.surface.points + (placed.feet - self.feet));
  self.place_images(pair, named, placed);
  const PartedJoints left = settle_junctions(
      joined, self.sliding_patches(), self.association,
      {self.options.snap ? self.surface.points : self.feet, self.tolerance / kSamePlane}, placed);
  for (const RowId n : placed.entity.ids())
    placed.offsets.row(n) *= self.least_stretch(n, placed.feet);
  Points moved = placed.feet + placed.offsets;
  self.move_amid(moved);
  self.settle_images(images, moved);
  result.notes = move_rigid_groups(self.surface, self.rigid, moved);
  if (left.nodes > 0) result.warnings.push_back(describe_left_patches(left));
  result.parted = find_parted_joints(pair, maps, self.joints, self.surface, placed.feet);
  if (result.parted.nodes > 0) result.warnings.push_back(describe_parted_joints(result.parted));
  if (!self.crack.empty()) result.warnings.push_back(self.crack);
  if (std::string text = self.describe_held(pair); !text.empty())
    result.warnings.push_back(std::move(text));
  result.warnings.insert(result.warnings.end(), self.idle.begin(), self.idle.end());
  auto slid = self.slide(moved);
  const Points before = moved;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    apart.push_back(place_second_side(sides[i], named[i], self.surface, moved));
    result.notes.push_back(describe(sides[i], named[i]));
  }
  result.periodic = nodes_of(named);
  result.dragged_patches = self.dragged_patches(moved);
  if (std::string text = self.describe_patches(result.dragged_patches); !text.empty())
    result.warnings.push_back(std::move(text));
  slid.insert(slid.end(), images.begin(), images.end());
  slid.insert(slid.end(), named.begin(), named.end());
  result.images = std::move(slid);
  result.jointed = self.joints.nodes;
  for (const Joints::Crossing& crossing : self.joints.crossings)
    result.crossing.push_back(crossing.node);
  result.positions = moved / self.association.mesh_unit_mm;
  keep_still(self.start, result.positions);
  result.beyond_wires = self.distances_beyond_wires(pair, placed);
  result.entity = std::move(placed.entity);
  result.uv = std::move(placed.uv);
  result.distance = result.beyond_wires;
  for (const RowId n : result.entity.ids())
    if (self.association.dimension[n] != CadDimension::None)
      result.distance[n] += placed.offsets.row(n).norm() + (moved.row(n) - before.row(n)).norm();
  return result;
}

std::vector<FacetId> SurfaceMorph::folds_left(const CadModel& variant, const TopologyMatch& match,
                                              const SurfaceMorphResult& moved,
                                              const Points& positions) const {
  const Points points = positions * impl_->association.mesh_unit_mm;
  std::set<FaceId> faces;
  for (const FacetId f : moved.folded_facets) faces.insert(impl_->association.facet_face[f]);
  std::vector<FacetId> result;
  for (const FaceId face : faces) {
    const FaceNodes& nodes = impl_->faces[face];
    const Parameters uv = moved.uv(nodes.rows, Eigen::all);
    const auto folds = nodes.folds.find(impl_->surface, {variant, match.faces[face], uv, points});
    result.insert(result.end(), folds.begin(), folds.end());
  }
  return result;
}

Points SurfaceMorph::slide(const Points& positions) const {
  const Impl& self = *impl_;
  Points moved = positions * self.association.mesh_unit_mm;
  for (const FreePatch& patch : self.sliding_patches())
    moved(patch.inner, Eigen::all) = self.surface.points(patch.inner, Eigen::all);
  self.slide(moved);
  self.follow_named(moved);
  Points result = positions;
  for (const FreePatch& patch : self.sliding_patches())
    for (const auto* nodes : {&patch.inner, &patch.border})
      result(*nodes, Eigen::all) = moved(*nodes, Eigen::all) / self.association.mesh_unit_mm;
  return result;
}

std::vector<std::vector<RowId>> SurfaceMorph::nodes_of_sliding_patches() const {
  std::vector<std::vector<RowId>> result;
  for (const FreePatch& patch : impl_->sliding_patches()) result.push_back(patch.inner);
  return result;
}

Points SurfaceMorph::onto_sliding_patches(const Points& from, const Points& to) const {
  const double unit = impl_->association.mesh_unit_mm;
  Points result = to;
  for (const FreePatch& patch : impl_->sliding_patches())
    for (const RowId n : patch.inner)
      result.row(n) = onto_patch(patch, n, unit * from.row(n), unit * to.row(n)) / unit;
  return result;
}

SlideDerivative SurfaceMorph::slide_derivative(const Points& positions) const {
  return {impl_->surface, impl_->sliding_patches(), positions * impl_->association.mesh_unit_mm};
}

}  // namespace cadmorph
