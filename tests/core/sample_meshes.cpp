#include "sample_meshes.h"

#include <vtkCell.h>
#include <vtkGenericCell.h>
#include <vtkPoints.h>
#include <vtkSmartPointer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>

#include "core/cell_topology.h"

namespace cadmorph::testing {
namespace {

using enum CellType;

/// VTK has the pyramid of 14 nodes but without its last one, in the middle of the base.
CellType type_of_vtk(CellType type) {
  return type == BiquadraticQuadraticPyramid ? QuadraticPyramid : type;
}

vtkSmartPointer<vtkCell> vtk_cell(CellType type) {
  return vtkSmartPointer<vtkCell>::Take(vtkGenericCell::InstantiateCell(static_cast<int>(type)));
}

/// With its nodes numbered in order.
vtkSmartPointer<vtkCell> numbered_vtk_cell(CellType type) {
  const auto cell = vtk_cell(type);
  for (vtkIdType i = 0; i < cell->GetNumberOfPoints(); ++i) cell->GetPointIds()->SetId(i, i);
  return cell;
}

/// Of each node, three numbers.
std::vector<double> parametric_coordinates(CellType type) {
  const auto cell = vtk_cell(type_of_vtk(type));
  const double* first = cell->GetParametricCoords();
  std::vector<double> all(first, first + 3 * cell->GetNumberOfPoints());
  if (type != type_of_vtk(type)) all.insert(all.end(), {0.5, 0.5, 0});
  return all;
}

std::vector<Index> node_ids(vtkCell* cell) {
  std::vector<Index> ids;
  for (vtkIdType i = 0; i < cell->GetNumberOfPoints(); ++i) ids.push_back(cell->GetPointId(i));
  return ids;
}

void add_cell(Mesh& mesh, CellType type, const std::vector<Index>& nodes) {
  mesh.types.push_back(type);
  mesh.connectivity.insert(mesh.connectivity.end(), nodes.begin(), nodes.end());
  mesh.offsets.push_back(std::ssize(mesh.connectivity));
}

void add_polyhedron(Mesh& mesh, const std::vector<Index>& x) {
  add_cell(mesh, Polyhedron, x);
  constexpr int kFaces[6][4] = {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4},
                                {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}};
  for (const auto& face : kFaces) {
    mesh.polyhedron_faces.push_back(4);
    for (int i : face) mesh.polyhedron_faces.push_back(x[i]);
  }
}

/// Adds the cells of one block with corners `x` in a hexahedron's order and centre node `middle`.
void add_block(Mesh& mesh, CellType type, const std::vector<Index>& x, Index middle) {
  switch (type) {
    case Hexahedron:
      return add_cell(mesh, type, x);
    case Voxel:
      return add_cell(mesh, type, {x[0], x[1], x[3], x[2], x[4], x[5], x[7], x[6]});
    case Polyhedron:
      return add_polyhedron(mesh, x);
    case Wedge:
      add_cell(mesh, type, {x[0], x[2], x[1], x[4], x[6], x[5]});
      return add_cell(mesh, type, {x[0], x[3], x[2], x[4], x[7], x[6]});
    case Tetra: {
      constexpr int kPaths[6][2] = {{1, 2}, {2, 3}, {3, 7}, {7, 4}, {4, 5}, {5, 1}};
      for (const auto& path : kPaths) add_cell(mesh, type, {x[0], x[path[0]], x[path[1]], x[6]});
      return;
    }
    default: {
      constexpr int kBases[6][4] = {{0, 1, 2, 3}, {4, 7, 6, 5}, {0, 4, 5, 1},
                                    {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}};
      for (const auto& b : kBases)
        add_cell(mesh, Pyramid, {x[b[0]], x[b[1]], x[b[2]], x[b[3]], middle});
    }
  }
}

Mesh linear_cube(CellType type, int n) {
  Mesh mesh;
  mesh.offsets = {0};
  const int side = n + 1;
  const bool has_middles = type == Pyramid;
  const Index corners = Index{side} * side * side;
  mesh.points.resize(corners + (has_middles ? n * n * n : 0), 3);
  const auto id = [&](int i, int j, int k) { return (Index{k} * side + j) * side + i; };
  for (int k = 0; k < side; ++k)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) mesh.points.row(id(i, j, k)) = Eigen::RowVector3d(i, j, k) / n;
  Index middle = corners;
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i, ++middle) {
        const std::vector<Index> x = {
            id(i, j, k),     id(i + 1, j, k),     id(i + 1, j + 1, k),     id(i, j + 1, k),
            id(i, j, k + 1), id(i + 1, j, k + 1), id(i + 1, j + 1, k + 1), id(i, j + 1, k + 1)};
        if (has_middles)
          mesh.points.row(middle) = Eigen::RowVector3d(i + 0.5, j + 0.5, k + 0.5) / n;
        add_block(mesh, type, x, middle);
      }
  if (type == Polyhedron)
    for (Index c = 0; c <= mesh.cell_count(); ++c) mesh.polyhedron_offsets.push_back(c * 30);
  return mesh;
}

/// Node number by position, for nodes that are multiples of 1/1000 apart.
class NodeFinder {
 public:
  Index find(const Eigen::Vector3d& x) {
    std::array<Index, 3> key;
    for (int i = 0; i < 3; ++i) key[i] = std::llround(x[i] * 1e6);
    const auto [at, is_new] = numbers_.emplace(key, std::ssize(positions_));
    if (is_new) positions_.push_back(x);
    return at->second;
  }
  Points points() const {
    Points result(std::ssize(positions_), 3);
    for (Index n = 0; n < result.rows(); ++n) result.row(n) = positions_[n].transpose();
    return result;
  }

 private:
  std::map<std::array<Index, 3>, Index> numbers_;
  std::vector<Eigen::Vector3d> positions_;
};

Mesh elevate(const Mesh& linear, CellType type) {
  const auto low = vtk_cell(linear_type(type));
  const std::vector<double> parameters = parametric_coordinates(type);
  NodeFinder finder;
  Mesh mesh;
  mesh.offsets = {0};
  for (Index c = 0; c < linear.cell_count(); ++c) {
    std::vector<Index> nodes;
    for (std::size_t i = 0; i < parameters.size(); i += 3) {
      double weights[8];
      low->InterpolateFunctions(parameters.data() + i, weights);
      Eigen::Vector3d x = Eigen::Vector3d::Zero();
      const auto cell = linear.cell(c);
      for (std::size_t k = 0; k < cell.size(); ++k)
        x += weights[k] * linear.points.row(cell[k]).transpose();
      nodes.push_back(finder.find(x));
    }
    add_cell(mesh, type, nodes);
  }
  mesh.points = finder.points();
  return mesh;
}

}  // namespace

const std::vector<CellType>& solid_types() {
  static const std::vector<CellType> types = {Tetra,
                                              Voxel,
                                              Hexahedron,
                                              Wedge,
                                              Pyramid,
                                              QuadraticTetra,
                                              QuadraticHexahedron,
                                              QuadraticWedge,
                                              QuadraticPyramid,
                                              TriquadraticHexahedron,
                                              QuadraticLinearWedge,
                                              BiquadraticQuadraticWedge,
                                              BiquadraticQuadraticHexahedron,
                                              BiquadraticQuadraticPyramid,
                                              Polyhedron};
  return types;
}

const std::vector<CellType>& solid_types_without_polyhedron() {
  static const std::vector<CellType> types(solid_types().begin(), solid_types().end() - 1);
  return types;
}

Mesh cube(CellType type, int n) {
  const Mesh linear = linear_cube(linear_type(type), n);
  return linear_type(type) == type ? linear : elevate(linear, type);
}

Mesh two_halves() {
  Mesh mesh = cube(CellType::Tetra, 6);
  mesh.regions.assign(mesh.types.size(), 1);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    double x = 0;
    for (const Index n : mesh.cell(c)) x += mesh.points(n, 0) / 4;
    if (x > 0.5) mesh.regions[c] = 2;
  }
  return mesh;
}

Mesh single_cell(CellType type, const RowMatrix& positions) {
  Mesh mesh;
  mesh.points = positions;
  mesh.offsets = {0};
  std::vector<Index> nodes(positions.rows());
  for (Index n = 0; n < positions.rows(); ++n) nodes[n] = n;
  add_cell(mesh, type, nodes);
  return mesh;
}

Mesh parametric_cell(CellType type) {
  const std::vector<double> all = parametric_coordinates(type);
  return single_cell(type, Eigen::Map<const RowMatrix>(all.data(), std::ssize(all) / 3, 3));
}

std::vector<RowMatrix> vtk_derivatives_at_nodes(CellType type) {
  const auto cell = vtk_cell(type);
  const Index count = cell->GetNumberOfPoints();
  std::vector<RowMatrix> all;
  for (Index n = 0; n < count; ++n)
    cell->InterpolateDerivs(cell->GetParametricCoords() + 3 * n, all.emplace_back(3, count).data());
  return all;
}

std::vector<std::vector<Index>> vtk_faces(CellType type) {
  const auto cell = numbered_vtk_cell(type_of_vtk(type));
  std::vector<std::vector<Index>> faces;
  for (int f = 0; f < cell->GetNumberOfFaces(); ++f) faces.push_back(node_ids(cell->GetFace(f)));
  if (type != type_of_vtk(type))
    std::ranges::find(faces, 8U, &std::vector<Index>::size)->push_back(13);
  return faces;
}

std::vector<std::vector<Index>> vtk_edges(CellType type) {
  const auto cell = numbered_vtk_cell(type_of_vtk(type));
  std::vector<std::vector<Index>> edges;
  for (int e = 0; e < cell->GetNumberOfEdges(); ++e) edges.push_back(node_ids(cell->GetEdge(e)));
  return edges;
}

Points shaken(const Points& points, double amount, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> shift(-amount, amount);
  Points result = points;
  for (Index i = 0; i < result.size(); ++i) result.data()[i] += shift(generator);
  return result;
}

void set_regions_by_x(Mesh& mesh, double limit) {
  mesh.regions.clear();
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    double sum = 0;
    for (Index node : mesh.cell(c)) sum += mesh.points(node, 0);
    mesh.regions.push_back(sum / static_cast<double>(mesh.cell(c).size()) < limit ? 0 : 1);
  }
}

}  // namespace cadmorph::testing
