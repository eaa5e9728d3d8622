#include "core/quality_checks.h"

#include <oneapi/tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/cell_topology.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector3d;

// Limits of OpenFOAM's checkMesh.
constexpr double kSevereNonOrthogonality = 70;
constexpr double kHighSkewness = 4;
constexpr double kHighAspectRatio = 1000;

constexpr Index kGrain = 2048;  // cells a task

// Calls visit(local_face, corner_nodes) for each face of solid cell c, in the order of cell_facets.
template <class Visit>
void for_each_face(const Mesh& mesh, Index c, Visit&& visit) {
  int local = 0;
  if (mesh.types[c] == CellType::Polyhedron) {
    for_each_polyhedron_face(mesh, c, [&](std::span<const Index> face) { visit(local++, face); });
    return;
  }
  const auto cell = mesh.cell(c);
  std::array<Index, 4> corners;
  for (const LocalFace& face : local_faces(mesh.types[c])) {
    const auto count = static_cast<std::size_t>(corner_count(face.type, face.count));
    for (std::size_t i = 0; i < count; ++i) corners[i] = cell[face.nodes[i]];
    visit(local++, std::span<const Index>(corners.data(), count));
  }
}

bool is_solid(const Mesh& mesh, Index c) { return dimension(mesh.types[c]) == 3; }

// One face of one cell, by a number that does not depend on the order of its nodes. Two faces of a
// mesh of 10^8 share one by chance with a probability below 10^-3, and then one figure is off.
struct FaceKey {
  std::uint64_t key;
  std::uint32_t cell;
  std::uint32_t local;
  bool operator<(const FaceKey& other) const {
    return key != other.key ? key < other.key : cell < other.cell;
  }
};

std::uint64_t mix(std::uint64_t x) {
  x ^= x >> 31;
  x *= 0x7fb5d329728ea185;
  x ^= x >> 27;
  x *= 0x81dadef4bc2dd44d;
  return x ^ (x >> 33);
}

std::uint64_t key_of(std::span<const Index> nodes) {
  std::uint64_t sum = 0;
  for (const Index node : nodes) sum += mix(static_cast<std::uint64_t>(node) + 1);
  return sum;
}

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

CellShape cell_shape(const Mesh& mesh, const Points& points, Index c, double sign) {
  std::vector<FaceShape> faces;
  Vector3d guess = Vector3d::Zero();
  for_each_face(mesh, c, [&](int, std::span<const Index> nodes) {
    faces.push_back(face_shape(points, nodes));
    guess += faces.back().centre;
  });
  guess /= static_cast<double>(faces.size());
  CellShape cell;
  for (const FaceShape& face : faces) {
    const double volume = sign * face.area.dot(face.centre - guess) / 3;
    cell.volume += volume;
    cell.centre += volume * (0.75 * face.centre + 0.25 * guess);
    cell.projection += face.area.cwiseAbs();
  }
  cell.centre = cell.volume != 0 ? Vector3d(cell.centre / cell.volume) : guess;
  return cell;
}

std::vector<CellShape> cell_shapes(const Mesh& mesh, const Points& points,
                                   const Orientation& orientation) {
  std::vector<CellShape> shapes(mesh.cell_count());
  parallel_for(mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c)
      if (is_solid(mesh, c))
        shapes[c] =
            cell_shape(mesh, points, c, orientation[static_cast<std::size_t>(mesh.types[c])]);
  });
  return shapes;
}

double angle_deg(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))) * 180 / std::numbers::pi;
}

// Distance of the face centre from where the line along `d` from `from` meets the face, in sizes of
// the face seen in that direction.
double skewness(const Points& points, std::span<const Index> nodes, const FaceShape& face,
                const Vector3d& from, const Vector3d& d) {
  const Vector3d to_face = face.centre - from;
  const double along = face.area.dot(d);
  if (along == 0) return std::numeric_limits<double>::infinity();
  const Vector3d offset = to_face - face.area.dot(to_face) / along * d;
  const double length = offset.norm();
  if (length == 0) return 0;
  double size = 0.2 * d.norm();
  for (const Index node : nodes)
    size =
        std::max(size, std::abs(offset.dot(points.row(node).transpose() - face.centre)) / length);
  return length / size;
}

double aspect_ratio(const CellShape& cell) {
  const double by_projection = cell.projection.maxCoeff() / cell.projection.minCoeff();
  const double by_volume = cell.projection.sum() / 6 / std::pow(std::abs(cell.volume), 2.0 / 3);
  return std::max(by_projection, by_volume);
}

// The figures of some cells and the faces they own.
struct Part {
  QualityChecks checks;
  double angles = 0;
  Index internal = 0;

  Part() { checks.min_volume = std::numeric_limits<double>::infinity(); }

  void add_angle(double angle, Index cell) {
    angles += angle;
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
    angles += other.angles;
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

void check_faces(const Mesh& mesh, const Points& points, const CellNeighbours& neighbours,
                 const std::vector<CellShape>& cells, Index c, Part& part) {
  for_each_face(mesh, c, [&](int local, std::span<const Index> nodes) {
    const Index other = neighbours.neighbour[neighbours.offsets[c] + local];
    if (other >= 0 && other < c) return;  // done from the other side
    const FaceShape face = face_shape(points, nodes);
    const Vector3d from = cells[c].centre;
    Vector3d d;
    if (other >= 0) {
      d = cells[other].centre - from;
      part.add_angle(angle_deg(face.area, d), c);
    } else {
      d = face.area * (face.area.dot(face.centre - from) / face.area.squaredNorm());
    }
    part.add_skewness(skewness(points, nodes, face, from, d), c);
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
  }
  std::vector<FaceKey> keys(result.offsets.back());
  parallel_for(mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c)
      if (is_solid(mesh, c))
        for_each_face(mesh, c, [&](int local, std::span<const Index> nodes) {
          keys[result.offsets[c] + local] = {key_of(nodes), static_cast<std::uint32_t>(c),
                                             static_cast<std::uint32_t>(local)};
        });
  });
  tbb::parallel_sort(keys.begin(), keys.end());
  result.neighbour.assign(keys.size(), -1);
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    const FaceKey &a = keys[i], &b = keys[i + 1];
    if (a.key != b.key) continue;
    result.neighbour[result.offsets[a.cell] + a.local] = b.cell;
    result.neighbour[result.offsets[b.cell] + b.local] = a.cell;
    ++i;
  }
  return result;
}

QualityChecks check_quality(const Mesh& mesh, const Points& points,
                            const CellNeighbours& neighbours, const Orientation& orientation) {
  if (neighbours.neighbour.empty()) return {};
  const std::vector<CellShape> cells = cell_shapes(mesh, points, orientation);
  std::vector<Part> parts((mesh.cell_count() + kGrain - 1) / kGrain);
  parallel_for(mesh.cell_count(), kGrain, [&](Index begin, Index end) {
    Part& part = parts[begin / kGrain];
    for (Index c = begin; c < end; ++c) {
      if (!is_solid(mesh, c)) continue;
      part.add_cell(cells[c], c);
      check_faces(mesh, points, neighbours, cells, c, part);
    }
  });
  Part all;
  for (const Part& part : parts) all.merge(part);
  if (all.internal > 0)
    all.checks.mean_non_orthogonality_deg = all.angles / static_cast<double>(all.internal);
  return all.checks;
}

}  // namespace cadmorph
