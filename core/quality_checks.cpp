#include "core/quality_checks.h"

#include <Eigen/Geometry>
#include <algorithm>
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

// One face of one cell.
struct CellFace {
  std::uint64_t key;
  Index cell;
  Index first;  ///< position in the shared list of corners
  int count;
};

std::uint64_t mix(std::uint64_t x) {
  x ^= x >> 31;
  x *= 0x7fb5d329728ea185;
  x ^= x >> 27;
  x *= 0x81dadef4bc2dd44d;
  return x ^ (x >> 33);
}

// The same for every order of the nodes.
std::uint64_t key_of(std::span<const Index> nodes) {
  std::uint64_t sum = 0;
  for (const Index node : nodes) sum += mix(static_cast<std::uint64_t>(node) + 1);
  return sum;
}

class FaceCollector {
 public:
  void add(Index cell, std::span<const Index> corners, bool is_mirrored) {
    faces.push_back({key_of(corners), cell, static_cast<Index>(nodes.size()),
                     static_cast<int>(corners.size())});
    if (is_mirrored)
      nodes.insert(nodes.end(), corners.rbegin(), corners.rend());
    else
      nodes.insert(nodes.end(), corners.begin(), corners.end());
  }
  bool are_same(const CellFace& a, const CellFace& b) const {
    return a.key == b.key && a.count == b.count &&
           std::is_permutation(nodes.begin() + a.first, nodes.begin() + a.first + a.count,
                               nodes.begin() + b.first);
  }

  std::vector<CellFace> faces;
  std::vector<Index> nodes;
};

FaceCollector collect(const Mesh& mesh, const Orientation& orientation) {
  FaceCollector all;
  std::vector<Index> corners;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 3) continue;
    const bool is_mirrored = orientation[static_cast<std::size_t>(mesh.types[c])] < 0;
    if (mesh.types[c] == CellType::Polyhedron) {
      for_each_polyhedron_face(mesh, c,
                               [&](std::span<const Index> face) { all.add(c, face, is_mirrored); });
      continue;
    }
    const auto cell = mesh.cell(c);
    for (const LocalFace& face : local_faces(mesh.types[c])) {
      corners.clear();
      for (int i = 0; i < corner_count(face.type, face.count); ++i)
        corners.push_back(cell[face.nodes[i]]);
      all.add(c, corners, is_mirrored);
    }
  }
  return all;
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
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Vector3d a = points.row(nodes[i]).transpose();
    const Vector3d b = points.row(nodes[(i + 1) % nodes.size()]).transpose();
    const Vector3d part = (a - middle).cross(b - middle) / 2;
    area += part;
    total += part.norm();
    moment += part.norm() * (a + b + middle) / 3;
  }
  return {total > 0 ? Vector3d(moment / total) : middle, area};
}

// Shapes of faces and cells at one set of positions.
struct Geometry {
  std::vector<FaceShape> faces;
  std::vector<Vector3d> centres;  ///< of cells
  std::vector<double> volumes;
  std::vector<Vector3d> projections;  ///< per cell, sums of |area components|
};

void add_pyramid(Geometry& geometry, const FaceShape& face, Index cell, const Vector3d& guess,
                 double sign) {
  const double volume = sign * face.area.dot(face.centre - guess) / 3;
  geometry.volumes[cell] += volume;
  geometry.centres[cell] += volume * (0.75 * face.centre + 0.25 * guess);
  geometry.projections[cell] += face.area.cwiseAbs();
}

Geometry measure(const Mesh& mesh, const Points& points, const CellFaces& faces) {
  Geometry geometry;
  geometry.faces.resize(faces.face_count());
  parallel_for(faces.face_count(), 4096, [&](Index begin, Index end) {
    for (Index f = begin; f < end; ++f) geometry.faces[f] = face_shape(points, faces.face(f));
  });
  const Index cells = mesh.cell_count();
  geometry.centres.assign(cells, Vector3d::Zero());
  geometry.projections.assign(cells, Vector3d::Zero());
  geometry.volumes.assign(cells, 0);
  std::vector<Vector3d> guesses(cells, Vector3d::Zero());
  std::vector<int> counts(cells, 0);
  const auto each_side = [&](const auto& visit) {
    for (Index f = 0; f < faces.face_count(); ++f) {
      visit(f, faces.owner[f], 1.0);
      if (faces.neighbour[f] >= 0) visit(f, faces.neighbour[f], -1.0);
    }
  };
  each_side([&](Index f, Index c, double) {
    guesses[c] += geometry.faces[f].centre;
    ++counts[c];
  });
  for (Index c = 0; c < cells; ++c)
    if (counts[c] > 0) guesses[c] /= counts[c];
  each_side([&](Index f, Index c, double sign) {
    add_pyramid(geometry, geometry.faces[f], c, guesses[c], sign);
  });
  for (Index c = 0; c < cells; ++c)
    geometry.centres[c] =
        geometry.volumes[c] != 0 ? Vector3d(geometry.centres[c] / geometry.volumes[c]) : guesses[c];
  return geometry;
}

double angle_deg(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))) * 180 / std::numbers::pi;
}

// Distance of the face centre from where the line `d` from `from` meets the face, in face sizes.
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

double aspect_ratio(const Vector3d& projection, double volume) {
  const double by_projection = projection.maxCoeff() / projection.minCoeff();
  const double by_volume = projection.sum() / 6 / std::pow(std::abs(volume), 2.0 / 3);
  return std::max(by_projection, by_volume);
}

void check_faces(const Points& points, const CellFaces& faces, const Geometry& geometry,
                 QualityChecks& checks) {
  double sum = 0;
  Index internal = 0;
  for (Index f = 0; f < faces.face_count(); ++f) {
    const FaceShape& face = geometry.faces[f];
    const Index owner = faces.owner[f], other = faces.neighbour[f];
    const Vector3d from = geometry.centres[owner];
    Vector3d d =
        other >= 0
            ? Vector3d(geometry.centres[other] - from)
            : Vector3d(face.area * face.area.dot(face.centre - from) / face.area.squaredNorm());
    const double skew = skewness(points, faces.face(f), face, from, d);
    if (skew > kHighSkewness) ++checks.highly_skew;
    if (skew > checks.max_skewness) {
      checks.max_skewness = skew;
      checks.worst_skew_cell = owner;
    }
    if (other < 0) continue;
    const double angle = angle_deg(face.area, d);
    sum += angle;
    ++internal;
    if (angle > kSevereNonOrthogonality) ++checks.severely_non_orthogonal;
    if (angle > checks.max_non_orthogonality_deg) {
      checks.max_non_orthogonality_deg = angle;
      checks.worst_non_orthogonal_cell = owner;
    }
  }
  if (internal > 0) checks.mean_non_orthogonality_deg = sum / static_cast<double>(internal);
}

void check_cells(const Mesh& mesh, const Geometry& geometry, QualityChecks& checks) {
  checks.min_volume = std::numeric_limits<double>::infinity();
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) != 3) continue;
    const double aspect = aspect_ratio(geometry.projections[c], geometry.volumes[c]);
    if (aspect > kHighAspectRatio) ++checks.high_aspect;
    if (aspect > checks.max_aspect_ratio) {
      checks.max_aspect_ratio = aspect;
      checks.worst_aspect_cell = c;
    }
    checks.min_volume = std::min(checks.min_volume, geometry.volumes[c]);
  }
}

}  // namespace

CellFaces find_cell_faces(const Mesh& mesh, const Orientation& orientation) {
  FaceCollector all = collect(mesh, orientation);
  std::ranges::sort(all.faces, [](const CellFace& a, const CellFace& b) {
    return std::pair(a.key, a.cell) < std::pair(b.key, b.cell);
  });
  CellFaces result;
  result.offsets.push_back(0);
  for (std::size_t i = 0; i < all.faces.size(); ++i) {
    const CellFace& face = all.faces[i];
    const bool is_shared = i + 1 < all.faces.size() && all.are_same(face, all.faces[i + 1]);
    result.owner.push_back(face.cell);
    result.neighbour.push_back(is_shared ? all.faces[i + 1].cell : -1);
    result.connectivity.insert(result.connectivity.end(), all.nodes.begin() + face.first,
                               all.nodes.begin() + face.first + face.count);
    result.offsets.push_back(static_cast<Index>(result.connectivity.size()));
    if (is_shared) ++i;
  }
  return result;
}

QualityChecks check_quality(const Mesh& mesh, const Points& points, const CellFaces& faces) {
  QualityChecks checks;
  if (faces.face_count() == 0) return checks;
  const Geometry geometry = measure(mesh, points, faces);
  check_faces(points, faces, geometry, checks);
  check_cells(mesh, geometry, checks);
  return checks;
}

}  // namespace cadmorph
