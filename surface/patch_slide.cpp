#include "surface/patch_slide.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kMaxCentres = 2000;  // a dense solve of a few tenths of a second

// Calls take(node, before, after, part) for the free nodes of a line, between those on either side.
void for_each_free(const SurfaceMesh& surface, const FreeLine& line, const auto& take) {
  const auto at = [&](std::size_t i) {
    return surface.points.row(line.nodes[i]).dot(line.direction);
  };
  for (std::size_t i = 0, j = 1; j < line.nodes.size(); ++j) {
    if (line.is_free[j]) continue;
    for (std::size_t k = i + 1; k < j; ++k)
      take(line.nodes[k], line.nodes[i], line.nodes[j],
           at(j) > at(i) ? (at(k) - at(i)) / (at(j) - at(i)) : 0);
    i = j;
  }
}

void slide_line(const SurfaceMesh& surface, const FreeLine& line, Points& moved) {
  const auto motion = [&](RowId node) {
    return (moved.row(node) - surface.points.row(node)).dot(line.direction);
  };
  for_each_free(surface, line, [&](RowId node, RowId before, RowId after, double part) {
    const double step = (1 - part) * motion(before) + part * motion(after);
    moved.row(node) = surface.points.row(node) + step * line.direction.transpose();
  });
}

// The field that moves the inner nodes of a patch: in its plane or, where it is curved, in space.
struct PatchField {
  Eigen::Matrix3Xd basis;
  Kernel kernel;
  std::vector<RowId> border;  // its centres
  RowMatrix centres, values, targets;
};

// None where nothing moves that the patch touches, and `is_needed` does not ask for it all the
// same.
std::optional<PatchField> patch_field(const SurfaceMesh& surface, const FreePatch& patch,
                                      const Points& moved, bool is_needed) {
  double largest = 0;
  for (const RowId n : patch.touched)
    largest = std::max(largest, (moved.row(n) - surface.points.row(n)).norm());
  if ((largest == 0 && !is_needed) || patch.inner.empty()) return {};
  std::vector<RowId> nodes = patch.touched;
  nodes.insert(nodes.end(), patch.border.begin(), patch.border.end());
  const std::size_t stride = (nodes.size() + kMaxCentres - 1) / kMaxCentres;
  PatchField field;
  if (patch.is_planar) {
    const Vector3d e1 = patch.normal.unitOrthogonal();
    field.basis.resize(3, 2);
    field.basis << e1, patch.normal.cross(e1);
    field.kernel = Kernel::biharmonic_2d();
  } else {
    field.basis = Eigen::Matrix3d::Identity();
    field.kernel = Kernel::triharmonic_3d();
  }
  for (std::size_t i = 0; i < nodes.size(); i += stride) field.border.push_back(nodes[i]);
  field.centres = surface.points(field.border, Eigen::all) * field.basis;
  field.values = (moved - surface.points)(field.border, Eigen::all) * field.basis;
  field.targets = surface.points(patch.inner, Eigen::all) * field.basis;
  return field;
}

// Moves the inner nodes of a patch by these displacements, along its surface. Returns the
// derivative of their places by the displacements where the surface is curved.
std::vector<Matrix3d> move_inner(const SurfaceMesh& surface, const FreePatch& patch,
                                 const RowMatrix& displacements, Points& moved) {
  std::vector<Matrix3d> slopes;
  for (Index i = 0; i < displacements.rows(); ++i) {
    const RowId n = patch.inner[static_cast<std::size_t>(i)];
    if (patch.is_planar) {
      moved.row(n) = surface.points.row(n) + displacements.row(i);
      continue;
    }
    const Vector3d x = surface.points.row(n);
    const OwnSurface::Foot to = patch.form->foot(x + displacements.row(i).transpose(), n);
    moved.row(n) = to.point + (x - patch.form->foot(x, n).point);
    slopes.push_back(to.slope);
  }
  return slopes;
}

}  // namespace

Vector3d onto_patch(const FreePatch& patch, RowId node, const Vector3d& from, const Vector3d& x) {
  if (patch.is_planar) return x - patch.normal.dot(x - from) * patch.normal;
  return patch.form->foot(x, node).point + (from - patch.form->foot(from, node).point);
}

void slide_patch(const SurfaceMesh& surface, const FreePatch& patch, Points& moved) {
  for (const FreeLine& line : patch.lines) slide_line(surface, line, moved);
  const auto field = patch_field(surface, patch, moved, false);
  if (!field) return;
  const RowMatrix d =
      interpolate_bounded(field->centres, field->values, field->kernel, field->targets);
  move_inner(surface, patch, d * field->basis.transpose(), moved);
}

SlideDerivative::SlideDerivative(const SurfaceMesh& surface, const std::vector<FreePatch>& patches,
                                 const Points& moved) {
  Points slid = moved;
  for (const FreePatch& patch : patches) {
    Step step;
    for (const FreeLine& line : patch.lines) {
      OnLine on{line.direction.transpose(), {}};
      for_each_free(surface, line, [&](RowId node, RowId before, RowId after, double part) {
        on.nodes.push_back({node, before, after, part});
      });
      step.lines.push_back(std::move(on));
      slide_line(surface, line, slid);
    }
    if (const auto field = patch_field(surface, patch, slid, true)) {
      FieldMap map =
          bounded_derivative(field->centres, field->values, field->kernel, field->targets);
      const RowMatrix d = map.forward(field->values) * field->basis.transpose();
      step.patch = OnPatch{field->basis, field->border, patch.inner, std::move(map),
                           move_inner(surface, patch, d, slid)};
    }
    steps_.push_back(std::move(step));
  }
}

RowMatrix SlideDerivative::forward(RowMatrix displacements) const {
  for (Index c = 0; c < displacements.cols(); c += 3) {
    auto u = displacements.middleCols<3>(c);
    for (const Step& step : steps_) {
      for (const OnLine& line : step.lines)
        for (const auto& [node, before, after, part] : line.nodes)
          u.row(node) = ((1 - part) * u.row(before) + part * u.row(after)).dot(line.direction) *
                        line.direction;
      if (!step.patch) continue;
      const auto& [basis, border, inner, field, slopes] = *step.patch;
      u(inner, Eigen::all) = field.forward(u(border, Eigen::all) * basis) * basis.transpose();
      for (std::size_t i = 0; i < slopes.size(); ++i)
        u.row(inner[i]) = (slopes[i] * u.row(inner[i]).transpose()).transpose().eval();
    }
  }
  return displacements;
}

RowMatrix SlideDerivative::adjoint(RowMatrix slopes) const {
  for (Index c = 0; c < slopes.cols(); c += 3) {
    auto g = slopes.middleCols<3>(c);
    for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) {
      if (step->patch) {
        const auto& [basis, border, inner, field, slopes] = *step->patch;
        for (std::size_t i = 0; i < slopes.size(); ++i)
          g.row(inner[i]) =
              (slopes[i].transpose() * g.row(inner[i]).transpose()).transpose().eval();
        const Eigen::MatrixXd by_inner = g(inner, Eigen::all) * basis;
        g(inner, Eigen::all).setZero();
        g(border, Eigen::all) += field.adjoint(by_inner) * basis.transpose();
      }
      for (auto line = step->lines.rbegin(); line != step->lines.rend(); ++line)
        for (auto at = line->nodes.rbegin(); at != line->nodes.rend(); ++at) {
          const Eigen::RowVector3d along = g.row(at->node).dot(line->direction) * line->direction;
          g.row(at->node).setZero();
          g.row(at->before) += (1 - at->part) * along;
          g.row(at->after) += at->part * along;
        }
    }
  }
  return slopes;
}

}  // namespace cadmorph
