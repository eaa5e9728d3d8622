#include "core/quality_checks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "core/finite_volumes.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"

namespace cadmorph {
namespace {

using namespace finite_volume;

// Of OpenFOAM's checkMesh.
constexpr double kHighAspectRatio = 1000;

constexpr Index kGrain = 2048;  // cells a task

constexpr double cubed(double x) { return x * x * x; }

// The cube of the aspect ratio: cubes compare without a root. Of one layer of cells only the
// directions other than `flat_axis` count.
double cubed_aspect_ratio(const CellShape& cell, int flat_axis) {
  if (flat_axis >= 0) {
    const double u = cell.projection[(flat_axis + 1) % 3], v = cell.projection[(flat_axis + 2) % 3];
    return cubed(std::max(u, v) / std::min(u, v));
  }
  const double least = cell.projection.minCoeff();
  if (least == 0) return std::numeric_limits<double>::infinity();
  const double by_projection = cell.projection.maxCoeff() / least;
  const double mean_area = cell.projection.sum() / 6;
  const double by_volume = mean_area * mean_area * mean_area / (cell.volume * cell.volume);
  return std::max(by_projection * by_projection * by_projection, by_volume);
}

// An angle of two vectors by their products: compares without the angle itself.
struct Angle {
  double dot = 1, squared_cross = 0;

  Angle() = default;
  Angle(const Vector3d& a, const Vector3d& b)
      : dot(a.dot(b)), squared_cross(a.cross(b).squaredNorm()) {}

  // Ascends with the angle from -infinity to infinity, 0 at the right angle.
  double order() const {
    const double squared_cotangent = dot / squared_cross * dot;
    return dot > 0 ? -squared_cotangent : squared_cotangent;
  }
  double cosine() const {
    const double length = std::sqrt(dot * dot + squared_cross);
    return length > 0 ? dot / length : 1;
  }
  double degrees() const {
    return std::atan2(std::sqrt(squared_cross), dot) * 180 / std::numbers::pi;
  }
};

// The figures of some cells and the faces they own.
struct Part {
  QualityChecks checks;  // but for the figures that follow
  Angle widest;
  double widest_order = widest.order();
  double squared_skewness = 0, cubed_aspect_ratio = 0;  ///< largest
  double cosines = 0;                                   ///< of the angles of `internal` faces
  Index internal = 0;

  Part() { checks.min_volume = std::numeric_limits<double>::infinity(); }

  void add_angle(const Angle& angle, Index cell) {
    static const double severe =
        -1 / std::pow(std::tan(kSevereNonOrthogonality * std::numbers::pi / 180), 2);
    cosines += angle.cosine();
    ++internal;
    const double order = angle.order();
    if (order > severe) ++checks.severely_non_orthogonal;
    if (!(order > widest_order)) return;
    widest = angle;
    widest_order = order;
    checks.worst_non_orthogonal_cell = cell;
  }
  void add_skewness(double squared, Index cell) {
    if (squared > kHighSkewness * kHighSkewness) ++checks.highly_skew;
    if (squared <= squared_skewness) return;
    squared_skewness = squared;
    checks.worst_skew_cell = cell;
  }
  void add_cell(const CellShape& shape, Index cell, int flat_axis) {
    const double aspect = cadmorph::cubed_aspect_ratio(shape, flat_axis);
    checks.min_volume = std::min(checks.min_volume, shape.volume);
    if (aspect > cubed(kHighAspectRatio)) ++checks.high_aspect;
    if (aspect <= cubed_aspect_ratio) return;
    cubed_aspect_ratio = aspect;
    checks.worst_aspect_cell = cell;
  }

  void merge(const Part& other) {
    const QualityChecks& from = other.checks;
    cosines += other.cosines;
    internal += other.internal;
    checks.severely_non_orthogonal += from.severely_non_orthogonal;
    checks.highly_skew += from.highly_skew;
    checks.high_aspect += from.high_aspect;
    checks.min_volume = std::min(checks.min_volume, from.min_volume);
    if (other.widest_order > widest_order) {
      widest = other.widest;
      widest_order = other.widest_order;
      checks.worst_non_orthogonal_cell = from.worst_non_orthogonal_cell;
    }
    if (other.squared_skewness > squared_skewness) {
      squared_skewness = other.squared_skewness;
      checks.worst_skew_cell = from.worst_skew_cell;
    }
    if (other.cubed_aspect_ratio > cubed_aspect_ratio) {
      cubed_aspect_ratio = other.cubed_aspect_ratio;
      checks.worst_aspect_cell = from.worst_aspect_cell;
    }
  }

  QualityChecks result() const {
    QualityChecks all = checks;
    all.max_non_orthogonality_deg = widest.degrees();
    all.max_skewness = std::sqrt(squared_skewness);
    all.max_aspect_ratio = std::cbrt(cubed_aspect_ratio);
    if (internal == 0) return all;
    const double mean = cosines / static_cast<double>(internal);
    all.mean_non_orthogonality_deg =
        std::acos(std::clamp(mean, -1.0, 1.0)) * 180 / std::numbers::pi;
    return all;
  }
};

using Centres = std::vector<Vector3d>;

/// A cell beside a face; its id is negative where there is none.
struct Side {
  Index cell;
  const Vector3d& centre;
};

// Measures a face from one of its cells, of orientation `sign`, unless that was done from the
// other.
void check_face(Corners corners, const Side& own, const Side& other, double sign, Part& part) {
  if (other.cell >= 0 && other.cell < own.cell) return;
  const FaceShape face = face_shape(corners);
  if (face.area.isZero(0)) return;
  if (other.cell >= 0) {
    const Vector3d d = other.centre - own.centre;
    part.add_angle({sign * face.area, d}, own.cell);
    part.add_skewness(squared_skewness(corners, face, own.centre, d, kInside), own.cell);
  } else {
    const Vector3d d =
        face.area * (face.area.dot(face.centre - own.centre) / face.area.squaredNorm());
    part.add_skewness(squared_skewness(corners, face, own.centre, d, kOutside), own.cell);
  }
}

void check_cells(PlacedCells cells, int flat_axis, Index begin, Index end, Centres& centres,
                 Part& part) {
  std::vector<FaceShape> faces;
  for (Index c = begin; c < end; ++c) {
    if (!cells.is_solid(c)) continue;
    const CellShape shape = cell_shape(cells, c, faces);
    centres[c] = shape.centre;
    part.add_cell(shape, c, flat_axis);
  }
}

// The tetrahedra of some cells. Neighbours lie anywhere in memory: the centres of all are read
// first, so that their loads overlap.
void check_tetra_faces(const PlacedCells& cells, std::span<const Index> tetras,
                       const Centres& centres, Part& part) {
  constexpr std::size_t kBlock = 32;  // 128 loads, more than a core has under way at once
  std::array<Vector3d, 4 * kBlock> others;
  for (; !tetras.empty(); tetras = tetras.subspan(std::min(kBlock, tetras.size()))) {
    const auto block = tetras.first(std::min(kBlock, tetras.size()));
    Vector3d* other_centre = others.data();
    for (const Index c : block)
      for (int f = 0; f < 4; ++f, ++other_centre)
        *other_centre = centres[std::max<Index>(cells.others(c)[f], c)];
    other_centre = others.data();
    for (const Index c : block) {
      const Tetra tetra(cells, c);
      for (int f = 0; f < 4; ++f, ++other_centre)
        check_face(tetra.corners(f), {c, centres[c]}, {cells.others(c)[f], *other_centre},
                   cells.sign(c), part);
    }
  }
}

void check_faces(PlacedCells cells, Index begin, Index end, const Centres& centres, Part& part) {
  std::vector<Index> tetras;
  for (Index c = begin; c < end; ++c) {
    if (is_proper_tetra(cells, c)) {
      tetras.push_back(c);
    } else if (cells.is_solid(c)) {
      cells.for_each_face(c, [&](const PlacedFace& face) {
        check_face(face.corners, {c, centres[c]}, {face.other, centres[std::max(face.other, c)]},
                   cells.sign(c), part);
      });
    }
  }
  check_tetra_faces(cells, tetras, centres, part);
}

}  // namespace

QualityChecks check_quality(const Mesh& mesh, const Points& points,
                            const CellNeighbours& neighbours, const Orientation& orientation) {
  check_positions(mesh, points);
  const FiniteVolumes volumes(mesh, points, neighbours, orientation);
  if (!volumes.has_cells()) return {};
  Points scratch;
  const PlacedCells cells(volumes, volumes.place(points, scratch));
  const int axis = volumes.is_layer() ? flat_axis(mesh, points) : -1;
  const Index count = mesh.cell_count();
  Centres centres(count);
  std::vector<Part> parts((count + kGrain - 1) / kGrain);
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    check_cells(cells, axis, begin, end, centres, parts[begin / kGrain]);
  });
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    check_faces(cells, begin, end, centres, parts[begin / kGrain]);
  });
  Part all;
  for (const Part& part : parts) all.merge(part);
  return all.result();
}

}  // namespace cadmorph
