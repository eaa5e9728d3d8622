#include "surface/surface_morph.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <sstream>

#include "cad/projector.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/remedies.h"
#include "surface/curve_maps.h"
#include "surface/face_folds.h"
#include "surface/face_map.h"
#include "surface/face_nodes.h"
#include "surface/face_unfold.h"
#include "surface/free_patches.h"
#include "surface/image_pairs.h"
#include "surface/joint_motion.h"
#include "surface/joints.h"
#include "surface/node_feet.h"
#include "surface/periodic_sides.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kRounding = 1e-13;  // of the largest coordinate, of some 1e-16 an operation
constexpr int kMostSteps = 8;
// Rings of facets round folded ones that are laid out anew, before the whole face is. With 8, cells
// behind facets that are no longer folded were (bore hex at 150 %).
constexpr int kLeastRings = 16, kMostRings = 32;
constexpr int kRefinement = 4;

// Orthonormal frame of a surface: tangent, bitangent, normal. Identity at a pole.
Matrix3d frame(const SurfacePoint& s) {
  const Vector3d cross = s.du.cross(s.dv);
  Matrix3d f = Matrix3d::Identity();
  if (cross.norm() <= 1e-12 * s.du.norm() * s.dv.norm() || cross.norm() == 0) return f;
  f.col(0) = s.du.normalized();
  f.col(2) = cross.normalized();
  f.col(1) = f.col(2).cross(f.col(0));
  return f;
}

// Orthonormal tangents of a face or an edge, columns; all directions where it has none.
Matrix3Xd tangents(const CadModel& model, int entity, bool is_face, const Vector2d& uv) {
  if (!is_face) return model.evaluate_edge(EdgeId(entity), uv[0]).dt.normalized();
  const SurfacePoint s = model.evaluate(FaceId(entity), uv);
  const Matrix3d all = frame(s);
  return all.isIdentity(0) ? Matrix3Xd(all) : Matrix3Xd(all.leftCols<2>());
}

// The least step along tangents (columns, orthonormal) that, to first order, is each of the ways
// (columns) long in its direction.
Vector3d step_along(const Matrix3Xd& tangents, const Matrix3Xd& ways) {
  const VectorXd lengths = ways.colwise().norm();
  Matrix3Xd directions = ways;
  for (Index i = 0; i < ways.cols(); ++i) directions.col(i).normalize();
  const Eigen::MatrixXd parts = directions.transpose() * tangents;
  return tangents * parts.completeOrthogonalDecomposition().solve(lengths);
}

std::string describe(const PartedJoints& parted) {
  std::ostringstream text;
  text << parted.nodes
       << " nodes where parts meet without an edge lie on one of them only, by up to "
       << parted.distance << " mm off the other: do the parts still meet in the variant?";
  return text.str();
}

// Surface nodes on the variant CAD, their entities and parameters there, and what they keep of
// their offset from the base CAD, turned with the entity but not yet stretched. Millimetres.
struct Placement {
  explicit Placement(Points base_feet)
      : feet(std::move(base_feet)),
        offsets(Points::Zero(feet.rows(), 3)),
        uv(Parameters::Zero(feet.rows(), 2)),
        entity(feet.rows(), -1),
        is_crossing(feet.rows(), 0) {}

  Placement rows(const std::vector<RowId>& nodes) const {
    Placement result(feet(nodes, Eigen::all));
    result.offsets = offsets(nodes, Eigen::all);
    result.uv = uv(nodes, Eigen::all);
    return result;
  }
  void set_rows(const std::vector<RowId>& nodes, const Placement& values) {
    feet(nodes, Eigen::all) = values.feet;
    offsets(nodes, Eigen::all) = values.offsets;
    uv(nodes, Eigen::all) = values.uv;
  }

  void cross(RowId row, const Vector3d& to) {
    feet.row(row) = to;
    is_crossing[row] = 1;
  }

  Points feet, offsets;
  Parameters uv;                      ///< face (u, v), edge (t, 0)
  IdVector<RowId, int> entity;        ///< variant face or edge; -1
  IdVector<RowId, char> is_crossing;  ///< on several faces: the foot stays
};

// A node that moved by no more than the rounding of its way through the CAD has not moved.
void keep_still(const Points& start, Points& positions) {
  const double least = kRounding * start.cwiseAbs().maxCoeff();
  for (Index n = 0; n < start.rows(); ++n)
    if ((positions.row(n) - start.row(n)).cwiseAbs().maxCoeff() <= least)
      positions.row(n) = start.row(n);
}

// Where the warp puts a node, unless it has its place already.
Vector2d place_on_face(const CadModel& variant, FaceId face, const Placement& placed, RowId row,
                       const Vector2d& warped) {
  if (!placed.is_crossing[row]) return warped;
  return project_on_face(variant, face, placed.feet.row(row), warped).uv;
}

std::string describe_left_patches(const PartedJoints& left) {
  std::ostringstream text;
  text << left.nodes
       << " nodes where the CAD meets a part of the mesh that slides went with the CAD, by up to "
       << left.distance << " mm off that part: the two hardly meet there in the variant";
  return text.str();
}

std::string text_of(const Vector3d& point) {
  std::ostringstream text;
  text << point.transpose();
  return text.str();
}

// The first face between two solids that no facet of the mesh lies on.
FaceId face_between_solids_off_mesh(const CadModel& base, const Association& association) {
  IdVector<FaceId, char> is_met(base.faces().size(), 0);
  for (const FaceId face : association.facet_face)
    if (face >= 0) is_met[face] = 1;
  for (const FaceId f : is_met.ids())
    if (base.faces()[f].other_solid >= 0 && !is_met[f]) return f;
  return {};
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

std::string describe_strays(const Mesh& mesh, const Boundary& boundary, const Association& found) {
  const RowId row = found.farthest_stray;
  std::ostringstream text;
  text.precision(4);
  text << found.stray_nodes
       << " surface nodes lie farther off the CAD than the tolerance, by up to "
       << found.distance[row] << " mm (" << node_name(mesh, boundary.nodes[row])
       << "): amid nodes that lie on it they go with what is nearest, as far off as they are ("
       << words_for(Remedy::Snap) << " puts them on it)";
  return text.str();
}

std::string describe_stranded(const Mesh& mesh, const Boundary& boundary,
                              const Association& found) {
  std::ostringstream text;
  text << found.stranded.size()
       << " surface nodes lie on no CAD face, amid others that do (such as "
       << node_name(mesh, boundary.nodes[found.stranded.front()])
       << "): they go with the volume beside them";
  return text.str();
}

std::string name_of(const CadModel& base, const TopologyMatch& match, FaceId face) {
  return "face " + std::to_string(face + 1) + " (" + to_string(base.faces()[face].type) +
         ", variant face " + std::to_string(match.faces[face] + 1) + ")";
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

  void find_feet();
  void find_offsets();
  void find_forms();
  void check_policy() const;
  GroupConstraint constraint(const FreePatch& patch) const;
  bool slides(const FreePatch& patch) const;

  void move_corners(const ModelPair& pair, const CurveMaps& maps, Placement& placed) const;
  void move_edges(const ModelPair& pair, const CurveMaps& maps, Placement& placed) const;
  FaceMotion motion_of(const FaceNodes& nodes, const CurveMaps& maps,
                       const Placement& placed) const;
  void move_faces(const ModelPair& pair, const CurveMaps& maps, Placement& placed,
                  SurfaceMorphResult& result) const;
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
  PartedJoints settle_junctions(const CadModel& variant, Placement& placed) const;
  void unfold(const ModelPair& pair, const CurveMaps& maps, FaceId face,
              const FaceMapResult& mapped, Placement& placed, SurfaceMorphResult& result) const;
  void place(const ModelPair& pair, FaceId face, FaceMapResult& mapped, Placement& placed) const;
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
        offsets.row(n) *= frame(base->evaluate(association.face(n), association.uv.row(n)));
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

// Whether the outside of a face is that of another solid than in the base: between two solids.
bool is_seen_from_the_other(const ModelPair& pair, FaceId face) {
  const CadFace& shared = pair.base.faces()[face];
  if (shared.other_solid < 0) return false;
  for (const FaceId f : pair.match.faces.ids()) {
    const CadFace& own = pair.base.faces()[f];
    if (own.solid == shared.solid && own.other_solid < 0)
      return pair.variant.faces()[pair.match.faces[f]].solid !=
             pair.variant.faces()[pair.match.faces[face]].solid;
  }
  return false;
}

// The edges of quadratic cells that are straight within a plane face stay so; `mapped` takes that.
void SurfaceMorph::Impl::place(const ModelPair& pair, FaceId face, FaceMapResult& mapped,
                               Placement& placed) const {
  const FaceNodes& nodes = faces[face];
  const FaceId variant = pair.match.faces[face];
  const bool is_turned_over =
      (base->faces()[face].is_reversed != pair.variant.faces()[variant].is_reversed) !=
      is_seen_from_the_other(pair, face);
  parallel_for(nodes.uv.rows(), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const RowId n = nodes.rows[static_cast<std::size_t>(i)];
      const Vector2d uv = place_on_face(pair.variant, variant, placed, n, mapped.uv.row(i));
      const SurfacePoint to = pair.variant.evaluate(variant, uv);
      Vector3d offset = offsets.row(n);
      if (is_turned_over) offset.tail<2>() *= -1;
      placed.feet.row(n) = to.point;
      placed.offsets.row(n) = frame(to) * offset;
      placed.uv.row(n) = uv;
      placed.entity[n] = variant;
    }
  });
  if (pair.variant.faces()[variant].type != SurfaceType::Plane) return;
  for (const Index i : nodes.straight) {
    const RowId n = nodes.rows[i];
    if (placed.is_crossing[n]) continue;
    // What the file's digits leave between node and middle stays.
    const Vector3d off = feet.row(n).transpose() - surface.middle(n, feet);
    const Vector3d middle = surface.middle(n, placed.feet);
    const FaceFoot foot = project_on_face(
        pair.variant, variant, middle + pair.match.alignment.rotation * off, placed.uv.row(n));
    placed.feet.row(n) = foot.point;
    placed.uv.row(n) = mapped.uv.row(i) = foot.uv;
  }
}

// Once corners and edges are placed.
FaceMotion SurfaceMorph::Impl::motion_of(const FaceNodes& nodes, const CurveMaps& maps,
                                         const Placement& placed) const {
  return {maps, feet(nodes.joints, Eigen::all), placed.feet(nodes.joints, Eigen::all),
          nodes.border};
}

// All faces are placed before any is judged: a facet may have nodes of several.
void SurfaceMorph::Impl::move_faces(const ModelPair& pair, const CurveMaps& maps, Placement& placed,
                                    SurfaceMorphResult& result) const {
  IdVector<FaceId, FaceMapResult> mapped(faces.size());
  parallel_for(std::ssize(faces), 1, [&](Index begin, Index end) {
    for (FaceId f(begin); f < end; ++f)
      if (const FaceNodes& nodes = faces[f]; !nodes.rows.empty())
        mapped[f] =
            map_face(*nodes.domain, pair, motion_of(nodes, maps, placed), nodes.uv, nodes.points);
  });
  for (const FaceId f : faces.ids())
    if (!faces[f].rows.empty()) place(pair, f, mapped[f], placed);
  for (const FaceId f : faces.ids())
    if (!faces[f].rows.empty()) unfold(pair, maps, f, mapped[f], placed, result);
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
      if (motion.norm() <= kRounding * tolerance || entity < 0 || to == found.from[i]) continue;
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

// Replaces a folded map by a finer one, or by projection, where that folds less.
void SurfaceMorph::Impl::unfold(const ModelPair& pair, const CurveMaps& maps, FaceId face,
                                const FaceMapResult& mapped, Placement& placed,
                                SurfaceMorphResult& result) const {
  const FaceNodes& nodes = faces[face];
  const FaceMotion motion = motion_of(nodes, maps, placed);
  const FaceId variant = pair.match.faces[face];
  std::string note = mapped.note;
  const auto find = [&](const Parameters& uv) {
    return nodes.folds.find(surface, {pair.variant, variant, uv, placed.feet});
  };
  std::vector<FacetId> folds = find(mapped.uv);
  // Keeps the other map where it folds less. One that fails leaves what is there.
  const auto improve = [&](const std::function<FaceMapResult()>& map, const char* how) {
    try {
      FaceMapResult other = map();
      const Placement kept = placed.rows(nodes.rows);
      place(pair, face, other, placed);
      auto remaining = find(other.uv);
      if (remaining.size() < folds.size()) {
        folds = std::move(remaining);
        note = how;
      } else {
        placed.set_rows(nodes.rows, kept);
      }
    } catch (const SolverError&) {  // wires that pass through each other on their way, many samples
    }
  };
  if (!folds.empty())
    improve(
        [&] {
          const FaceDomain fine(*base, face, kRefinement * nodes.samples_per_curve, nodes.joint_uv,
                                nodes.uv);
          return map_face(fine, pair, motion, nodes.uv, nodes.points);
        },
        "wires sampled finer");
  const auto lay_out = [&](int rings) {
    const Parameters start = placed.uv(nodes.rows, Eigen::all);
    const FaceSide folded{pair.variant, variant, start, placed.feet};
    return FaceMapResult{
        .uv = rings > 0 ? unfold_face(surface, nodes.facets, nodes.rows, folded, folds, rings)
                        : unfold_face(surface, nodes.facets, nodes.rows, folded)};
  };
  const char* const laid_out = "facets of a folded map laid out anew";
  for (int steps = 2; !folds.empty() && steps <= kMostSteps && !nodes.domain->is_closed();
       steps *= 2)
    improve([&] { return map_face(*nodes.domain, pair, motion, nodes.uv, nodes.points, steps); },
            "motion of the wires split into steps");
  for (int rings = kLeastRings; !folds.empty() && rings <= kMostRings && !nodes.domain->is_closed();
       rings *= 2)
    improve([&] { return lay_out(rings); }, laid_out);
  if (!folds.empty() && !mapped.is_projected)
    improve([&] { return project_face(*nodes.domain, pair, motion, nodes.points); },
            "parameter warp folded, predicted positions projected instead");
  if (!folds.empty() && !nodes.domain->is_closed()) improve([&] { return lay_out(0); }, laid_out);
  result.folded_facets.insert(result.folded_facets.end(), folds.begin(), folds.end());
  if (folds.empty() && !note.empty())
    result.remedies[note].push_back(name_of(pair.base, pair.match, face));
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

// Images to rounding, but where the CAD's own faces are none.
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

// Nodes on the CAD and on a patch that slides stay on both: on a symmetry plane that cuts a face,
// on a hub that a blade goes through. Least steps along the CAD's tangents onto the patches, and
// from there back to the CAD; where they don't meet nearby, the CAD's place counts. Returns how
// many nodes that are, and by how much they leave their patches.
PartedJoints SurfaceMorph::Impl::settle_junctions(const CadModel& variant,
                                                  Placement& placed) const {
  constexpr int kMostSteps = 50;  // projections in turn, which halve what is left at 45 degrees
  // Times what the node is off the patch: surfaces that meet at 15 degrees.
  constexpr double kFarthest = 4;
  const double rounding = kRounding * tolerance / kSamePlane;
  std::map<RowId, std::vector<const FreePatch*>> patches_of;
  const auto sliding = sliding_patches();
  for (const FreePatch& patch : sliding)
    for (const RowId n : patch.touched) patches_of[n].push_back(&patch);
  PartedJoints parted;
  for (const auto& entry : patches_of) {
    const RowId n = entry.first;
    const std::vector<const FreePatch*>& own = entry.second;
    if (placed.is_crossing[n] || placed.entity[n] < 0) continue;
    const bool is_on_face = association.dimension[n] == CadDimension::Face;
    const auto project = [&](const Vector3d& x, const Vector2d& uv) {
      if (is_on_face) return project_on_face(variant, FaceId(placed.entity[n]), x, uv);
      const EdgeFoot foot = project_on_edge(variant, EdgeId(placed.entity[n]), x, uv[0]);
      return FaceFoot{{foot.t, 0}, foot.point, foot.distance};
    };
    // The node itself is as far off as its foot is on the base.
    const Vector3d from = (options.snap ? surface.points : feet).row(n);
    const auto ways = [&](const Vector3d& x) {
      Matrix3Xd result(3, std::ssize(own));
      for (std::size_t i = 0; i < own.size(); ++i)
        result.col(Index(i)) = onto_patch(*own[i], n, from, x) - x;
      return result;
    };
    const Vector3d start = placed.feet.row(n);
    FaceFoot at{placed.uv.row(n), start, 0};
    Matrix3Xd way = ways(start);
    const double off = way.colwise().norm().maxCoeff();
    // What a node is off a curved patch has a direction of its own, which turns with the patch.
    double least = rounding;
    for (const FreePatch* patch : own)
      if (patch->form) least = std::max(least, (from - patch->form->foot(from, n).point).norm());
    if (off <= least) continue;
    for (int k = 0; k < kMostSteps && way.colwise().norm().maxCoeff() > least; ++k) {
      Vector3d step = step_along(tangents(variant, placed.entity[n], is_on_face, at.uv), way);
      if (step.norm() > off) step *= off / step.norm();
      at = project(at.point + step, at.uv);
      way = ways(at.point);
    }
    const double left = way.colwise().norm().maxCoeff();
    if (left > least || (at.point - start).norm() > kFarthest * off) {
      ++parted.nodes;
      parted.distance = std::max(parted.distance, off);
      continue;
    }
    placed.feet.row(n) = at.point;
    placed.uv.row(n) = at.uv;
  }
  return parted;
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
  // Before: what is taken from the CAD is no crack.
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
  impl_->periodic = find_periodic_sides(mesh, boundary, impl_->surface, impl_->association, held,
                                        impl_->options.groups.periodic);
  std::vector<std::string> unpaired;
  for (PeriodicSides& sides : find_sides_of_file(mesh, boundary, impl_->surface, impl_->association,
                                                 held, impl_->options.groups, unpaired))
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
  if (const FaceId face = face_between_solids_off_mesh(*impl_->base, impl_->association);
      face >= 0 && mesh.regions.empty())
    impl_->idle.push_back("face " + std::to_string(face + 1) + " of " + impl_->base->file_name() +
                          " lies between two solids, but the mesh has no regions: its nodes there "
                          "are moved as inner ones");
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
  // Sides that the mesh file alone pairs, and that the variant does not have a period apart, go as
  // if they were none.
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
  self.move_faces(pair, maps, placed, result);
  const auto images = self.image_faces(pair, self.surface.points + (placed.feet - self.feet));
  self.place_images(pair, images, placed);
  const auto named = self.named_pairs(sides, self.surface.points + (placed.feet - self.feet));
  self.place_images(pair, named, placed);
  const PartedJoints left = self.settle_junctions(joined, placed);
  for (const RowId n : placed.entity.ids())
    placed.offsets.row(n) *= self.least_stretch(n, placed.feet);
  Points moved = placed.feet + placed.offsets;
  self.move_amid(moved);
  self.settle_images(images, moved);
  result.notes = move_rigid_groups(self.surface, self.rigid, moved);
  if (left.nodes > 0) result.warnings.push_back(describe_left_patches(left));
  result.parted = find_parted_joints(pair, maps, self.joints, self.surface, placed.feet);
  if (result.parted.nodes > 0) result.warnings.push_back(describe(result.parted));
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

std::vector<std::string> describe_folds(const CadModel& base, const TopologyMatch& match,
                                        const Association& association,
                                        const std::vector<FacetId>& folded) {
  std::map<FaceId, int> counts;
  for (const FacetId f : folded) ++counts[association.facet_face[f]];
  std::vector<std::string> lines;
  for (const auto& [face, count] : counts)
    lines.push_back(name_of(base, match, face) + ": " + std::to_string(count) +
                    " of its facets are folded");
  return lines;
}

std::vector<std::string> describe_beyond_wires(const CadModel& base, const TopologyMatch& match,
                                               const Association& association,
                                               const VectorXd& beyond_wires) {
  std::map<FaceId, std::pair<int, double>> beyond;  // nodes and largest distance, by base face
  for (const RowId n : association.entity.ids())
    if (beyond_wires[n] > 0) {
      auto& [count, most] = beyond[association.face(n)];
      ++count;
      most = std::max(most, beyond_wires[n]);
    }
  std::vector<std::string> lines;
  for (const auto& [face, found] : beyond) {
    std::ostringstream text;
    text << name_of(base, match, face) << ": " << found.first
         << " of its nodes lie beyond its wires, by up to " << found.second << " mm";
    lines.push_back(text.str());
  }
  return lines;
}

}  // namespace cadmorph
