#include "core/quality_checks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/cell_faces.h"
#include "core/cell_topology.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// Limits of OpenFOAM's checkMesh.
constexpr double kSevereNonOrthogonality = 70;
constexpr double kHighSkewness = 4;
constexpr double kHighAspectRatio = 1000;
// Its smallest face size for the skewness: in the distance of the two centres, and in that from the
// centre to a face on the outside.
constexpr double kInside = 0.2, kOutside = 0.4;

constexpr Index kGrain = 2048;  // cells a task

// A mesh at some node positions.
struct PlacedMesh {
  const Mesh& mesh;
  const Points& points;
  const CellNeighbours& neighbours;
  const Orientation& orientation;

  bool is_solid(Index c) const { return dimension(mesh.types[c]) == 3; }
  double sign(Index c) const { return orientation.at(static_cast<std::size_t>(mesh.types[c])); }

  // Calls visit(neighbour, corner_nodes) for each face of solid cell c that has three corners.
  template <class Visit>
  void for_each_face(Index c, Visit&& visit) const {
    const Index* other = neighbours.neighbour.data() + neighbours.offsets[c];
    const auto take = [&](std::span<const Index> corners) {
      if (*other != c) visit(*other, corners);
      ++other;
    };
    if (mesh.types[c] == CellType::Polyhedron) return for_each_polyhedron_face(mesh, c, take);
    const auto cell = mesh.cell(c);
    std::array<Index, 4> corners;
    for (const LocalFace& face : local_faces(mesh.types[c])) {
      const auto count = static_cast<std::size_t>(corner_count(face.type, face.count));
      for (std::size_t i = 0; i < count; ++i) corners[i] = cell[face.nodes[i]];
      take({corners.data(), count});
    }
  }
};

// Centre and area vector of a polygon, split around the mean of its corners.
struct FaceShape {
  Vector3d centre, area;
};

FaceShape face_shape(const Points& points, std::span<const Index> nodes) {
  Vector3d middle = Vector3d::Zero();
  for (const Index node : nodes) middle += points.row(node).transpose();
  middle /= static_cast<double>(nodes.size());
  Vector3d area = Vector3d::Zero(), moment = Vector3d::Zero();
  double total = 0;
  Vector3d a = points.row(nodes.back()).transpose();
  for (const Index node : nodes) {
    const Vector3d b = points.row(node).transpose();
    const Vector3d part = (a - middle).cross(b - middle) / 2;
    const double size = part.norm();
    area += part;
    total += size;
    moment += size * (a + b + middle) / 3;
    a = b;
  }
  return {total > 0 ? Vector3d(moment / total) : middle, area};
}

struct CellShape {
  Vector3d centre = Vector3d::Zero();
  double volume = 0;
  Vector3d projection = Vector3d::Zero();  ///< sums of |area components|
};

CellShape cell_shape(const PlacedMesh& placed, Index c) {
  std::vector<FaceShape> faces;
  Vector3d guess = Vector3d::Zero();
  placed.for_each_face(c, [&](Index, std::span<const Index> nodes) {
    faces.push_back(face_shape(placed.points, nodes));
    guess += faces.back().centre;
  });
  guess /= static_cast<double>(std::max<std::size_t>(faces.size(), 1));
  CellShape cell;
  for (const FaceShape& face : faces) {
    const double volume = placed.sign(c) * face.area.dot(face.centre - guess) / 3;
    cell.volume += volume;
    cell.centre += volume * (0.75 * face.centre + 0.25 * guess);
    cell.projection += face.area.cwiseAbs();
  }
  cell.centre = cell.volume != 0 ? Vector3d(cell.centre / cell.volume) : guess;
  return cell;
}

std::vector<CellShape> cell_shapes(const PlacedMesh& placed) {
  std::vector<CellShape> shapes(placed.mesh.cell_count());
  parallel_for(placed.mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c)
      if (placed.is_solid(c)) shapes[c] = cell_shape(placed, c);
  });
  return shapes;
}

// Distance of the face centre from where the line along `d` from `from` meets the face, in sizes of
// the face seen in that direction, which count as `least` at least.
double skewness(const Points& points, std::span<const Index> nodes, const FaceShape& face,
                const Vector3d& from, const Vector3d& d, double least) {
  const Vector3d to_face = face.centre - from;
  const double along = face.area.dot(d);
  if (along == 0) return std::numeric_limits<double>::infinity();
  const Vector3d offset = to_face - face.area.dot(to_face) / along * d;
  const double length = offset.norm();
  if (length == 0) return 0;
  double size = least;
  for (const Index node : nodes)
    size =
        std::max(size, std::abs(offset.dot(points.row(node).transpose() - face.centre)) / length);
  return length / size;
}

double aspect_ratio(const CellShape& cell) {
  if (cell.projection.minCoeff() == 0) return std::numeric_limits<double>::infinity();
  const double by_projection = cell.projection.maxCoeff() / cell.projection.minCoeff();
  const double by_volume = cell.projection.sum() / 6 / std::pow(std::abs(cell.volume), 2.0 / 3);
  return std::max(by_projection, by_volume);
}

// The figures of some cells and the faces they own.
struct Part {
  QualityChecks checks;
  double cosines = 0;  ///< of the angles of `internal` faces
  Index internal = 0;

  Part() { checks.min_volume = std::numeric_limits<double>::infinity(); }

  void add_angle(const Vector3d& normal, const Vector3d& d, Index cell) {
    const double radians = std::atan2(normal.cross(d).norm(), normal.dot(d));
    const double angle = radians * 180 / std::numbers::pi;
    cosines += std::cos(radians);
    ++internal;
    if (angle > kSevereNonOrthogonality) ++checks.severely_non_orthogonal;
    if (angle <= checks.max_non_orthogonality_deg) return;
    checks.max_non_orthogonality_deg = angle;
    checks.worst_non_orthogonal_cell = cell;
  }
  void add_skewness(double skew, Index cell) {
    if (skew > kHighSkewness) ++checks.highly_skew;
    if (skew <= checks.max_skewness) return;
    checks.max_skewness = skew;
    checks.worst_skew_cell = cell;
  }
  void add_cell(const CellShape& shape, Index cell) {
    const double aspect = aspect_ratio(shape);
    checks.min_volume = std::min(checks.min_volume, shape.volume);
    if (aspect > kHighAspectRatio) ++checks.high_aspect;
    if (aspect <= checks.max_aspect_ratio) return;
    checks.max_aspect_ratio = aspect;
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
    if (from.max_non_orthogonality_deg > checks.max_non_orthogonality_deg) {
      checks.max_non_orthogonality_deg = from.max_non_orthogonality_deg;
      checks.worst_non_orthogonal_cell = from.worst_non_orthogonal_cell;
    }
    if (from.max_skewness > checks.max_skewness) {
      checks.max_skewness = from.max_skewness;
      checks.worst_skew_cell = from.worst_skew_cell;
    }
    if (from.max_aspect_ratio > checks.max_aspect_ratio) {
      checks.max_aspect_ratio = from.max_aspect_ratio;
      checks.worst_aspect_cell = from.worst_aspect_cell;
    }
  }
};

void check_faces(const PlacedMesh& placed, const std::vector<CellShape>& cells, Index c,
                 Part& part) {
  placed.for_each_face(c, [&](Index other, std::span<const Index> nodes) {
    if (other >= 0 && other < c) return;  // done from the other side
    const FaceShape face = face_shape(placed.points, nodes);
    if (face.area.isZero(0)) return;
    const Vector3d from = cells[c].centre;
    if (other >= 0) {
      const Vector3d d = cells[other].centre - from;
      part.add_angle(placed.sign(c) * face.area, d, c);
      part.add_skewness(skewness(placed.points, nodes, face, from, d, kInside * d.norm()), c);
    } else {
      const Vector3d d = face.area * (face.area.dot(face.centre - from) / face.area.squaredNorm());
      part.add_skewness(skewness(placed.points, nodes, face, from, d, kOutside * d.norm()), c);
    }
  });
}

}  // namespace

CellNeighbours find_cell_neighbours(const Mesh& mesh) {
  CellNeighbours result;
  result.offsets.assign(mesh.cell_count() + 1, 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    Index faces = 0;
    if (mesh.types[c] == CellType::Polyhedron)
      for_each_polyhedron_face(mesh, c, [&](std::span<const Index>) { ++faces; });
    else
      faces = static_cast<Index>(local_faces(mesh.types[c]).size());
    result.offsets[c + 1] = result.offsets[c] + faces;
    // Each face has the cell itself as neighbour until it is found to have corners.
    result.neighbour.insert(result.neighbour.end(), faces, c);
  }
  for_each_shared_face(mesh, [&](std::span<const CellFace> faces) {
    const auto neighbour = [&](CellFace face) -> Index& {
      return result.neighbour[result.offsets[face.cell()] + face.local()];
    };
    for (const CellFace face : faces) neighbour(face) = -1;
    if (faces.size() < 2) return;
    neighbour(faces[0]) = faces[1].cell();
    neighbour(faces[1]) = faces[0].cell();
  });
  return result;
}

QualityChecks check_quality(const Mesh& mesh, const Points& points,
                            const CellNeighbours& neighbours, const Orientation& orientation) {
  check_positions(mesh, points);
  if (neighbours.neighbour.empty()) return {};
  const PlacedMesh placed{mesh, points, neighbours, orientation};
  const std::vector<CellShape> cells = cell_shapes(placed);
  std::vector<Part> parts((mesh.cell_count() + kGrain - 1) / kGrain);
  parallel_for(mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    Part& part = parts[begin / kGrain];
    for (Index c = begin; c < end; ++c) {
      if (!placed.is_solid(c)) continue;
      part.add_cell(cells[c], c);
      check_faces(placed, cells, c, part);
    }
  });
  Part all;
  for (const Part& part : parts) all.merge(part);
  if (all.internal > 0) {
    const double mean = all.cosines / static_cast<double>(all.internal);
    all.checks.mean_non_orthogonality_deg =
        std::acos(std::clamp(mean, -1.0, 1.0)) * 180 / std::numbers::pi;
  }
  return all.checks;
}

}  // namespace cadmorph
