#include "core/finite_volumes.h"

#include <algorithm>

#include "core/plane_mesh.h"

namespace cadmorph {

FiniteVolumes::FiniteVolumes(const Mesh& mesh, const Points& points,
                             const CellNeighbours& neighbours, const Orientation& orientation)
    : mesh_(mesh),
      neighbours_(neighbours),
      orientation_(orientation),
      normal_(neighbours.neighbour.empty() ? plane_normal(mesh, points) : Eigen::Vector3d::Zero()) {
  if (normal_.isZero(0)) return;
  layer_.emplace();
  layer_->mesh = one_layer(mesh, points);
  layer_->neighbours = find_cell_neighbours(layer_->mesh);
  layer_->orientation = detect_orientation(layer_->mesh);
}

const Points& FiniteVolumes::place(const Points& points, Points& scratch) const {
  if (!is_layer()) return points;
  const Index n = mesh_.node_count();
  scratch.resize(2 * n, 3);
  scratch << points, points.rowwise() + normal_.transpose();
  return scratch;
}

namespace finite_volume {
namespace {

// By all faces of a cell but those without area.
double soundness_of(std::span<const FaceShape> faces, double sign) {
  const CellShape cell = shape_of_faces(faces, sign);
  // The more so, the less volume its faces enclose.
  if (!(cell.volume > 0))
    return faces.empty() ? -1 : cell.volume / std::pow(cell.projection.sum(), 1.5) - 1;
  double least = 1;
  for (const FaceShape& face : faces)
    least = std::min(least, sign * face.area.dot(face.centre - cell.centre) / (3 * cell.volume));
  return least;
}

}  // namespace

double soundness(const Mesh& mesh, const Points& points, Index c, int orientation) {
  if (mesh.types[c] == CellType::Polyhedron) {
    std::vector<FaceShape> faces;
    std::vector<Vector3d> corners;
    for_each_polyhedron_face(mesh, c, [&](std::span<const Index> nodes) {
      corners.clear();
      for (const Index n : nodes) corners.push_back(points.row(n).transpose());
      const FaceShape face = face_shape(corners);
      if (!face.area.isZero(0)) faces.push_back(face);
    });
    return soundness_of(faces, orientation);
  }
  const auto cell = mesh.cell(c);
  std::array<FaceShape, 6> faces;
  std::size_t count = 0;
  std::array<Vector3d, 4> corners;
  for (const LocalFace& local : local_faces(mesh.types[c])) {
    const auto corner_number = static_cast<std::size_t>(corner_count(local.type, local.count));
    for (std::size_t i = 0; i < corner_number; ++i)
      corners[i] = points.row(cell[local.nodes[i]]).transpose();
    faces[count] = face_shape({corners.data(), corner_number});
    if (!faces[count].area.isZero(0)) ++count;
  }
  return soundness_of({faces.data(), count}, orientation);
}

}  // namespace finite_volume
}  // namespace cadmorph
