#include "core/quality_checks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "core/cell_topology.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"

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

// Nodes of the largest cell that is no polyhedron.
constexpr int kMostNodes = 27;

using Corners = std::span<const Vector3d>;

// Centre and area vector of a polygon, split around the mean of its corners.
struct FaceShape {
  Vector3d centre, area;
};

FaceShape triangle_shape(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return {(a + b + c) / 3, (b - a).cross(c - a) / 2};
}

FaceShape face_shape(Corners corners) {
  if (corners.size() == 3) return triangle_shape(corners[0], corners[1], corners[2]);
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& x : corners) middle += x;
  middle /= static_cast<double>(corners.size());
  Vector3d area = Vector3d::Zero(), moment = Vector3d::Zero();
  double total = 0;
  Vector3d a = corners.back();
  for (const Vector3d& b : corners) {
    const Vector3d part = (a - middle).cross(b - middle) / 2;
    const double size = part.norm();
    area += part;
    total += size;
    moment += size * (a + b + middle) / 3;
    a = b;
  }
  return {total > 0 ? Vector3d(moment / total) : middle, area};
}

// A face of a cell in place.
struct PlacedFace {
  Index other;  ///< cell on the other side, as CellNeighbours has it
  Corners corners;
};

// Goes through the cells of a mesh at some node positions; its memory is reused from one to the
// next.
class PlacedCells {
 public:
  PlacedCells(const Mesh& mesh, const Points& points, const CellNeighbours& neighbours,
              const Orientation& orientation)
      : mesh_(mesh), points_(points), neighbours_(neighbours), orientation_(orientation) {}

  const Mesh& mesh() const { return mesh_; }
  bool is_solid(Index c) const { return dimension(mesh_.types[c]) == 3; }
  double sign(Index c) const { return orientation_.at(static_cast<std::size_t>(mesh_.types[c])); }
  Vector3d node(Index n) const { return points_.row(n).transpose(); }
  const Index* others(Index c) const {
    return neighbours_.neighbour.data() + neighbours_.offsets[c];
  }

  // Calls visit(face) for each face of solid cell c that has three corners.
  template <class Visit>
  void for_each_face(Index c, Visit&& visit) {
    const Index* other = others(c);
    if (mesh_.types[c] == CellType::Polyhedron) {
      for_each_polyhedron_face(mesh_, c, [&](std::span<const Index> nodes) {
        corners_.clear();
        for (const Index n : nodes) corners_.push_back(node(n));
        if (*other != c) visit(PlacedFace{*other, corners_});
        ++other;
      });
      return;
    }
    const auto cell = mesh_.cell(c);
    std::array<Vector3d, kMostNodes> x;
    for (std::size_t i = 0; i < cell.size(); ++i) x[i] = node(cell[i]);
    std::array<Vector3d, 4> corners;
    for (const LocalFace& face : local_faces(mesh_.types[c])) {
      const auto count = static_cast<std::size_t>(corner_count(face.type, face.count));
      for (std::size_t i = 0; i < count; ++i) corners[i] = x[face.nodes[i]];
      if (*other != c) visit(PlacedFace{*other, {corners.data(), count}});
      ++other;
    }
  }

 private:
  const Mesh& mesh_;
  const Points& points_;
  const CellNeighbours& neighbours_;
  const Orientation& orientation_;
  std::vector<Vector3d> corners_;
};

struct CellShape {
  Vector3d centre = Vector3d::Zero();
  double volume = 0;
  Vector3d projection = Vector3d::Zero();  ///< sums of |area components|
};

CellShape cell_shape(PlacedCells& cells, Index c, std::vector<FaceShape>& faces) {
  faces.clear();
  Vector3d guess = Vector3d::Zero();
  cells.for_each_face(c, [&](const PlacedFace& face) {
    faces.push_back(face_shape(face.corners));
    guess += faces.back().centre;
  });
  guess /= static_cast<double>(std::max<std::size_t>(faces.size(), 1));
  CellShape cell;
  const double sign = cells.sign(c);
  for (const FaceShape& face : faces) {
    const double volume = sign * face.area.dot(face.centre - guess) / 3;
    cell.volume += volume;
    cell.centre += volume * (0.75 * face.centre + 0.25 * guess);
    cell.projection += face.area.cwiseAbs();
  }
  cell.centre = cell.volume != 0 ? Vector3d(cell.centre / cell.volume) : guess;
  return cell;
}

// The corners and the faces of a tetrahedron, by local_faces.
struct Tetra {
  std::array<Vector3d, 4> x;
  Vector3d centre;

  Tetra(const PlacedCells& cells, Index c) {
    const auto nodes = cells.mesh().cell(c);
    for (int i = 0; i < 4; ++i) x[i] = cells.node(nodes[i]);
    centre = (x[0] + x[1] + x[2] + x[3]) / 4;
  }

  static constexpr std::array<std::array<int, 3>, 4> kFaces = {
      {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 2, 1}}};
  std::array<Vector3d, 3> corners(int face) const {
    return {x[kFaces[face][0]], x[kFaces[face][1]], x[kFaces[face][2]]};
  }
};

// With all corners apart every face of a tetrahedron counts, and the formulas are closed.
bool is_proper_tetra(const PlacedCells& cells, Index c) {
  if (cells.mesh().types[c] != CellType::Tetra) return false;
  const Index* other = cells.others(c);
  return other[0] != c && other[1] != c && other[2] != c && other[3] != c;
}

CellShape tetra_shape(const Tetra& tetra, double sign) {
  CellShape cell;
  const Vector3d a = tetra.x[1] - tetra.x[0], b = tetra.x[2] - tetra.x[0],
                 c = tetra.x[3] - tetra.x[0];
  const Vector3d ab = a.cross(b), bc = b.cross(c), ca = c.cross(a);
  cell.centre = tetra.centre;
  cell.volume = sign * a.dot(bc) / 6;
  cell.projection = (ab.cwiseAbs() + bc.cwiseAbs() + ca.cwiseAbs() + (ab + bc + ca).cwiseAbs()) / 2;
  return cell;
}

// Squared distance of the face centre from where the line along `d` from `from` meets the face, in
// sizes of the face seen in that direction, which count as `least` times |d| at least.
double squared_skewness(Corners corners, const FaceShape& face, const Vector3d& from,
                        const Vector3d& d, double least) {
  const Vector3d to_face = face.centre - from;
  const double along = face.area.dot(d);
  if (along == 0) return std::numeric_limits<double>::infinity();
  const Vector3d offset = to_face - face.area.dot(to_face) / along * d;
  const double length = offset.squaredNorm();
  if (length == 0) return 0;
  double reach = 0;
  for (const Vector3d& x : corners) reach = std::max(reach, std::abs(offset.dot(x - face.centre)));
  return length / std::max(least * least * d.squaredNorm(), reach * (reach / length));
}

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
    const CellShape shape = is_proper_tetra(cells, c) ? tetra_shape(Tetra(cells, c), cells.sign(c))
                                                      : cell_shape(cells, c, faces);
    centres[c] = shape.centre;
    part.add_cell(shape, c, flat_axis);
  }
}

// The tetrahedra of some cells. Neighbours lie anywhere in memory: the centres of all are read
// first, so that their loads overlap.
void check_tetra_faces(const PlacedCells& cells, std::span<const Index> tetras,
                       const Centres& centres, Part& part) {
  constexpr std::size_t kBlock = 32;
  std::array<Vector3d, 4 * kBlock> others;
  for (; !tetras.empty(); tetras = tetras.subspan(std::min(kBlock, tetras.size()))) {
    const auto block = tetras.first(std::min(kBlock, tetras.size()));
    Vector3d* other_centre = others.data();
    for (const Index c : block)
      for (int f = 0; f < 4; ++f, ++other_centre)
        *other_centre = centres[std::max(cells.others(c)[f], c)];
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

QualityChecks check_solid_cells(const Mesh& mesh, const Points& points,
                                const CellNeighbours& neighbours, const Orientation& orientation,
                                int flat_axis) {
  const PlacedCells cells(mesh, points, neighbours, orientation);
  const Index count = mesh.cell_count();
  Centres centres(count);
  std::vector<Part> parts((count + kGrain - 1) / kGrain);
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    check_cells(cells, flat_axis, begin, end, centres, parts[begin / kGrain]);
  });
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    check_faces(cells, begin, end, centres, parts[begin / kGrain]);
  });
  Part all;
  for (const Part& part : parts) all.merge(part);
  return all.result();
}

}  // namespace

QualityChecks check_quality(const Mesh& mesh, const Points& points,
                            const CellNeighbours& neighbours, const Orientation& orientation) {
  check_positions(mesh, points);
  if (!neighbours.neighbour.empty())
    return check_solid_cells(mesh, points, neighbours, orientation, -1);
  const int axis = flat_axis(mesh, points);
  if (axis < 0) return {};
  const Mesh layer = one_layer(mesh, points);
  return check_solid_cells(layer, layer.points, find_cell_neighbours(layer),
                           detect_orientation(layer), axis);
}

}  // namespace cadmorph
