#include "core/validity.h"

#include <vtkGenericCell.h>
#include <vtkNew.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "sample_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;

enum class Domain { Cube, Prism, Simplex, Pyramid };

Domain domain_of(CellType type) {
  switch (linear_type(type)) {
    case CellType::Tetra:
      return Domain::Simplex;
    case CellType::Wedge:
      return Domain::Prism;
    case CellType::Pyramid:
      return Domain::Pyramid;
    default:
      return Domain::Cube;
  }
}

// Parametric points all over a cell, its sides included.
std::vector<std::array<double, 3>> dense_points(Domain domain, int n) {
  std::vector<std::array<double, 3>> points;
  for (int k = 0; k <= n; ++k)
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) {
        if (domain == Domain::Prism && i + j > n) continue;
        if (domain == Domain::Simplex && i + j + k > n) continue;
        if (domain == Domain::Pyramid && k == n) continue;  // VTK's map collapses at the apex
        points.push_back({1.0 * i / n, 1.0 * j / n, 1.0 * k / n});
      }
  return points;
}

// Smallest Jacobian determinant over a dense grid, by VTK's own shape functions, and its value at
// the cell's parametric shape for scale.
class DenseSampling {
 public:
  explicit DenseSampling(CellType type, int n) {
    vtkNew<vtkGenericCell> cell;
    cell->SetCellType(static_cast<int>(type));
    const int nodes = cell->GetNumberOfPoints();
    for (const auto& point : dense_points(domain_of(type), n)) {
      std::vector<double> derivatives(3 * nodes);
      std::array<double, 3> at = point;
      cell->InterpolateDerivs(at.data(), derivatives.data());
      derivatives_.push_back(Eigen::Map<RowMatrix>(derivatives.data(), 3, nodes));
      const double apex = domain_of(type) == Domain::Pyramid ? std::pow(1 - point[2], 2) : 1;
      factors_.push_back(1 / apex);
    }
  }

  double least(const Points& points) const {
    double result = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < derivatives_.size(); ++i) {
      const Eigen::Matrix3d jacobian = derivatives_[i] * points;
      result = std::min(result, factors_[i] * jacobian.determinant());
    }
    return result;
  }

 private:
  std::vector<RowMatrix> derivatives_;
  std::vector<double> factors_;
};

// Types whose map VTK evaluates as this library understands it. VTK's quadratic pyramid has another
// map between its nodes.
const std::vector<CellType> kMappedTypes = {
    CellType::Tetra,
    CellType::Voxel,
    CellType::Hexahedron,
    CellType::Wedge,
    CellType::Pyramid,
    CellType::QuadraticTetra,
    CellType::QuadraticHexahedron,
    CellType::QuadraticWedge,
    CellType::TriquadraticHexahedron,
    CellType::QuadraticLinearWedge,
    CellType::BiquadraticQuadraticWedge,
    CellType::BiquadraticQuadraticHexahedron,
};

}  // namespace

TEST_CASE("Cells of every type are valid as they come and invalid mirrored", "[core][validity]") {
  for (const CellType type : solid_types()) {
    const Mesh mesh = cube(type, 2);
    const Orientation orientation = detect_orientation(mesh);
    INFO("type " << static_cast<int>(type));
    const ValidityReport report = check_validity(mesh, mesh.points, orientation);
    CHECK(report.cells == mesh.cell_count());
    CHECK(report.invalid == 0);
    Points mirrored = mesh.points;
    mirrored.col(0) *= -1;
    CHECK(check_validity(mesh, mirrored, orientation).invalid == mesh.cell_count());
    Mesh other = mesh;
    other.points = mirrored;
    CHECK(check_validity(other, mirrored, detect_orientation(other)).invalid == 0);
  }
}

TEST_CASE("The exact test agrees with dense sampling of VTK's shape functions",
          "[core][validity]") {
  for (const CellType type : kMappedTypes) {
    const Mesh cell = parametric_cell(type);
    const DenseSampling sampling(type, 12);
    // VTK's map of its parametric wedge is right-handed, its documented node order is not.
    const Orientation orientation = detect_orientation(cell);
    int valid = 0, invalid = 0;
    for (unsigned seed = 1; seed <= 300; ++seed) {
      // From nearly parametric to wildly distorted.
      const Points points = shaken(cell.points, 0.03 + 0.8 * seed / 300, seed);
      const double least = sampling.least(points);
      const bool is_valid = check_validity(cell, points, orientation).invalid == 0;
      INFO("type " << static_cast<int>(type) << ", seed " << seed << ", least " << least);
      if (is_valid)
        CHECK(least > 0);
      else
        // The grid misses a negative value only where it is small: the determinant is Lipschitz
        // with a constant of some units here, and the grid is 1/12 wide.
        CHECK(least < 0.1);
      (is_valid ? valid : invalid) += 1;
    }
    CHECK(valid > 10);
    CHECK(invalid > 10);
  }
}

TEST_CASE("A pyramid of 14 nodes is that of 13 where the last lies on its base",
          "[core][validity]") {
  Points straight(14, 3);
  straight.topRows(5) << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.5, 1;
  for (Index i = 0; i < 4; ++i) {
    straight.row(5 + i) = (straight.row(i) + straight.row((i + 1) % 4)) / 2;
    straight.row(9 + i) = (straight.row(i) + straight.row(4)) / 2;
  }
  straight.row(13) = straight.topRows(4).colwise().mean();
  const Mesh thirteen = single_cell(CellType::QuadraticPyramid, straight.topRows(13));
  const Mesh fourteen = single_cell(CellType::BiquadraticQuadraticPyramid, straight);
  const auto is_valid = [](const Mesh& mesh, const Points& points) {
    return check_validity(mesh, points, Orientation(256, 1)).invalid == 0;
  };
  REQUIRE(is_valid(fourteen, straight));
  int valid = 0;
  for (unsigned seed = 1; seed <= 300; ++seed) {
    const Points points = shaken(thirteen.points, 0.4 * seed / 300, seed);
    Points more(14, 3);
    more << points,
        points.middleRows(5, 4).colwise().sum() / 2 - points.topRows(4).colwise().sum() / 4;
    CHECK(is_valid(fourteen, more) == is_valid(thirteen, points));
    valid += is_valid(thirteen, points);
  }
  CHECK(valid > 10);
  CHECK(valid < 290);
  // Along the middle of the base x = (1 + r) / 2 + m (1 - r^2), r from -1 to 1.
  for (const double m : {0.24, 0.26}) {
    Points points = straight;
    points(13, 0) += m;
    CHECK(is_valid(fourteen, points) == (m < 0.25));
  }
}

TEST_CASE("A hexahedron with eight good corners can be invalid", "[core][validity]") {
  const Mesh mesh = parametric_cell(CellType::Hexahedron);
  const Orientation orientation(256, 1);
  const DenseSampling sampling(CellType::Hexahedron, 16);
  int found = 0;
  for (unsigned seed = 1; seed <= 20000 && found < 3; ++seed) {
    const Points points = shaken(mesh.points, 0.55, seed);
    if (measure_quality(mesh, points, orientation).inverted > 0) continue;
    if (sampling.least(points) >= 0) continue;
    ++found;
    CHECK(check_validity(mesh, points, orientation).invalid == 1);
  }
  CHECK(found == 3);
}

TEST_CASE("Cells of immense size are judged soon", "[core][validity]") {
  // Their determinants overflow, or are all but zero in whole regions.
  for (const double size : {1e60, 1e100, 1e135, 1e160, 1e300})
    for (const CellType type : kMappedTypes)
      for (int component = 0; component < 3; ++component) {
        const Mesh mesh = parametric_cell(type);
        const Orientation orientation = detect_orientation(mesh);
        Points points = mesh.points;
        points(0, component) = size;
        INFO("type " << static_cast<int>(type) << ", " << size << " in " << component);
        CHECK(check_validity(mesh, points, orientation).cells == 1);
        points.row(0).setConstant(size);
        CHECK(check_validity(mesh, points, orientation).cells == 1);
      }
}

TEST_CASE("Flat cells are invalid wherever they lie", "[core][validity]") {
  for (const CellType type : kMappedTypes) {
    const Mesh mesh = parametric_cell(type);
    const Orientation orientation = detect_orientation(mesh);
    Points flat = mesh.points;
    flat.col(2) = 0.3 * flat.col(0) + 0.7 * flat.col(1);
    flat.rowwise() += Eigen::RowVector3d(1e3, 1e3, 1e3);
    INFO("type " << static_cast<int>(type));
    CHECK(check_validity(mesh, flat, orientation).invalid == 1);
  }
}

TEST_CASE("Boundary-layer cells of 1e-6 of the part's size far from the origin are valid",
          "[core][validity]") {
  for (const CellType type : kMappedTypes) {
    Mesh mesh = cube(type, 2);
    const Orientation orientation = detect_orientation(mesh);
    mesh.points.col(2) *= 1e-6;
    mesh.points.rowwise() += Eigen::RowVector3d(1, 2, 0);
    INFO("type " << static_cast<int>(type));
    CHECK(check_validity(mesh, mesh.points, orientation).invalid == 0);
  }
}

TEST_CASE("A hexahedron collapsed to a wedge is valid", "[core][validity]") {
  Mesh mesh = parametric_cell(CellType::Hexahedron);
  mesh.connectivity = {0, 1, 2, 2, 4, 5, 6, 6};
  const Orientation orientation(256, 1);
  CHECK(check_validity(mesh, mesh.points, orientation).invalid == 0);
  Points mirrored = mesh.points;
  mirrored.col(2) *= -1;
  CHECK(check_validity(mesh, mirrored, orientation).invalid == 1);
}

TEST_CASE("Invalid cells are named in ascending order", "[core][validity]") {
  const Mesh mesh = cube(CellType::Hexahedron, 4);
  const Orientation orientation = detect_orientation(mesh);
  Points points = mesh.points;
  const Index node = mesh.cell(21)[6];
  points.row(node) -= Eigen::RowVector3d(0.6, 0.6, 0.6);
  const ValidityReport report = check_validity(mesh, points, orientation);
  CHECK(report.invalid == static_cast<Index>(report.invalid_cells.size()));
  CHECK(std::is_sorted(report.invalid_cells.begin(), report.invalid_cells.end()));
  CHECK(std::count(report.invalid_cells.begin(), report.invalid_cells.end(), 21) == 1);
  CHECK(report.undecided == 0);
}

TEST_CASE("Positions that do not fit the mesh have no validity", "[core][validity]") {
  const Mesh mesh = cube(CellType::Hexahedron, 2);
  const Orientation orientation = detect_orientation(mesh);
  const Points few = mesh.points.topRows(8);
  REQUIRE_THROWS_AS(check_validity(mesh, few, orientation), InvalidInputError);
  Points points = mesh.points;
  points(13, 2) = std::numeric_limits<double>::quiet_NaN();
  REQUIRE_THROWS_WITH(check_validity(mesh, points, orientation), Catch::Contains("node 13"));
}

// The mean of its nodes lies on the inner edge, the centroid of its volume inside.
TEST_CASE("a prism over an L is a valid polyhedron, and none turned inside out",
          "[core][validity]") {
  Mesh mesh;
  mesh.points.resize(12, 3);
  const double outline[6][2] = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  std::vector<std::vector<Index>> faces(2);
  for (Index i = 0; i < 6; ++i) {
    mesh.points.row(i) << outline[i][0], outline[i][1], 0;
    mesh.points.row(i + 6) << outline[i][0], outline[i][1], 1;
    faces[0].insert(faces[0].begin(), i);
    faces[1].push_back(i + 6);
    const Index next = (i + 1) % 6;
    faces.push_back({i, next, next + 6, i + 6});
  }
  add_polyhedron(mesh, faces);
  CHECK(check_validity(mesh, mesh.points, detect_orientation(mesh)).invalid == 0);
  Points inside_out = mesh.points;
  inside_out.col(2) *= -1;
  CHECK(check_validity(mesh, inside_out, detect_orientation(mesh)).invalid == 1);
}

TEST_CASE("Cells in a wrong node order are told from cells with misplaced nodes", "[core]") {
  // Five in a cube, the last with a face to each of the others.
  Mesh mesh;
  mesh.points.resize(8, 3);
  mesh.points << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1;
  mesh.offsets.push_back(0);
  for (const std::array<Index, 4>& nodes : std::vector<std::array<Index, 4>>{
           {0, 1, 2, 5}, {0, 2, 3, 7}, {0, 5, 7, 4}, {2, 7, 5, 6}, {0, 2, 7, 5}}) {
    mesh.connectivity.insert(mesh.connectivity.end(), nodes.begin(), nodes.end());
    mesh.types.push_back(CellType::Tetra);
    mesh.offsets.push_back(std::ssize(mesh.connectivity));
  }
  const Orientation orientation = detect_orientation(mesh);
  REQUIRE(check_validity(mesh, mesh.points, orientation).invalid == 0);
  const auto misordered = [&](const Mesh& m) {
    return misordered_cells(m, find_cell_neighbours(m), orientation,
                            check_validity(m, m.points, orientation).invalid_cells);
  };
  Mesh moved = mesh;
  moved.points.row(1) << 0.2, 0.8, 0.9;  // to the other side of its cell's face
  REQUIRE(check_validity(moved, moved.points, orientation).invalid == 1);
  CHECK(misordered(moved).empty());
  // The middle one and two around it, which touch the middle one alone.
  Mesh swapped = mesh;
  for (const Index c : {0, 2, 4})
    std::swap(swapped.connectivity[4 * c], swapped.connectivity[4 * c + 1]);
  CHECK(misordered(swapped) == std::vector<Index>{0, 2, 4});
}

TEST_CASE("A hexahedron in a wrong node order is told by the faces it misses", "[core]") {
  const Mesh mesh = cube(CellType::Hexahedron, 3);
  const Orientation orientation = detect_orientation(mesh);
  const auto misordered = [&](const Mesh& m) {
    return misordered_cells(m, find_cell_neighbours(m), orientation,
                            check_validity(m, m.points, orientation).invalid_cells);
  };
  constexpr Index kMiddle = 13;
  for (const int other : {1, 2, 6}) {  // across an edge, a face, the cell
    CAPTURE(other);
    Mesh swapped = mesh;
    std::swap(swapped.connectivity[8 * kMiddle], swapped.connectivity[8 * kMiddle + other]);
    CHECK(misordered(swapped) == std::vector<Index>{kMiddle});
  }
  Mesh moved = mesh;
  moved.points.row(mesh.cell(kMiddle)[0]) = moved.points.row(mesh.cell(kMiddle)[6]);
  REQUIRE(check_validity(moved, moved.points, orientation).invalid > 0);
  CHECK(misordered(moved).empty());
}

TEST_CASE("Finite volumes take a cell for what its faces enclose", "[core][validity]") {
  Mesh mesh;
  mesh.points.resize(8, 3);
  mesh.points << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1;
  add_cell(mesh, CellType::Hexahedron, std::array<Index, 8>{0, 1, 2, 3, 4, 5, 6, 7});
  const Orientation orientation = detect_orientation(mesh);
  const auto invalid = [&](bool is_of_finite_volumes) {
    mesh.is_of_finite_volumes = is_of_finite_volumes;
    const Index inverted = measure_quality(mesh, mesh.points, orientation).inverted;
    CHECK(inverted == check_validity(mesh, mesh.points, orientation).invalid);
    return inverted;
  };
  CHECK(invalid(true) == 0);
  CHECK(invalid(false) == 0);
  // Past the plane through its three neighbours a corner's Jacobian is negative.
  mesh.points.row(6).setConstant(0.6);
  CHECK(invalid(true) == 0);
  CHECK(invalid(false) == 1);
  // Its three faces look inwards from the cell's centroid.
  mesh.points.row(6).setConstant(-1.5);
  CHECK(invalid(true) == 1);
  CHECK(invalid(false) == 1);
  // Inside out.
  mesh.points.row(6).setConstant(1);
  mesh.points.col(0) *= -1;
  CHECK(invalid(true) == 1);
  CHECK(invalid(false) == 1);
}

}  // namespace cadmorph
