#include "surface/junctions.h"

#include <algorithm>
#include <map>

#include "cad/projector.h"
#include "core/least_squares.h"
#include "surface/patch_slide.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Orthonormal tangents of a face or an edge, columns; all directions where it has none.
Matrix3Xd tangents(const CadModel& model, int entity, bool is_face, const Vector2d& uv) {
  if (!is_face) return model.evaluate_edge(EdgeId(entity), uv[0]).dt.normalized();
  const SurfacePoint s = model.evaluate(FaceId(entity), uv);
  const Matrix3d all = surface_frame(s);
  return all.isIdentity(0) ? Matrix3Xd(all) : Matrix3Xd(all.leftCols<2>());
}

// The least step along tangents (columns, orthonormal) that, to first order, is each of the ways
// (columns) long in its direction.
Vector3d step_along(const Matrix3Xd& tangents, const Matrix3Xd& ways) {
  const VectorXd lengths = ways.colwise().norm();
  Matrix3Xd directions = ways;
  for (Index i = 0; i < ways.cols(); ++i) directions.col(i).normalize();
  const Eigen::MatrixXd parts = directions.transpose() * tangents;
  return tangents * least_squares(parts, lengths);
}

}  // namespace

PartedJoints settle_junctions(const CadModel& variant, const std::vector<FreePatch>& sliding,
                              const Association& association, const JunctionNodes& nodes,
                              Placement& placed) {
  constexpr int kMostSteps = 50;  // projections in turn, which halve what is left at 45 degrees
  // Times what the node is off the patch: surfaces that meet at 15 degrees.
  constexpr double kFarthest = 4;
  const double rounding = kWayRounding * nodes.size;
  std::map<RowId, std::vector<const FreePatch*>> patches_of;
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
    const Vector3d from = nodes.base.row(n);
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

}  // namespace cadmorph
