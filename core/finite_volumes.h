#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/cell_faces.h"
#include "core/cell_topology.h"
#include "core/quality.h"

namespace cadmorph {

/// The cells of a mesh as finite-volume programs take them: its solid cells, or those of a plane
/// mesh (flat_axis) as one_layer. Cells keep their numbers.
class FiniteVolumes {
 public:
  /// `mesh`, `neighbours` (find_cell_neighbours) and `orientation` of the solid cells must outlive
  /// this. `points` (N x 3): where a plane mesh lies, and its plane.
  FiniteVolumes(const Mesh& mesh, const Points& points, const CellNeighbours& neighbours,
                const Orientation& orientation);

  bool has_cells() const { return is_layer() || !neighbours_.neighbour.empty(); }
  bool is_layer() const { return layer_.has_value(); }
  const Mesh& mesh() const { return is_layer() ? layer_->mesh : mesh_; }
  const CellNeighbours& neighbours() const { return is_layer() ? layer_->neighbours : neighbours_; }
  const Orientation& orientation() const { return is_layer() ? layer_->orientation : orientation_; }

  /// The positions of mesh()'s nodes where those of the mesh lie at `points`: these, or `scratch`.
  const Points& place(const Points& points, Points& scratch) const;
  /// The mesh itself, and its node that one of mesh() stands for.
  const Mesh& base() const { return mesh_; }
  Index base_node(Index node) const { return node % mesh_.node_count(); }
  /// Of a layer, of length 1; else zero.
  const Eigen::Vector3d& normal() const { return normal_; }

 private:
  struct Layer {
    Mesh mesh;
    CellNeighbours neighbours;
    Orientation orientation;
  };
  const Mesh& mesh_;
  const CellNeighbours& neighbours_;
  const Orientation& orientation_;
  const Eigen::Vector3d normal_;
  std::optional<Layer> layer_;
};

/// Cells and faces as OpenFOAM's checkMesh measures them (primitiveMeshCheck): by their corners,
/// faces split around their middle.
namespace finite_volume {

using Eigen::Vector3d;
using Corners = std::span<const Vector3d>;

/// Limits of checkMesh.
inline constexpr double kSevereNonOrthogonality = 70;  ///< degrees
inline constexpr double kHighSkewness = 4;
/// Its smallest face size for the skewness: in the distance of the two centres, and in that from
/// the centre to a face on the outside.
inline constexpr double kInside = 0.2, kOutside = 0.4;

struct FaceShape {
  Vector3d centre, area;  ///< the area as a vector along the normal
};

inline FaceShape triangle_shape(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return {(a + b + c) / 3, (b - a).cross(c - a) / 2};
}

inline FaceShape face_shape(Corners corners) {
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

/// Squared skewness: the distance of the face's centre from where the line along `d` from `from`
/// meets the face, in sizes of the face seen in that direction, which count as `least` times |d| at
/// least.
inline double squared_skewness(Corners corners, const FaceShape& face, const Vector3d& from,
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

/// A face of a cell in place.
struct PlacedFace {
  Index other;  ///< cell on the other side, as CellNeighbours has it
  Corners corners;
};

/// Goes through the cells at some node positions; its memory is reused from one to the next.
class PlacedCells {
 public:
  /// `points`: of volumes.mesh()'s nodes.
  PlacedCells(const FiniteVolumes& volumes, const Points& points)
      : mesh_(volumes.mesh()),
        points_(points),
        neighbours_(volumes.neighbours()),
        orientation_(volumes.orientation()) {}

  const Mesh& mesh() const { return mesh_; }
  bool is_solid(Index c) const { return dimension(mesh_.types[c]) == 3; }
  double sign(Index c) const { return orientation_.at(static_cast<std::size_t>(mesh_.types[c])); }
  Vector3d node(Index n) const { return points_.row(n).transpose(); }
  std::span<const std::int32_t> others(Index c) const { return neighbours_.of(c); }

  /// Calls visit(face) for each face of solid cell c that has three corners.
  template <class Visit>
  void for_each_face(Index c, Visit&& visit) {
    auto other = others(c).begin();
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
  // Nodes of the largest cell that is no polyhedron.
  static constexpr int kMostNodes = 27;

  const Mesh& mesh_;
  const Points& points_;
  const CellNeighbours& neighbours_;
  const Orientation& orientation_;
  std::vector<Vector3d> corners_;
};

/// The corners and the faces of a tetrahedron, by local_faces.
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

/// Whether a cell is a tetrahedron with all corners apart: every face counts, and the formulas are
/// closed.
inline bool is_proper_tetra(const PlacedCells& cells, Index c) {
  if (cells.mesh().types[c] != CellType::Tetra) return false;
  auto other = cells.others(c).begin();
  return other[0] != c && other[1] != c && other[2] != c && other[3] != c;
}

struct CellShape {
  Vector3d centre = Vector3d::Zero();
  double volume = 0;
  Vector3d projection = Vector3d::Zero();  ///< sums of |area components|
};

inline CellShape tetra_shape(const Tetra& tetra, double sign) {
  CellShape cell;
  const Vector3d a = tetra.x[1] - tetra.x[0], b = tetra.x[2] - tetra.x[0],
                 c = tetra.x[3] - tetra.x[0];
  const Vector3d ab = a.cross(b), bc = b.cross(c), ca = c.cross(a);
  cell.centre = tetra.centre;
  cell.volume = sign * a.dot(bc) / 6;
  cell.projection = (ab.cwiseAbs() + bc.cwiseAbs() + ca.cwiseAbs() + (ab + bc + ca).cwiseAbs()) / 2;
  return cell;
}

/// Of the cell that `faces` enclose, whose areas look out of it where `sign` is 1.
inline CellShape shape_of_faces(std::span<const FaceShape> faces, double sign) {
  Vector3d guess = Vector3d::Zero();
  for (const FaceShape& face : faces) guess += face.centre;
  guess /= static_cast<double>(std::max<std::size_t>(faces.size(), 1));
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

/// Of solid cell c; `faces` is memory to use.
inline CellShape cell_shape(PlacedCells& cells, Index c, std::vector<FaceShape>& faces) {
  if (is_proper_tetra(cells, c)) return tetra_shape(Tetra(cells, c), cells.sign(c));
  faces.clear();
  cells.for_each_face(c,
                      [&](const PlacedFace& face) { faces.push_back(face_shape(face.corners)); });
  return shape_of_faces(faces, cells.sign(c));
}

/// Whether solid cells of a type are what their plane-edged faces enclose, in a mesh for solvers by
/// finite volumes.
inline bool is_volume(const Mesh& mesh, CellType type) {
  const CellInfo& info = info_of(type);
  return mesh.is_of_finite_volumes && info.dimension == 3 &&
         (type == CellType::Polyhedron || info.corners == info.nodes);
}

/// How sound such a cell `c` is: the smallest pyramid of a face over the cell's centroid, in
/// volumes of the cell. Not positive where that is not, or the volume, as checkMesh tells it
/// (primitiveMeshCheck::checkFacePyramids). `orientation`: 1 or -1, see Orientation.
double soundness(const Mesh& mesh, const Points& points, Index c, int orientation);
inline bool is_sound(const Mesh& mesh, const Points& points, Index c, int orientation) {
  return soundness(mesh, points, c, orientation) > 0;
}

}  // namespace finite_volume
}  // namespace cadmorph
