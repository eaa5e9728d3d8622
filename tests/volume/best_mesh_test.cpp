#include "volume/best_mesh.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <iterator>
#include <numbers>

#include "../core/sample_meshes.h"
#include "core/boundary.h"
#include "core/cell_topology.h"
#include "core/layer_heights.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"
#include "core/quality_checks.h"
#include "volume/shape_energy.h"
#include "volume/triangle_shape.h"
#include "volume/volume_morph.h"
#include "volume_meshes.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;
using Eigen::VectorXd;

std::vector<Index> all(Index count) {
  std::vector<Index> result(count);
  for (Index i = 0; i < count; ++i) result[i] = i;
  return result;
}

std::vector<Index> unfixed(const std::vector<char>& is_fixed) {
  std::vector<Index> result;
  for (Index i = 0; i < std::ssize(is_fixed); ++i)
    if (!is_fixed[i]) result.push_back(i);
  return result;
}

// Puts nodes that are no corners into the middle of theirs.
void straighten(const Mesh& mesh, Points& points) {
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (const LocalMidNode& mid : mid_nodes_of(mesh.types[c])) {
      const auto nodes = mesh.cell(c);
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      for (const int corner : mid.corners) sum += points.row(nodes[std::size_t(corner)]);
      points.row(nodes[std::size_t(mid.node)]) = sum / double(mid.corners.size());
    }
}

// The unit cube whose sides are fixed.
struct FixedCube {
  explicit FixedCube(Mesh given) : mesh(std::move(given)), is_fixed(mesh.node_count(), 0) {
    for (const Index node : cube_surface(mesh)) is_fixed[node] = 1;
    orientation = detect_orientation(mesh);
    quality = measure_quality(mesh, mesh.points, orientation);
    neighbours = find_cell_neighbours(mesh);
  }

  FiniteVolumes volumes() const { return {mesh, mesh.points, neighbours, orientation}; }

  BestMeshResult raised(const Points& positions, const BestMeshOptions& options = {}) const {
    const QualityReport moved = measure_quality(mesh, positions, orientation);
    return find_best_mesh(mesh, {mesh.points, quality}, {positions, moved}, is_fixed, orientation,
                          options);
  }

  // Inner nodes off their places by up to `amount`, or less where that inverts cells.
  Points disturbed(double amount) const {
    Points result = shaken(mesh.points, amount, 3);
    for (Index n = 0; n < mesh.node_count(); ++n)
      if (is_fixed[n]) result.row(n) = mesh.points.row(n);
    straighten(mesh, result);
    return check_validity(mesh, result, orientation).invalid > 0 ? disturbed(0.7 * amount) : result;
  }

  double least(const Points& positions) const {
    return measure_quality(mesh, positions, orientation).min;
  }

  Mesh mesh;
  std::vector<char> is_fixed;
  Orientation orientation;
  QualityReport quality;
  CellNeighbours neighbours;
};

// The side z = 0 of the unit cube, in the plane x_axis = 3.
Mesh square(CellType solid, int n, int axis) {
  const Mesh solids = cube(solid, n);
  Mesh result;
  std::vector<Index> nodes(std::size_t(solids.node_count()), -1);
  std::vector<Index> used;
  for (Index c = 0; c < solids.cell_count(); ++c)
    for (Facet& facet : cell_facets(solids, c)) {
      if (!std::ranges::all_of(facet.nodes, [&](Index n) { return solids.points(n, 2) == 0; }))
        continue;
      for (Index& node : facet.nodes) {
        if (nodes[node] < 0) {
          nodes[node] = std::ssize(used);
          used.push_back(node);
        }
        node = nodes[node];
      }
      add_cell(result, facet.type, facet.nodes);
    }
  result.points.resize(std::ssize(used), 3);
  for (Index i = 0; i < std::ssize(used); ++i) {
    result.points(i, (axis + 1) % 3) = solids.points(used[i], 0);
    result.points(i, (axis + 2) % 3) = solids.points(used[i], 1);
    result.points(i, axis) = 3;
  }
  return result;
}

// The nodes of the unit cube's top that are not on its border.
std::vector<Index> inside_top(const Points& points) {
  std::vector<Index> nodes;
  for (Index n = 0; n < points.rows(); ++n) {
    const auto x = points.row(n);
    if (x[2] > 1 - 1e-9 && std::min({x[0], x[1], 1 - x[0], 1 - x[1]}) > 1e-9) nodes.push_back(n);
  }
  return nodes;
}

// Moves them in x and y, one to and the next fro, in a cube of n^3.
void move_to_and_fro(const std::vector<Index>& nodes, int n, double amount, Points& positions) {
  for (const Index node : nodes) {
    auto x = positions.row(node);
    const bool is_even = (std::lround(n * x[0]) + std::lround(n * x[1])) % 2 == 0;
    x.head<2>().array() += is_even ? amount : -amount;
  }
}

// Has them slide in x and y from where they are at `positions`, which must outlive them.
void slide_in_plane(const Points& positions, SlidingNodes& sliding) {
  sliding.slides = RowMatrix::Zero(std::ssize(sliding.nodes), 2);
  sliding.at = [&positions, nodes = sliding.nodes](Index i, const Eigen::Vector2d& slide) {
    SlidePlace place{positions.row(nodes[i]).transpose(), {}};
    place.point.head<2>() += slide;
    place.tangents << 1, 0, 0, 1, 0, 0;
    return place;
  };
}

const std::vector<CellType> kSides = {CellType::Tetra,
                                      CellType::Hexahedron,
                                      CellType::Voxel,
                                      CellType::Polyhedron,
                                      CellType::QuadraticTetra,
                                      CellType::QuadraticHexahedron,
                                      CellType::TriquadraticHexahedron};

}  // namespace

TEST_CASE("The slope of the shape energy is that of its values", "[volume][best]") {
  std::vector<Mesh> meshes;
  for (const CellType type : solid_types()) meshes.push_back(testing::cube(type, 2));
  for (const CellType type : kSides) meshes.push_back(square(type, 3, 1));
  std::size_t planes = 0;
  for (Mesh& mesh : meshes) {
    const FixedCube cube(std::move(mesh));
    INFO(static_cast<int>(cube.mesh.types[0]));
    Points start = shaken(cube.mesh.points, 0.02, 5);
    const bool is_plane = dimension(cube.mesh) == 2;
    planes += is_plane;
    if (is_plane) start.col(1).setConstant(3);
    FreeNodes free(cube.mesh.node_count(), all(cube.mesh.node_count()), nullptr);
    const VectorXd x = free.start(start, RowMatrix());
    ShapeEnergy energy(cube.mesh, cube.mesh.points, start, std::move(free),
                       all(cube.mesh.cell_count()), cube.orientation);
    for (const int doublings : {2, 3}) {
      energy.set_power(doublings);
      if (doublings == 3) energy.keep_flatness(start);
      VectorXd slope, unused;
      REQUIRE(std::isfinite(energy(x, slope)));
      const VectorXd direction = VectorXd::Random(x.size());
      const double h = 1e-6;
      const double ahead = energy(x + h * direction, unused);
      const double behind = energy(x - h * direction, unused);
      CHECK(slope.dot(direction) == Approx((ahead - behind) / (2 * h)).epsilon(1e-5));
      REQUIRE(slope.size() == 3 * cube.mesh.node_count());
      for (Index n = 0; is_plane && n < cube.mesh.node_count(); ++n) CHECK(slope[3 * n + 1] == 0);
    }
  }
  CHECK(planes == kSides.size());
}

TEST_CASE("With finite volumes the slope of the energy is that of its values, too",
          "[volume][best]") {
  std::vector<Mesh> meshes;
  for (const CellType type : solid_types()) meshes.push_back(testing::cube(type, 3));
  for (const CellType type : kSides) meshes.push_back(square(type, 4, 1));
  std::size_t planes = 0;
  for (Mesh& mesh : meshes) {
    const FixedCube cube(std::move(mesh));
    INFO(static_cast<int>(cube.mesh.types[0]));
    const bool is_plane = dimension(cube.mesh) == 2;
    planes += is_plane;
    Points start = shaken(cube.mesh.points, 0.01, 5);
    if (is_plane) start.col(1).setConstant(3);
    const FiniteVolumes volumes = cube.volumes();
    // All nodes, then one with its cells alone, whose neighbours stay.
    for (const bool is_whole : {true, false}) {
      std::vector<Index> nodes = all(cube.mesh.node_count()), cells;
      if (!is_whole) nodes = {cube.mesh.cell(cube.mesh.cell_count() / 2).front()};
      for (Index c = 0; c < cube.mesh.cell_count(); ++c)
        if (is_whole || std::ranges::count(cube.mesh.cell(c), nodes[0]) > 0) cells.push_back(c);
      FreeNodes free(cube.mesh.node_count(), nodes, nullptr);
      const VectorXd x = free.start(start, RowMatrix());
      ShapeEnergy energy(cube.mesh, cube.mesh.points, start, std::move(free), cells,
                         cube.orientation, &volumes);
      energy.set_power(2);
      VectorXd slope, unused;
      REQUIRE(std::isfinite(energy(x, slope)));
      VectorXd direction = VectorXd::Random(x.size());
      for (Index n = 0; is_plane && n < std::ssize(nodes); ++n) {
        CHECK(slope[3 * n + 1] == 0);
        direction[3 * n + 1] = 0;
      }
      const double h = 1e-7;
      const double ahead = energy(x + h * direction, unused);
      const double behind = energy(x - h * direction, unused);
      CHECK(slope.dot(direction) == Approx((ahead - behind) / (2 * h)).epsilon(1e-4));
    }
  }
  CHECK(planes == kSides.size());
}

TEST_CASE(
    "The guess of the shape energy's Hessian has its size, and no step that it allows inverts",
    "[volume][best]") {
  for (const CellType type : solid_types()) {
    const FixedCube cube(testing::cube(type, 2));
    INFO(static_cast<int>(type));
    const Points start = cube.disturbed(0.05);
    const std::vector<Index> nodes{unfixed(cube.is_fixed).front()};
    FreeNodes free(cube.mesh.node_count(), nodes, nullptr);
    const VectorXd x = free.start(start, RowMatrix());
    std::vector<Index> cells;  // of the node
    for (Index c = 0; c < cube.mesh.cell_count(); ++c)
      if (std::ranges::find(cube.mesh.cell(c), nodes[0]) != cube.mesh.cell(c).end())
        cells.push_back(c);
    ShapeEnergy energy(cube.mesh, cube.mesh.points, start, std::move(free), cells,
                       cube.orientation);
    energy.set_power(3);
    const HessianGuess& guess = energy.guess_hessian(x);
    Eigen::Matrix3d inverse, hessian;
    for (int i = 0; i < 3; ++i) inverse.col(i) = guess.solve(VectorXd::Unit(3, i));
    std::vector<VectorXd> steps;
    for (int i = 0; i < 20; ++i) {
      steps.push_back(100 * VectorXd::Random(3));
      guess.shorten(steps.back());
      CHECK(steps.back().norm() > 0.005);  // no less than it has to be
    }
    VectorXd ahead, behind;
    const double h = 1e-5;
    for (int i = 0; i < 3; ++i) {
      energy(x + h * VectorXd::Unit(3, i), ahead);
      energy(x - h * VectorXd::Unit(3, i), behind);
      hessian.col(i) = (ahead - behind) / (2 * h);
    }
    // Along a curved cell's edge there is next to no slope, whose guess is then too large.
    const Eigen::Matrix3d root =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inverse).operatorSqrt();
    const double most =
        Eigen::Matrix3d(root * hessian * root).selfadjointView<Eigen::Lower>().eigenvalues()[2];
    CHECK(most > 0.1);
    CHECK(most < 10);
    for (const VectorXd& step : steps) CHECK(std::isfinite(energy(x + step, ahead)));
  }
}

TEST_CASE("For large powers the shape energy tells the smallest scaled Jacobian",
          "[volume][best]") {
  for (const CellType type : solid_types()) {
    const FixedCube cube(testing::cube(type, 2));
    INFO(static_cast<int>(type));
    const Points positions = shaken(cube.mesh.points, 0.02, 7);
    const QualityReport quality = measure_quality(cube.mesh, positions, cube.orientation);
    REQUIRE(quality.min > 0);
    FreeNodes free(cube.mesh.node_count(), all(cube.mesh.node_count()), nullptr);
    const VectorXd x = free.start(positions, RowMatrix());
    // With the positions as their own reference there is no other shape to keep.
    ShapeEnergy energy(cube.mesh, positions, positions, std::move(free),
                       all(cube.mesh.cell_count()), cube.orientation);
    energy.set_power(7);
    VectorXd unused;
    // Some hundred samples: log(1000) / 128 at most from the maximum.
    CHECK(energy(x, unused) == Approx(-std::log(quality.min)).margin(0.06));
  }
}

TEST_CASE("Cells whose right angles hide it count as flat where they were not", "[volume][best]") {
  const FixedCube cube(testing::cube(CellType::Hexahedron, 2));
  const auto pressed = [&](double height) {
    Points positions = cube.mesh.points;
    positions.col(2) *= height;
    return positions;
  };
  const auto ratio = [](double height) {
    return std::pow((2 + height * height) / 3, 3) / (height * height);
  };
  const Points positions = pressed(0.25);
  const auto energy = [&](const Points* plain) {
    ShapeEnergy shape(cube.mesh, cube.mesh.points, positions,
                      FreeNodes(cube.mesh.node_count(), {}, nullptr), all(cube.mesh.cell_count()),
                      cube.orientation);
    shape.set_power(7);
    if (plain) shape.keep_flatness(*plain);
    VectorXd unused;
    return shape({}, unused);
  };
  // log(100) / 128 at most from the maximum. All q are 1.
  CHECK(energy(nullptr) == Approx(std::log(ratio(0.25)) / 4).margin(0.04));
  Points plain = pressed(0.3);
  CHECK(energy(&plain) == Approx(std::log(ratio(0.25) / ratio(0.3)) / 2).margin(0.04));
  CHECK(energy(&cube.mesh.points) == Approx(std::log(ratio(0.25) / 1.5) / 2).margin(0.04));
  plain = pressed(0.1);
  CHECK(energy(&plain) == Approx(0).margin(0.04));
  // Half of the cells are flat: the others may become so, by half the logarithm.
  plain = cube.mesh.points;
  plain.col(2) = (0.2 * plain.col(2)).cwiseMax((plain.col(2).array() - 0.4).matrix());
  CHECK(energy(&plain) ==
        Approx(std::log(ratio(0.25) / std::sqrt(ratio(0.2) * ratio(1))) / 2).margin(0.04));
}

TEST_CASE("The slope of the energy counts the nodes that follow their corners", "[volume][best]") {
  for (const CellType type :
       {CellType::QuadraticTetra, CellType::QuadraticHexahedron, CellType::QuadraticWedge,
        CellType::QuadraticPyramid, CellType::BiquadraticQuadraticPyramid,
        CellType::TriquadraticHexahedron}) {
    const FixedCube cube(testing::cube(type, 2));
    INFO(static_cast<int>(type));
    const Points start = shaken(cube.mesh.points, 0.02, 5);
    const MidNodes mid_nodes(cube.mesh, start);
    // Some slide, over a surface that bends.
    SlidingNodes sliding;
    std::vector<Index> corners, followers;
    for (Index i = 0; i < mid_nodes.count(); ++i) {
      followers.push_back(i);
      if (i % 5 == 0) sliding.nodes.push_back(mid_nodes.node(i));
    }
    std::ranges::sort(sliding.nodes);
    for (Index n = 0; n < cube.mesh.node_count(); ++n)
      if (!mid_nodes.contains(n)) corners.push_back(n);
    REQUIRE(corners.size() == std::size_t(27 + (linear_type(type) == CellType::Pyramid ? 8 : 0)));
    sliding.slides = RowMatrix::Zero(std::ssize(sliding.nodes), 2);
    sliding.at = [&](Index i, const Eigen::Vector2d& s) {
      SlidePlace place{start.row(sliding.nodes[i]).transpose(), {}};
      place.point += Vector3d(s[0], s[1], 0.5 * s.squaredNorm());
      place.tangents << 1, 0, 0, 1, s[0], s[1];
      return place;
    };
    FreeNodes free(cube.mesh.node_count(), corners, &sliding);
    free.let_follow(mid_nodes, followers);
    const VectorXd x = free.start(start, sliding.slides);
    REQUIRE(x.size() == 3 * std::ssize(corners));
    ShapeEnergy energy(cube.mesh, cube.mesh.points, start, std::move(free),
                       all(cube.mesh.cell_count()), cube.orientation);
    VectorXd slope, unused;
    const VectorXd direction = VectorXd::Random(x.size()), at = x + 1e-3 * direction;
    REQUIRE(std::isfinite(energy(at, slope)));
    const double h = 1e-6;
    const double ahead = energy(at + h * direction, unused);
    const double behind = energy(at - h * direction, unused);
    CHECK(slope.dot(direction) == Approx((ahead - behind) / (2 * h)).epsilon(1e-5));
  }
}

TEST_CASE("The slope of the energy counts how nodes are spaced along edges", "[volume][best]") {
  const FixedCube cube(testing::cube(CellType::Hexahedron, 3));
  const Points start = shaken(cube.mesh.points, 0.02, 5);
  // The nodes of four edges slide along them, over a curve.
  SlidingNodes sliding;
  for (Index n = 0; n < cube.mesh.node_count(); ++n) {
    const auto x = cube.mesh.points.row(n);
    if (x[1] * (1 - x[1]) == 0 && x[2] * (1 - x[2]) == 0 && x[0] > 0 && x[0] < 1)
      sliding.nodes.push_back(n);
  }
  REQUIRE(sliding.nodes.size() == 8);
  sliding.slides = RowMatrix::Zero(8, 2);
  sliding.at = [&](Index i, const Eigen::Vector2d& s) {
    SlidePlace place{start.row(sliding.nodes[i]).transpose(), {}};
    place.point += Vector3d(s[0], 0.5 * s[0] * s[0], 0);
    place.tangents << 1, 0, s[0], 0, 0, 0;
    return place;
  };
  const auto energy_with = [&](const std::vector<EdgeSegment>& segments, double slide,
                               VectorXd& slope) {
    sliding.segments = segments;
    FreeNodes free(cube.mesh.node_count(), all(cube.mesh.node_count()), &sliding);
    VectorXd x = free.start(start, sliding.slides);
    for (const Index node : sliding.nodes) x[free.first_unknown(free.place_of(node))] += slide;
    ShapeEnergy energy(cube.mesh, cube.mesh.points, start, std::move(free),
                       all(cube.mesh.cell_count()), cube.orientation);
    energy.set_power(3);
    const double value = energy(x, slope);
    const VectorXd direction = VectorXd::Random(x.size());
    const double h = 1e-6;
    VectorXd unused;
    const double ahead = energy(x + h * direction, unused);
    const double behind = energy(x - h * direction, unused);
    CHECK(slope.dot(direction) == Approx((ahead - behind) / (2 * h)).epsilon(1e-5));
    return value;
  };
  std::vector<EdgeSegment> segments;
  for (const Index node : sliding.nodes)
    for (Index n = 0; n < cube.mesh.node_count(); ++n)
      if ((cube.mesh.points.row(n) - cube.mesh.points.row(node)).norm() < 0.34 &&
          cube.mesh.points(n, 0) < cube.mesh.points(node, 0))
        segments.push_back(
            {std::min(n, node), std::max(n, node), (start.row(n) - start.row(node)).norm()});
  REQUIRE(segments.size() == 8);
  VectorXd slope;
  const double without = energy_with({}, 0.05, slope);
  const VectorXd slope_without = slope;
  CHECK(energy_with(segments, 0.05, slope) > without);
  CHECK((slope - slope_without).norm() > 1e-3 * slope.norm());
}

TEST_CASE("Edges that a motion bent are straightened first", "[volume][best]") {
  for (const CellType type : {CellType::QuadraticTetra, CellType::QuadraticHexahedron}) {
    const FixedCube cube(testing::cube(type, 4));
    INFO(static_cast<int>(type));
    Points positions = cube.mesh.points;
    const Points noise = shaken(cube.mesh.points, 0.02, 3);
    const MidNodes mid_nodes(cube.mesh, positions);
    for (Index i = 0; i < mid_nodes.count(); ++i)
      if (const Index n = mid_nodes.node(i); !cube.is_fixed[n]) positions.row(n) = noise.row(n);
    REQUIRE(cube.least(positions) < 0.95 * cube.quality.min);
    const BestMeshResult result = cube.raised(positions);
    REQUIRE(result.report.attempts.size() == 1);
    CHECK(result.report.attempts[0].by == RaiseBy::MidNodes);
    CHECK(result.report.attempts[0].is_taken);
    CHECK((result.positions - cube.mesh.points).cwiseAbs().maxCoeff() < 1e-15);
  }
}

TEST_CASE("Bent edges are straightened where that costs nothing", "[volume][best]") {
  for (const CellType type : {CellType::QuadraticHexahedron, CellType::QuadraticWedge}) {
    const FixedCube cube(testing::cube(type, 6));
    INFO(static_cast<int>(type));
    const MidNodes mid_nodes(cube.mesh, cube.mesh.points);
    // All cells on one side lose much, an edge on the other side is bent by little.
    Points positions = cube.mesh.points;
    Index bent = -1;
    for (const Index n : unfixed(cube.is_fixed)) {
      if (!mid_nodes.contains(n) && positions(n, 0) < 0.4)
        positions(n, 1) += 0.06 * std::cos(20 * positions(n, 0) + 30 * positions(n, 2));
      if (mid_nodes.contains(n) && positions(n, 0) > 0.8) bent = n;
    }
    RowMatrix none;
    for (Index i = 0; i < mid_nodes.count(); ++i)
      if (!cube.is_fixed[mid_nodes.node(i)]) mid_nodes.follow({i}, nullptr, positions, none);
    const Eigen::RowVector3d straight = positions.row(bent);
    positions(bent, 1) += 0.005;
    REQUIRE(cube.least(positions) < 0.9 * cube.quality.min);
    const BestMeshResult result = cube.raised(positions);
    REQUIRE(!result.report.attempts.empty());
    CHECK(result.report.attempts[0].by == RaiseBy::MidNodes);
    CHECK(result.report.attempts[0].is_taken);
    CHECK((result.positions.row(bent) - straight).norm() < 0.001);
  }
}

TEST_CASE("Edges of second-order cells stay as straight as they came", "[volume][best]") {
  for (const CellType type : {CellType::QuadraticTetra, CellType::QuadraticHexahedron}) {
    const FixedCube cube(testing::cube(type, 4));
    const BestMeshResult result = cube.raised(cube.disturbed(0.04));
    REQUIRE(result.report.best.min > result.report.plain.min);
    double most = 0;
    for (Index c = 0; c < cube.mesh.cell_count(); ++c) {
      const auto nodes = cube.mesh.cell(c);
      const auto at = [&](int n) { return result.positions.row(nodes[std::size_t(n)]); };
      for (const LocalMidNode& mid : mid_nodes_of(type))
        most =
            std::max(most, (at(mid.node) - (at(mid.corners[0]) + at(mid.corners[1])) / 2).norm());
    }
    CHECK(most < 1e-15);
  }
}

TEST_CASE("Where a morph is an affine map nothing is tried and nothing moves", "[volume][best]") {
  Eigen::Matrix3d map;
  map << 1.4, 0.3, -0.2, 0.1, 0.7, 0.4, 0, -0.3, 1.1;  // costs much of every cell's shape
  for (const CellType type : solid_types()) {
    const FixedCube cube(testing::cube(type, 3));
    const Points positions = mapped(cube.mesh.points, [&](const Vector3d& x) -> Vector3d {
      return map * x + Vector3d(5, 0, 9);
    });
    REQUIRE(measure_quality(cube.mesh, positions, cube.orientation).min <
            0.9 * measure_quality(cube.mesh, cube.mesh.points, cube.orientation).min);
    const BestMeshResult result = cube.raised(positions);
    CHECK(result.report.attempts.empty());
    CHECK(result.positions == positions);
    CHECK(result.slides.rows() == 0);
  }
}

TEST_CASE("A small body in a large far field is no affine map of it", "[volume][best]") {
  // Flattened by 0.3: less than 1e-4 of the far field's size.
  const FarField field = far_field(6, 5000);
  const Orientation orientation = detect_orientation(field.mesh);
  const QualityReport before = measure_quality(field.mesh, field.mesh.points, orientation);
  const Points positions = VolumeMorph(field.mesh, field.surface)
                               .morph(targets(field, [](const Vector3d& x) -> Vector3d {
                                 return {x[0], x[1], 0.7 * x[2]};
                               }));
  const QualityReport moved = measure_quality(field.mesh, positions, orientation);
  REQUIRE(moved.min < 0.9 * before.min);
  std::vector<char> is_fixed(field.mesh.node_count(), 0);
  for (const Index node : field.surface) is_fixed[node] = 1;
  const BestMeshResult result = find_best_mesh(field.mesh, {field.mesh.points, before},
                                               {positions, moved}, is_fixed, orientation);
  REQUIRE(!result.report.attempts.empty());
  CHECK(result.report.best.min > 1.02 * result.report.plain.min);
  CHECK(check_validity(field.mesh, result.positions, orientation).invalid == 0);
}

TEST_CASE("Inner nodes of cells that lost shape raise them", "[volume][best]") {
  for (const CellType type : solid_types()) {
    const FixedCube cube(testing::cube(type, 4));
    INFO(static_cast<int>(type));
    const Points positions = cube.disturbed(0.04);
    const BestMeshResult result = cube.raised(positions);
    const BestMeshReport& report = result.report;
    CHECK(report.best.min > report.plain.min);
    CHECK(report.best.worst_twentieth > report.plain.worst_twentieth);
    CHECK(std::ranges::any_of(report.attempts, &RaiseAttempt::is_taken));
    const QualityReport after = measure_quality(cube.mesh, result.positions, cube.orientation);
    CHECK(after.min == report.best.min);
    CHECK(after.values == result.quality.values);
    CHECK(check_validity(cube.mesh, result.positions, cube.orientation).invalid == 0);
    const std::vector<Index> fixed = cube_surface(cube.mesh);
    CHECK(fixed.size() >= 98);  // corners on the surface of 4 x 4 x 4 cells
    CHECK(rows_of(result.positions, fixed) == rows_of(positions, fixed));
  }
}

TEST_CASE("The skin of a mesh changes nothing of what is raised", "[volume][best]") {
  Mesh mesh = testing::cube(CellType::Tetra, 5);
  const FixedCube bare(mesh);
  for (Index c = 0; c < bare.mesh.cell_count(); ++c)
    for (const Facet& facet : cell_facets(bare.mesh, c))
      if (std::ranges::all_of(facet.nodes, [&](Index n) { return bare.is_fixed[n] != 0; }))
        add_cell(mesh, facet.type, facet.nodes);
  REQUIRE(mesh.cell_count() > bare.mesh.cell_count());
  const Points positions = bare.disturbed(0.04);
  const BestMeshResult result = bare.raised(positions);
  REQUIRE(result.report.best.min > result.report.plain.min);
  CHECK(FixedCube(mesh).raised(positions).positions == result.positions);
}

TEST_CASE("Inner nodes of a mesh in a plane raise its cells, and stay in the plane",
          "[volume][best]") {
  for (const CellType type : kSides)
    for (const int axis : {0, 1, 2}) {
      Mesh mesh = square(type, 6, axis);
      if (axis == 1)  // seen from the other side
        mesh.points.col(0) *= -1;
      FixedCube plane(mesh);
      INFO(static_cast<int>(mesh.types[0]) << " across " << axis);
      const std::vector<char> is_border = border_nodes(mesh, mesh.points);
      plane.is_fixed = is_border;
      std::vector<Index> fixed;
      Index told = 0;
      for (Index n = 0; n < mesh.node_count(); ++n) {  // corners alone are told
        const double u = std::abs(mesh.points(n, (axis + 1) % 3)),
                     v = std::abs(mesh.points(n, (axis + 2) % 3));
        const bool is_on_border = std::min(u, v) == 0 || std::max(u, v) == 1;
        if (is_border[n]) CHECK(is_on_border);
        told += is_border[n];
        plane.is_fixed[n] = is_on_border;
        if (is_on_border) fixed.push_back(n);
      }
      CHECK(told == 4 * 6);
      REQUIRE(std::ssize(fixed) >= told);
      Points positions;
      for (double amount = 0.05; positions.size() == 0 || plane.least(positions) < 0.2;
           amount *= 0.7) {
        positions = shaken(mesh.points, amount, 3);
        positions.col(axis).setConstant(3);
        for (Index n = 0; n < mesh.node_count(); ++n)
          if (plane.is_fixed[n]) positions.row(n) = mesh.points.row(n);
        straighten(mesh, positions);
      }
      const BestMeshResult result = plane.raised(positions);
      CHECK(result.report.best.min > result.report.plain.min);
      CHECK(result.report.best.worst_twentieth > result.report.plain.worst_twentieth);
      CHECK((result.positions.col(axis).array() == 3).all());
      CHECK(rows_of(result.positions, fixed) == rows_of(positions, fixed));
      const Mesh layer = one_layer(mesh, result.positions);
      CHECK(check_validity(layer, layer.points, detect_orientation(layer)).invalid == 0);
    }
}

TEST_CASE("With finite volumes the faces are raised", "[volume][best]") {
  using enum CellType;
  std::vector<Mesh> meshes;
  for (const CellType type : {Tetra, Hexahedron, Wedge, Pyramid, Polyhedron})
    meshes.push_back(testing::cube(type, 5));
  for (const CellType type : {Tetra, Hexahedron, Polyhedron}) meshes.push_back(square(type, 6, 2));
  int planes = 0;
  for (Mesh& mesh : meshes) {
    FixedCube cube(std::move(mesh));
    INFO(static_cast<int>(cube.mesh.types[0]));
    const bool is_plane = dimension(cube.mesh) == 2;
    for (Index n = 0; is_plane && n < cube.mesh.node_count(); ++n) {
      const auto x = cube.mesh.points.row(n).head<2>();
      cube.is_fixed[n] = x.minCoeff() == 0 || x.maxCoeff() == 1;
    }
    Points positions;
    for (double amount = 0.08; positions.size() == 0 || cube.least(positions) < 0.1;
         amount *= 0.8) {
      positions = shaken(cube.mesh.points, amount, 3);
      if (is_plane) positions.col(2).setConstant(3);
      for (Index n = 0; n < cube.mesh.node_count(); ++n)
        if (cube.is_fixed[n]) positions.row(n) = cube.mesh.points.row(n);
    }
    const FiniteVolumes volumes = cube.volumes();
    BestMeshOptions options;
    options.volumes = &volumes;
    const BestMeshResult result = cube.raised(positions, options);
    const auto checked = [&](const Points& at) {
      return check_quality(cube.mesh, at, cube.neighbours, cube.orientation);
    };
    const QualityChecks plain = checked(positions), best = checked(result.positions);
    CHECK(result.report.is_by_faces);
    CHECK(result.report.best.min > result.report.plain.min);
    CHECK(result.report.best.worst_twentieth > result.report.plain.worst_twentieth);
    CHECK(face_angle(result.report.best.min) >=
          Approx(best.max_non_orthogonality_deg).epsilon(1e-9));
    CHECK(best.max_non_orthogonality_deg + 10 * best.max_skewness <
          plain.max_non_orthogonality_deg + 10 * plain.max_skewness);
    const QualityReport after = measure_quality(cube.mesh, result.positions, cube.orientation);
    CHECK(after.values == result.quality.values);
    CHECK(after.inverted == 0);
    planes += is_plane;
    if (is_plane) CHECK((result.positions.col(2).array() == 3).all());
  }
  CHECK(planes == 3);
}

TEST_CASE("The best mesh is the same for any number of threads", "[volume][best]") {
  const FixedCube cube(testing::cube(CellType::Tetra, 8));
  const Points positions = cube.disturbed(0.02);
  const FiniteVolumes volumes = cube.volumes();
  for (const FiniteVolumes* use : {(const FiniteVolumes*)nullptr, &volumes}) {
    BestMeshOptions options;
    options.volumes = use;
    set_thread_count(1);
    const BestMeshResult one = cube.raised(positions, options);
    set_thread_count(4);
    const BestMeshResult four = cube.raised(positions, options);
    set_thread_count(0);
    CHECK(std::ranges::any_of(one.report.attempts, &RaiseAttempt::is_taken));
    CHECK(one.positions == four.positions);
  }
}

TEST_CASE("Surface nodes slide where inner nodes alone can't raise cells", "[volume][best]") {
  // The top of a cube, whose nodes were moved to and fro, and that of a column as which it came,
  // twisted by more than half a turn: the affine map nearest to that has no width to speak of.
  const double twist = GENERATE(0.0, 5.0), height = 6;
  const CellType type = twist > 0 ? CellType::Tetra : CellType::Hexahedron;  // which feels widths
  const FixedCube cube(testing::cube(type, 6));
  Points positions = cube.mesh.points;
  SlidingNodes top;
  top.nodes = inside_top(positions);
  move_to_and_fro(top.nodes, 6, 0.035, positions);
  for (Index n = 0; twist > 0 && n < cube.mesh.node_count(); ++n) {
    const Vector3d axis(0.5, 0.5, 0), x = positions.row(n);
    const Eigen::AngleAxisd turn(twist * (x.z() - 1), Vector3d::UnitZ());
    positions.row(n) = axis + turn * (x - axis);
    positions(n, 2) = height * x.z();
  }
  slide_in_plane(positions, top);
  top.is_within = [&](Index i, const Eigen::Vector2d& slide) {
    const Eigen::Vector2d x = positions.row(top.nodes[i]).head<2>().transpose() + slide;
    return x.minCoeff() > 0 && x.maxCoeff() < 1;
  };
  const BestMeshResult inner = cube.raised(positions);
  BestMeshOptions options;
  options.sliding = [&] { return &top; };
  const BestMeshResult slid = cube.raised(positions, options);
  CHECK(slid.report.best.min > 1.05 * inner.report.best.min);
  CHECK(slid.report.best.worst_twentieth > 1.05 * inner.report.best.worst_twentieth);
  CHECK(slid.report.slid_nodes > 0);
  REQUIRE(slid.slides.rows() == std::ssize(top.nodes));
  for (std::size_t i = 0; i < top.nodes.size(); ++i) {
    const Eigen::Vector2d slide = slid.slides.row(i).transpose();
    CHECK((slid.positions.row(top.nodes[i]).transpose() - top.at(i, slide).point).norm() == 0);
    CHECK(top.is_within(i, slide));
  }
  if (twist > 0) return;  // what is refused leaves less work for the rest
  // Where they would overlap, nothing slides.
  options.is_folded = [](const Points&, const RowMatrix&) { return true; };
  const BestMeshResult refused = cube.raised(positions, options);
  CHECK(refused.positions == inner.positions);
  CHECK(refused.report.slid_nodes == 0);
}

TEST_CASE("Triangles of the surface keep more of their shapes where nodes slide",
          "[volume][best]") {
  // Nodes below the top are off their places and stay there: cells are best where its own are, too.
  FixedCube cube(testing::cube(CellType::Tetra, 6));
  Points positions = cube.mesh.points;
  std::vector<Index> below;
  for (Index n = 0; n < positions.rows(); ++n)
    if (!cube.is_fixed[n] && positions(n, 2) > 0.8) below.push_back(n);
  move_to_and_fro(below, 6, 0.025, positions);
  std::ranges::fill(cube.is_fixed, 1);
  SlidingNodes top;
  top.nodes = inside_top(positions);
  move_to_and_fro(top.nodes, 6, -0.03, positions);
  slide_in_plane(positions, top);
  top.is_within = [](Index, const Eigen::Vector2d&) { return true; };
  BestMeshOptions options;
  options.sliding = [&] { return &top; };
  const Boundary boundary = extract_boundary(cube.mesh);
  std::vector<std::array<Index, 3>> triangles;
  for (Index f = 0; f < boundary.facet_count(); ++f)
    if (const auto nodes = boundary.facet(f);
        std::ranges::any_of(nodes, [&](Index n) { return top.find(n) >= 0; }))
      triangles.push_back({nodes[0], nodes[1], nodes[2]});
  const auto distortion = [&](const Points& at) {
    TriangleShape shapes(triangles, cube.mesh.points,
                         FreeNodes(cube.mesh.node_count(), top.nodes, nullptr));
    return std::pow(shapes.evaluate(at, 3) / (16 * double(triangles.size())), 0.125);
  };
  const BestMeshResult without = cube.raised(positions, options);
  top.triangles = triangles;
  const BestMeshResult result = cube.raised(positions, options);
  CAPTURE(distortion(positions), result.report.best.min, without.report.best.min,
          result.report.best.worst_twentieth, without.report.best.worst_twentieth);
  CHECK(distortion(result.positions) - 1 < 0.95 * (distortion(without.positions) - 1));
  CHECK(sum_of_shares(result.report.best, result.report.base) >
        0.98 * sum_of_shares(without.report.best, without.report.base));
}

TEST_CASE("Where little was lost, nodes slide, too", "[volume][best]") {
  const CellType type = GENERATE(CellType::Tetra, CellType::Hexahedron);
  const FixedCube cube(testing::cube(type, 6));
  Points positions = cube.mesh.points;
  SlidingNodes top;
  top.nodes = inside_top(positions);
  move_to_and_fro(top.nodes, 6, 0.017, positions);
  slide_in_plane(positions, top);
  top.is_within = [](Index, const Eigen::Vector2d&) { return true; };
  const BestMeshReport inner = cube.raised(positions).report;
  const double kept = least_share(inner.best, inner.base);
  CAPTURE(kept, int(type));
  REQUIRE(kept > 0.75);
  REQUIRE(kept < 0.9);
  BestMeshOptions options;
  options.sliding = [&] { return &top; };
  const BestMeshReport slid = cube.raised(positions, options).report;
  CHECK(slid.slid_nodes > 0);
  CHECK(sum_of_shares(slid.best, slid.base) >= sum_of_shares(inner.best, inner.base));
}

TEST_CASE("What is symmetric is raised to be symmetric", "[volume][best]") {
  const int n = GENERATE(6, 8, 9);
  const FixedCube cube(testing::cube(CellType::Hexahedron, n));
  const Points& base = cube.mesh.points;
  Points positions = base;
  SlidingNodes top;
  top.nodes = inside_top(base);
  for (const Index node : top.nodes) {
    const Eigen::Vector2d x = base.row(node).head<2>().transpose().array() - 0.5;
    positions.row(node).head<2>() += (1.2 * (0.5 - x.cwiseAbs().maxCoeff()) * x).transpose();
  }
  slide_in_plane(positions, top);
  top.is_within = [](Index, const Eigen::Vector2d&) { return true; };
  BestMeshOptions options;
  if (GENERATE(false, true)) options.sliding = [&] { return &top; };
  const BestMeshResult result = cube.raised(positions, options);
  CHECK(result.report.best.worst_twentieth > 1.01 * result.report.plain.worst_twentieth);
  const auto node_at = [&](const Eigen::RowVector3d& x) {
    Index nearest;
    (base.rowwise() - x).rowwise().squaredNorm().minCoeff(&nearest);
    return nearest;
  };
  double most = 0;
  for (Index node = 0; node < base.rows(); ++node)
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::RowVector3d x = base.row(node), image = result.positions.row(node);
      x[axis] = 1 - x[axis];
      image[axis] = 1 - image[axis];
      most = std::max(most, (result.positions.row(node_at(x)) - image).norm());
    }
  CHECK(most < 1e-3 / n);
}

TEST_CASE("Right angles don't come from flat cells", "[volume][best]") {
  // A square of triangles with three quadrilaterals in each.
  const Mesh triangles = square(CellType::QuadraticTetra, 3, 2);
  Mesh quads;
  quads.points = triangles.points;
  quads.points.conservativeResize(triangles.node_count() + triangles.cell_count(), 3);
  for (Index c = 0; c < triangles.cell_count(); ++c) {
    const auto nodes = triangles.cell(c);
    const Index middle = triangles.node_count() + c;
    quads.points.row(middle).setZero();
    for (std::size_t i = 0; i < 3; ++i) {
      quads.points.row(middle) += triangles.points.row(nodes[i]) / 3;
      add_cell(quads, CellType::Quad,
               std::array{nodes[i], nodes[3 + i], middle, nodes[3 + (i + 2) % 3]});
    }
  }
  const FixedCube plane(std::move(quads));
  const auto [along_x, along_y] = GENERATE(std::pair(2.0, 1.0), std::pair(1.5, 0.7));
  const Points& base = plane.mesh.points;
  Points positions = base;
  positions.col(0) = base.col(0).array().pow(along_x);
  positions.col(1) = base.col(1).array().pow(along_y);
  // Nodes slide along the sides.
  SlidingNodes sides;
  const auto is_inside = [](double x) { return x > 1e-9 && x < 1 - 1e-9; };
  for (Index n = 0; n < base.rows(); ++n)
    if (is_inside(base(n, 0)) != is_inside(base(n, 1))) sides.nodes.push_back(n);
  sides.slides = RowMatrix::Zero(std::ssize(sides.nodes), 2);
  sides.at = [&](Index i, const Eigen::Vector2d& slide) {
    const Index n = sides.nodes[i];
    const int axis = is_inside(base(n, 0)) ? 0 : 1;
    SlidePlace place{positions.row(n).transpose(), {}};
    place.point[axis] += slide[0];
    place.tangents.setZero();
    place.tangents(axis, 0) = 1;
    return place;
  };
  sides.is_within = [](Index, const Eigen::Vector2d&) { return true; };
  BestMeshOptions options;
  options.sliding = [&] { return &sides; };
  const BestMeshResult result = plane.raised(positions, options);
  CHECK(sum_of_shares(result.report.best, result.report.base) >
        1.05 * sum_of_shares(result.report.plain, result.report.base));
  const auto longest_to_shortest = [&](const Points& at) {
    double greatest = 1;
    for (Index c = 0; c < plane.mesh.cell_count(); ++c) {
      const auto nodes = plane.mesh.cell(c);
      std::array<double, 4> lengths;
      for (std::size_t i = 0; i < 4; ++i)
        lengths[i] = (at.row(nodes[i]) - at.row(nodes[(i + 1) % 4])).norm();
      const auto [shortest, longest] = std::ranges::minmax(lengths);
      greatest = std::max(greatest, longest / shortest);
    }
    return greatest;
  };
  CHECK(longest_to_shortest(result.positions) < 1.9 * longest_to_shortest(positions));
}

TEST_CASE("Images of nodes that no attempt moves stay where they are", "[volume][best]") {
  const FixedCube cube(testing::cube(CellType::Hexahedron, 8));
  Points positions = cube.mesh.points;
  SlidingNodes top;
  top.nodes = inside_top(positions);
  std::vector<Index> near;
  std::ranges::copy_if(top.nodes, std::back_inserter(near),
                       [&](Index n) { return positions(n, 0) < 0.3; });
  move_to_and_fro(near, 8, 0.04, positions);
  slide_in_plane(positions, top);
  top.is_within = [](Index, const Eigen::Vector2d&) { return true; };
  // Two that are images of each other, far from what is poor, go a little farther each time.
  const Index last = std::ssize(top.nodes) - 1;
  REQUIRE(positions(top.nodes[last], 0) > 0.8);
  int calls = 0;
  BestMeshOptions options;
  options.sliding = [&] { return &top; };
  options.images = [&] {
    return SlidingImages{{{last - 1, last}}, {}, [&](const RowMatrix& slides) {
                           RowMatrix alike = slides;
                           alike.bottomRows(2).array() += 0.001 * ++calls;
                           return alike;
                         }};
  };
  const BestMeshResult result = cube.raised(positions, options);
  CHECK(calls > 0);
  CHECK(result.report.slid_nodes > 0);
  CHECK(result.positions.row(top.nodes[last]) == positions.row(top.nodes[last]));
  CHECK(result.quality.values ==
        measure_quality(cube.mesh, result.positions, cube.orientation).values);
}

TEST_CASE("Layers keep their heights where cells beside them are raised", "[volume][best]") {
  const FixedCube cube(graded_layers(8, 1e-3));
  Points positions = cube.mesh.points;
  // Nodes above the layers, off their places.
  const Points off = shaken(cube.mesh.points, 0.03, 3);
  for (Index n = 0; n < cube.mesh.node_count(); ++n)
    if (!cube.is_fixed[n] && positions(n, 2) > 0.2) positions.row(n) = off.row(n);
  const BestMeshResult result = cube.raised(positions);
  CHECK(result.report.best.min > result.report.plain.min);
  // As if the floor had moved, so that the cells that stand on it count.
  const Vector3d shift(1, 0, 0);
  const Points moved = result.positions.rowwise() + shift.transpose();
  std::vector<char> is_floor(cube.is_fixed.size(), 0);
  for (Index n = 0; n < cube.mesh.node_count(); ++n) is_floor[n] = cube.mesh.points(n, 2) == 0;
  const LayerFigures layers =
      measure_layers(cube.mesh, find_cell_neighbours(cube.mesh), is_floor, cube.mesh.points, moved);
  REQUIRE(layers.cells > 0);
  CHECK(layers.share_kept == 1);
}

TEST_CASE("Cells that are inverted stay as they are, the others are raised", "[volume][best]") {
  const FixedCube cube(testing::cube(CellType::Tetra, 5));
  Points positions = cube.disturbed(0.03);
  const Index centre = unfixed(cube.is_fixed).front();
  positions.row(centre) = cube.mesh.points.row(centre) + Eigen::RowVector3d(0.3, 0.2, 0.25);
  const ValidityReport before = check_validity(cube.mesh, positions, cube.orientation);
  REQUIRE(before.invalid > 0);
  const BestMeshResult result = cube.raised(positions);
  const ValidityReport after = check_validity(cube.mesh, result.positions, cube.orientation);
  CHECK(after.invalid == before.invalid);
  CHECK(result.report.best.worst_twentieth >= result.report.plain.worst_twentieth);
  CHECK(result.positions.row(centre) == positions.row(centre));
}

TEST_CASE("No inner node moves much farther than the farthest surface node", "[volume][best]") {
  // Poor cells with much room, spoilt a little more by a small change.
  FixedCube poor(testing::cube(CellType::Hexahedron, 6));
  const auto node_at = [&](double x, double y, double z) {
    Index node = -1;
    (poor.mesh.points.rowwise() - Eigen::RowVector3d(x, y, z)).rowwise().norm().minCoeff(&node);
    return node;
  };
  const Index amid = node_at(0.5, 0.5, 0.5), beside = node_at(0.667, 0.5, 0.5),
              floor = node_at(0.5, 0.5, 0);
  poor.mesh.points.row(amid) += Eigen::RowVector3d(0.09, 0.05, 0.02);
  poor.quality = measure_quality(poor.mesh, poor.mesh.points, poor.orientation);
  constexpr double kMoved = 0.02;
  const Points start = poor.mesh.points;
  Points positions = start;
  REQUIRE(poor.is_fixed[floor]);
  positions(floor, 2) -= kMoved;
  positions(beside, 0) -= kMoved;
  const BestMeshResult result = poor.raised(positions);
  CHECK(result.report.best.worst_twentieth > result.report.plain.worst_twentieth);
  CHECK((result.positions - start).rowwise().norm().maxCoeff() <= 1.2 * kMoved);
}

TEST_CASE("A mesh that came by small moves is raised as one that came at once") {
  const FixedCube cube_case(cube(CellType::Hexahedron, 5));
  const Points moved = cube_case.disturbed(0.3);
  const BestMeshResult at_once = cube_case.raised(moved);
  REQUIRE(at_once.report.best.min > 1.1 * at_once.report.plain.min);
  Mesh last = cube_case.mesh;
  last.points = moved;
  const BestMeshResult result =
      find_best_mesh(last, {cube_case.mesh.points, cube_case.quality},
                     {moved, measure_quality(last, moved, cube_case.orientation)},
                     cube_case.is_fixed, cube_case.orientation);
  CHECK(result.positions == at_once.positions);
}

}  // namespace cadmorph
