#include "core/quality.h"

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkMeshQuality.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkUnstructuredGrid.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/validity.h"
#include "sample_meshes.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

using Vec = Eigen::Vector3d;

const double kRoot2 = std::sqrt(2.0);
const double kRoot3 = std::sqrt(3.0);

double value_of(CellType type, const RowMatrix& positions) {
  const Mesh mesh = single_cell(type, positions);
  return scaled_jacobian(mesh, mesh.points, 0);
}

RowMatrix rows(std::initializer_list<Vec> positions) {
  RowMatrix result(static_cast<Index>(positions.size()), 3);
  Index n = 0;
  for (const Vec& x : positions) result.row(n++) = x.transpose();
  return result;
}

/// VTK's own Verdict, a value a cell.
std::vector<double> verdict(const Mesh& mesh) {
  vtkNew<vtkUnstructuredGrid> grid;
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (Index n = 0; n < mesh.node_count(); ++n) points->InsertNextPoint(mesh.points.row(n).data());
  grid->SetPoints(points);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    std::vector<vtkIdType> ids(mesh.cell(c).begin(), mesh.cell(c).end());
    grid->InsertNextCell(static_cast<int>(mesh.types[c]), std::ssize(ids), ids.data());
  }
  vtkNew<vtkMeshQuality> filter;
  filter->SetInputData(grid);
  filter->SetTriangleQualityMeasureToScaledJacobian();
  filter->SetQuadQualityMeasureToScaledJacobian();
  filter->SetTetQualityMeasureToScaledJacobian();
  filter->SetHexQualityMeasureToScaledJacobian();
  filter->Update();
  vtkDataArray* values = filter->GetOutput()->GetCellData()->GetArray("Quality");
  std::vector<double> result;
  for (Index c = 0; c < mesh.cell_count(); ++c) result.push_back(values->GetComponent(c, 0));
  return result;
}

/// Random cells of one type around their ideal shape, from hardly changed to inverted.
Mesh random_cells(CellType type, const RowMatrix& ideal, Index count) {
  Mesh mesh;
  mesh.offsets = {0};
  const Index nodes = ideal.rows();
  mesh.points.resize(count * nodes, 3);
  for (Index c = 0; c < count; ++c) {
    const double amount = 0.7 * static_cast<double>(c) / static_cast<double>(count);
    mesh.points.middleRows(c * nodes, nodes) =
        shaken(ideal, amount, static_cast<unsigned>(c)) +
        Points::Constant(nodes, 3, 0.01 * static_cast<double>(c));
    mesh.types.push_back(type);
    for (Index n = 0; n < nodes; ++n) mesh.connectivity.push_back(c * nodes + n);
    mesh.offsets.push_back(std::ssize(mesh.connectivity));
  }
  return mesh;
}

RowMatrix regular(CellType type) {
  const double h = kRoot3 / 2;
  switch (type) {
    case CellType::Triangle:
      return rows({{0, 0, 0}, {1, 0, 0}, {0.5, h, 0}});
    case CellType::Quad:
      return rows({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
    case CellType::Tetra:
      return rows({{0, 0, 0}, {1, 0, 0}, {0.5, h, 0}, {0.5, h / 3, std::sqrt(2.0 / 3)}});
    case CellType::Wedge:
      return rows({{0, 0, 0}, {0.5, h, 0}, {1, 0, 0}, {0, 0, 1}, {0.5, h, 1}, {1, 0, 1}});
    case CellType::Pyramid:
      return rows({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, kRoot2 / 2}});
    case CellType::Voxel:
      return rows(
          {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}});
    default:
      return rows(
          {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}});
  }
}

/// The quadratic cell with the corners of the regular one and straight edges.
RowMatrix regular_quadratic(CellType type) {
  const Mesh block = cube(type, 1);  // straight cells of some affine shape ...
  const Mesh linear = cube(linear_type(type), 1);
  const auto cell = block.cell(0);
  const auto corners = linear.cell(0);
  // ... taken to the regular one by the affine map of its corners; a pyramid's block is one
  // already.
  const RowMatrix target = regular(linear_type(type));
  Eigen::MatrixXd from(corners.size(), 4);
  for (std::size_t i = 0; i < corners.size(); ++i) from.row(i) << linear.points.row(corners[i]), 1;
  const Eigen::MatrixXd map = from.colPivHouseholderQr().solve(Eigen::MatrixXd(target));
  REQUIRE((from * map - target).norm() < 1e-12);
  RowMatrix result(cell.size(), 3);
  for (std::size_t i = 0; i < cell.size(); ++i) {
    Eigen::RowVector4d x;
    x << block.points.row(cell[i]), 1;
    result.row(i) = x * map;
  }
  return result;
}

/// A regular tetrahedron, cube, or prism over a regular polygon as a polyhedron.
Mesh polyhedron(const RowMatrix& points, const std::vector<std::vector<Index>>& faces) {
  Mesh mesh = single_cell(CellType::Polyhedron, points);
  for (const auto& face : faces) {
    mesh.polyhedron_faces.push_back(std::ssize(face));
    mesh.polyhedron_faces.insert(mesh.polyhedron_faces.end(), face.begin(), face.end());
  }
  mesh.polyhedron_offsets = {0, std::ssize(mesh.polyhedron_faces)};
  return mesh;
}

Mesh hexagonal_prism(double height) {
  RowMatrix points(12, 3);
  for (int i = 0; i < 12; ++i) {
    const double angle = std::numbers::pi / 3 * (i % 6);
    points.row(i) << std::cos(angle), std::sin(angle), i < 6 ? 0 : height;
  }
  std::vector<std::vector<Index>> faces = {{5, 4, 3, 2, 1, 0}, {6, 7, 8, 9, 10, 11}};
  for (Index i = 0; i < 6; ++i) faces.push_back({i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6});
  return polyhedron(points, faces);
}

const auto kLinearTypes = {CellType::Triangle,   CellType::Quad,  CellType::Tetra,  CellType::Voxel,
                           CellType::Hexahedron, CellType::Wedge, CellType::Pyramid};
const auto kQuadraticTypes = {CellType::QuadraticTetra,
                              CellType::QuadraticHexahedron,
                              CellType::TriquadraticHexahedron,
                              CellType::BiquadraticQuadraticHexahedron,
                              CellType::QuadraticWedge,
                              CellType::QuadraticLinearWedge,
                              CellType::BiquadraticQuadraticWedge,
                              CellType::QuadraticPyramid,
                              CellType::BiquadraticQuadraticPyramid};

}  // namespace

TEST_CASE("triangles, quads, tetrahedra and hexahedra agree with VTK's Verdict",
          "[core][quality]") {
  for (CellType type :
       {CellType::Triangle, CellType::Quad, CellType::Tetra, CellType::Hexahedron}) {
    CAPTURE(static_cast<int>(type));
    const Mesh mesh = random_cells(type, regular(type), 2000);
    const auto expected = verdict(mesh);
    int negative = 0;
    for (Index c = 0; c < mesh.cell_count(); ++c) {
      // Relative rounding of determinants of unit size; both sum in different orders.
      REQUIRE(scaled_jacobian(mesh, mesh.points, c) == Approx(expected[c]).margin(1e-12));
      negative += expected[c] < 0;
    }
    if (type != CellType::Triangle) REQUIRE(negative > 50);  // inverted cells are covered
  }
}

TEST_CASE("the ideal cell of each type has scaled Jacobian 1", "[core][quality]") {
  for (CellType type : kLinearTypes) {
    CAPTURE(static_cast<int>(type));
    REQUIRE(value_of(type, regular(type)) == Approx(1).epsilon(1e-14));
  }
  for (CellType type : kQuadraticTypes) {
    CAPTURE(static_cast<int>(type));
    REQUIRE(value_of(type, regular_quadratic(type)) == Approx(1).epsilon(1e-13));
  }
  const auto hexagon = [](int n) {
    RowMatrix points(n, 3);
    for (int i = 0; i < n; ++i)
      points.row(i) << std::cos(2 * std::numbers::pi * i / n),
          std::sin(2 * std::numbers::pi * i / n), 3;
    return points;
  };
  for (int n : {3, 4, 5, 6, 9})
    REQUIRE(value_of(CellType::Polygon, hexagon(n)) == Approx(1).epsilon(1e-14));
  REQUIRE(value_of(CellType::Line, regular(CellType::Triangle).topRows(2)) == 1);
}

TEST_CASE("regular polyhedra and a hexagonal prism of square sides have scaled Jacobian 1",
          "[core][quality]") {
  const Mesh tetra =
      polyhedron(regular(CellType::Tetra), {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 2, 1}});
  REQUIRE(scaled_jacobian(tetra, tetra.points, 0) == Approx(1).epsilon(1e-14));
  const Mesh box = cube(CellType::Polyhedron, 1);
  REQUIRE(scaled_jacobian(box, box.points, 0) == Approx(1).epsilon(1e-14));
  const Mesh prism = hexagonal_prism(1);
  REQUIRE(scaled_jacobian(prism, prism.points, 0) == Approx(1).epsilon(1e-14));
}

TEST_CASE("cells with known corner angles have the value worked out by hand", "[core][quality]") {
  // The corner of the unit cube: 1 / (1 * sqrt(2) * sqrt(2)), times sqrt(2).
  REQUIRE(value_of(CellType::Tetra, rows({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}})) ==
          Approx(kRoot2 / 2).epsilon(1e-14));
  // Upright wedge over the right-angled triangle: sin(45 deg) against sin(60 deg).
  REQUIRE(value_of(CellType::Wedge,
                   rows({{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0, 5}, {0, 1, 5}, {1, 0, 5}})) ==
          Approx(std::sqrt(2.0 / 3)).epsilon(1e-14));
  // Pyramid of height 1 on the unit square: at the apex 1 / 1.5^1.5, times sqrt(2).
  REQUIRE(value_of(CellType::Pyramid,
                   rows({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}})) ==
          Approx(kRoot2 / std::pow(1.5, 1.5)).epsilon(1e-14));
  // Flat pyramid of height 0.1: at the base corners 0.1 / sqrt(0.51), times sqrt(2).
  REQUIRE(value_of(CellType::Pyramid,
                   rows({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 0.1}})) ==
          Approx(kRoot2 * 0.1 / std::sqrt(0.51)).epsilon(1e-14));
  // Prism of height t over the hexagon of side 1: the sides' diagonals meet at 2 atan(t).
  const Mesh prism = hexagonal_prism(0.3);
  REQUIRE(scaled_jacobian(prism, prism.points, 0) ==
          Approx(std::sin(2 * std::atan(0.3))).epsilon(1e-13));
  // A flat cell.
  REQUIRE(value_of(CellType::Tetra, rows({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}})) == 0);
  REQUIRE(value_of(CellType::Hexahedron, RowMatrix::Zero(8, 3)) == 0);
}

TEST_CASE("straight quadratic tetrahedra have the value of the linear one", "[core][quality]") {
  for (unsigned seed = 0; seed < 50; ++seed) {
    const RowMatrix corners = shaken(regular(CellType::Tetra), 0.4, seed);
    RowMatrix all(10, 3);
    all.topRows(4) = corners;
    constexpr int kEdges[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
    for (int i = 0; i < 6; ++i)
      all.row(4 + i) = (corners.row(kEdges[i][0]) + corners.row(kEdges[i][1])) / 2;
    REQUIRE(value_of(CellType::QuadraticTetra, all) ==
            Approx(value_of(CellType::Tetra, corners)).margin(1e-12));
  }
}

TEST_CASE("curved hexahedra have the smallest scaled Jacobian of VTK's own shape functions",
          "[core][quality]") {
  for (CellType type : {CellType::QuadraticHexahedron, CellType::TriquadraticHexahedron,
                        CellType::BiquadraticQuadraticHexahedron}) {
    CAPTURE(static_cast<int>(type));
    const auto derivatives = vtk_derivatives_at_nodes(type);
    const RowMatrix straight = regular_quadratic(type);
    for (unsigned seed = 0; seed < 50; ++seed) {
      const RowMatrix x = shaken(straight, 0.08, seed);
      double expected = 1;
      for (const RowMatrix& d : derivatives) {
        const Eigen::Matrix3d j = d * x;  // rows dx/dr, dx/ds, dx/dt
        expected = std::min(expected, j.determinant() / j.rowwise().norm().prod());
      }
      const double value = value_of(type, x);
      // The centre is sampled too; in a type with a centre node it is among VTK's.
      if (type == CellType::TriquadraticHexahedron)
        REQUIRE(value == Approx(expected).margin(1e-12));
      else
        REQUIRE(value <= expected + 1e-12);
      REQUIRE(value >= expected - 0.05);  // the centre of so small a change is no worst place
    }
  }
}

TEST_CASE("curved wedges and tetrahedra have the signs of VTK's own shape functions",
          "[core][quality]") {
  for (CellType type : {CellType::QuadraticTetra, CellType::QuadraticWedge,
                        CellType::QuadraticLinearWedge, CellType::BiquadraticQuadraticWedge}) {
    CAPTURE(static_cast<int>(type));
    const auto derivatives = vtk_derivatives_at_nodes(type);
    const RowMatrix straight = regular_quadratic(type);
    const double sign = (derivatives[0] * straight).determinant() > 0 ? 1 : -1;
    int inverted = 0;
    for (unsigned seed = 0; seed < 200; ++seed) {
      const Mesh mesh = single_cell(type, shaken(straight, 0.16, seed));
      double smallest = std::numeric_limits<double>::infinity();
      for (const RowMatrix& d : derivatives)
        smallest = std::min(smallest, sign * (d * RowMatrix(mesh.points)).determinant());
      const auto report = measure_quality(mesh, mesh.points, Orientation(256, 1));
      if (smallest <= 0) REQUIRE(report.inverted == 1);
      if (report.inverted == 0) REQUIRE(smallest > 0);
      REQUIRE((report.inverted == 1) == (report.min <= 0));
      inverted += smallest <= 0;
    }
    REQUIRE(inverted > 10);
    REQUIRE(inverted < 190);
  }
}

TEST_CASE("a mid node inverts a quadratic cell when it passes the quarter of its edge",
          "[core][quality]") {
  // At a corner the map's derivative along an edge of length 1 is 4t - 1, the mid node at t.
  for (CellType type : kQuadraticTypes) {
    CAPTURE(static_cast<int>(type));
    const RowMatrix straight = regular_quadratic(type);
    const RowMatrix first = straight.row(0);
    Index mid = linear_type(type) == CellType::Tetra     ? 4
                : linear_type(type) == CellType::Wedge   ? 6
                : linear_type(type) == CellType::Pyramid ? 5
                                                         : 8;
    for (double t : {0.24, 0.26}) {
      RowMatrix x = straight;
      x.row(mid) = first + t * (x.row(1) - x.row(0));
      const Mesh mesh = single_cell(type, x);
      const auto report = measure_quality(mesh, mesh.points, Orientation(256, 1));
      REQUIRE(report.inverted == (t < 0.25 ? 1 : 0));
    }
  }
}

TEST_CASE("a quadratic pyramid's apex inverts when its edges curl past the quarter",
          "[core][quality]") {
  for (const CellType type : {CellType::QuadraticPyramid, CellType::BiquadraticQuadraticPyramid}) {
    const RowMatrix straight = regular_quadratic(type);
    for (double t : {0.24, 0.26}) {
      RowMatrix x = straight;
      for (int i = 0; i < 4; ++i) x.row(9 + i) = x.row(4) + t * (x.row(i) - x.row(4));
      const Mesh mesh = single_cell(type, x);
      const auto report = measure_quality(mesh, mesh.points, Orientation(256, 1));
      REQUIRE(report.inverted == (t < 0.25 ? 1 : 0));
    }
  }
}

TEST_CASE("the scaled Jacobian does not change with place, size and turn", "[core][quality]") {
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(0.7, Vec(1, 2, 3).normalized()) * Eigen::Scaling(17.0)).matrix();
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    Mesh mesh = cube(type, 2);
    mesh.points = shaken(mesh.points, 0.04, 1);
    const Points moved = (mesh.points * turn.transpose()).rowwise() + Eigen::RowVector3d(1, 2, 3);
    for (Index c = 0; c < mesh.cell_count(); ++c)
      REQUIRE(scaled_jacobian(mesh, moved, c) ==
              Approx(scaled_jacobian(mesh, mesh.points, c)).margin(1e-12));
  }
}

TEST_CASE("measured again, some cells alone, a mesh has the figures of all", "[core][quality]") {
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    const Mesh mesh = cube(type, 6);
    const Orientation orientation = detect_orientation(mesh);
    // Far enough to invert some of the cells at the nodes that move.
    Points moved = mesh.points;
    std::vector<Index> cells;
    for (Index node = 0; node < mesh.node_count(); ++node)
      if (mesh.points(node, 0) < 0.5) moved.row(node) = shaken(mesh.points, 0.12, 3).row(node);
    for (Index c = 0; c < mesh.cell_count(); ++c)
      if (std::ranges::any_of(mesh.cell(c), [&](Index n) { return mesh.points(n, 0) < 0.5; }))
        cells.push_back(c);
    REQUIRE(std::ssize(cells) < mesh.cell_count());

    const QualityReport all = measure_quality(mesh, moved, orientation);
    const QualityReport before = measure_quality(mesh, mesh.points, orientation);
    REQUIRE(all.inverted > before.inverted);
    const QualityReport again = measure_again(before, mesh, moved, orientation, cells);
    CHECK(again.values == all.values);
    CHECK(again.inverted_cells == all.inverted_cells);
    CHECK(again.inverted == all.inverted);
    CHECK(again.cells == all.cells);
    CHECK(again.min == all.min);
    CHECK(again.mean == all.mean);
    CHECK(again.worst_cell == all.worst_cell);
    // And back, with no trace of the way.
    const QualityReport back = measure_again(again, mesh, mesh.points, orientation, cells);
    CHECK(back.values == before.values);
    CHECK(back.inverted_cells == before.inverted_cells);
    CHECK(back.mean == before.mean);

    const ValidityReport valid = check_validity(mesh, moved, orientation);
    const ValidityReport some = check_validity(mesh, moved, orientation, cells);
    CHECK(some.invalid_cells == valid.invalid_cells);
    CHECK(some.invalid > 0);
    CHECK(some.cells == std::ssize(cells));
    CHECK(check_validity(mesh, moved, orientation, {}).invalid == 0);
  }
}

TEST_CASE("shell cells count as inverted only when degenerate or folded", "[core][quality]") {
  const auto inverted = [](CellType type, const RowMatrix& x) {
    const Mesh mesh = single_cell(type, x);
    return measure_quality(mesh, mesh.points, detect_orientation(mesh)).inverted;
  };
  RowMatrix triangle = regular(CellType::Triangle);
  REQUIRE(inverted(CellType::Triangle, triangle) == 0);
  triangle.row(1).swap(triangle.row(2));
  REQUIRE(inverted(CellType::Triangle, triangle) == 0);
  REQUIRE(inverted(CellType::Triangle, rows({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}})) == 1);
  const RowMatrix bow = rows({{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 2, 0}});
  REQUIRE(inverted(CellType::Quad, bow) == 1);
  const RowMatrix dart = rows({{0, 0, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}});
  REQUIRE(inverted(CellType::Quad, dart) == 1);
  RowMatrix curved =
      rows({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.5, -0.1, 0}, {0.6, 0.6, 0.1}, {0, 0.5, 0}});
  REQUIRE(inverted(CellType::QuadraticTriangle, curved) == 0);
  curved.row(3) << 0.2, 0, 0;
  REQUIRE(inverted(CellType::QuadraticTriangle, curved) == 1);
  REQUIRE(
      inverted(CellType::Polygon, rows({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}})) ==
      0);  // a hanging node is none
}

TEST_CASE("the orientation is taken type by type", "[core][quality]") {
  for (CellType type : solid_types()) {
    CAPTURE(static_cast<int>(type));
    const auto number = static_cast<std::size_t>(type);
    Mesh mesh = cube(type, 2);
    REQUIRE(detect_orientation(mesh)[number] == 1);
    const auto expected = measure_quality(mesh, mesh.points, detect_orientation(mesh));
    REQUIRE(expected.inverted == 0);
    mesh.points.col(1) *= -1;
    const Orientation mirrored = detect_orientation(mesh);
    REQUIRE(mirrored[number] == -1);
    const auto report = measure_quality(mesh, mesh.points, mirrored);
    REQUIRE(report.inverted == 0);
    REQUIRE(report.min == Approx(expected.min).epsilon(1e-12));
    REQUIRE(measure_quality(mesh, mesh.points, Orientation(256, 1)).inverted == mesh.cell_count());
  }
}

TEST_CASE("a report names the worst and the inverted cells", "[core][quality]") {
  Mesh mesh = cube(CellType::Hexahedron, 4);
  mesh.types.push_back(CellType::Quad);
  for (Index node : {0, 1, 6, 5}) mesh.connectivity.push_back(node);
  mesh.offsets.push_back(std::ssize(mesh.connectivity));
  const Orientation orientation = detect_orientation(mesh);
  Points points = mesh.points;
  points.row(mesh.cell(21)[6]) = points.row(mesh.cell(21)[0]);  // inverts what meets there
  const auto report = measure_quality(mesh, points, orientation);
  REQUIRE(report.cells == 64);
  double sum = 0, smallest = 2;
  std::vector<Index> inverted;
  for (Index c = 0; c < 64; ++c) {
    const double value = scaled_jacobian(mesh, points, c);
    REQUIRE(report.values[c] == value);
    sum += value;
    smallest = std::min(smallest, value);
    if (value <= 0) inverted.push_back(c);
  }
  REQUIRE(std::isnan(report.values[64]));
  REQUIRE(report.mean == Approx(sum / 64).epsilon(1e-14));
  REQUIRE(report.min == smallest);
  REQUIRE(report.values[report.worst_cell] == smallest);
  REQUIRE(report.inverted_cells == inverted);
  REQUIRE(report.inverted == std::ssize(inverted));
  REQUIRE(std::ranges::count(inverted, 21) == 1);
}

TEST_CASE("the report is the same on one thread and on all", "[core][quality]") {
  Mesh mesh = cube(CellType::Tetra, 16);
  const Points points = shaken(mesh.points, 0.02, 5);
  const Orientation orientation = detect_orientation(mesh);
  const auto all = measure_quality(mesh, points, orientation);
  set_thread_count(1);
  const auto one = measure_quality(mesh, points, orientation);
  set_thread_count(0);
  REQUIRE(one.mean == all.mean);
  REQUIRE(one.min == all.min);
  REQUIRE(one.inverted_cells == all.inverted_cells);
  REQUIRE(one.inverted > 0);
}

TEST_CASE("positions that do not fit the mesh or are not finite are refused", "[core][quality]") {
  const Mesh mesh = cube(CellType::Tetra, 1);
  const Orientation orientation = detect_orientation(mesh);
  REQUIRE_THROWS_AS(measure_quality(mesh, Points::Zero(3, 3), orientation), InvalidInputError);
  Points points = mesh.points;
  points(2, 2) = std::numeric_limits<double>::infinity();
  REQUIRE_THROWS_WITH(measure_quality(mesh, points, orientation), Catch::Contains("node 2"));
}
