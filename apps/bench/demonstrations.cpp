#include "apps/bench/demonstrations.h"

#include <array>
#include <fstream>
#include <vector>

#include "apps/summary/text_table.h"
#include "core/errors.h"
#include "core/rbf/rbf_system.h"

namespace cadmorph::bench {
namespace {

namespace fs = std::filesystem;

void write_lines(const fs::path& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) throw IoError("can't write " + path.string());
}

RowMatrix rows_of(const RowMatrix& from, const std::vector<Index>& rows) {
  RowMatrix result(static_cast<Index>(rows.size()), from.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = from.row(rows[i]);
  return result;
}

// Nodes of a regular grid on [-1, 1]^2, n x n cells.
RowMatrix grid(int n, int columns) {
  RowMatrix points = RowMatrix::Zero((n + 1) * (n + 1), columns);
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i)
      points.row(j * (n + 1) + i).head(2) << 2.0 * i / n - 1, 2.0 * j / n - 1;
  return points;
}

// Heights of all points when those inside a disc are raised by `lift` and those outside a ring
// held, in half sides of the square: so far that the two kernels differ in the picture.
Eigen::VectorXd raised(const RowMatrix& points, const Kernel& kernel) {
  constexpr double kRaised = 0.25, kHeld = 0.85, kLift = 0.6;
  std::vector<Index> rows;
  for (Index i = 0; i < points.rows(); ++i) {
    const double radius = points.row(i).norm();
    if (radius < kRaised || radius > kHeld) rows.push_back(i);
  }
  const RowMatrix centres = rows_of(points, rows);
  RowMatrix values = RowMatrix::Zero(centres.rows(), 1);
  for (Index i = 0; i < centres.rows(); ++i)
    if (centres.row(i).norm() < kRaised) values(i, 0) = kLift;
  const RbfSystem system(centres, kernel, {.solver = SolverKind::Ldlt});
  return system.solve(values).evaluate(points).col(0);
}

void write_plane(const fs::path& path) {
  const RowMatrix points = grid(48, 3);
  const Eigen::VectorXd biharmonic = raised(points, Kernel::biharmonic_3d());
  const Eigen::VectorXd triharmonic = raised(points, Kernel::triharmonic_3d());
  std::string text = "x,y,biharmonic,triharmonic\n";
  for (Index i = 0; i < points.rows(); ++i)
    text +=
        format("%.9g,%.9g,%.9g,%.9g\n", points(i, 0), points(i, 1), biharmonic[i], triharmonic[i]);
  write_lines(path, text);
}

using Triangles = std::vector<std::array<Index, 3>>;

// A square mesh whose middle block moves while its rim stays: so far that one step inverts
// triangles.
struct BlockCase {
  static constexpr int kCells = 24;
  static constexpr double kBlock = 0.26;  // half its width
  static constexpr double kShift = 0.5;

  RowMatrix points = grid(kCells, 2);
  Triangles triangles;
  std::vector<Index> prescribed;
  RowMatrix displacement;  // of the prescribed nodes

  BlockCase() {
    for (int j = 0; j < kCells; ++j)
      for (int i = 0; i < kCells; ++i) {
        const Index a = j * (kCells + 1) + i, b = a + 1, c = a + kCells + 2, d = a + kCells + 1;
        triangles.push_back({a, b, c});
        triangles.push_back({a, c, d});
      }
    for (Index i = 0; i < points.rows(); ++i)
      if (is_block(i) || points.row(i).cwiseAbs().maxCoeff() > 1 - 1e-9) prescribed.push_back(i);
    displacement = RowMatrix::Zero(static_cast<Index>(prescribed.size()), 2);
    for (std::size_t i = 0; i < prescribed.size(); ++i)
      if (is_block(prescribed[i])) displacement.row(i) << kShift, kShift;
  }

  bool is_block(Index i) const { return points.row(i).cwiseAbs().maxCoeff() < kBlock; }

  // By 2D biharmonic warps, each set up on the nodes moved so far.
  RowMatrix move(int steps) const {
    RowMatrix moved = points;
    for (int step = 0; step < steps; ++step) {
      const RbfSystem system(rows_of(moved, prescribed), Kernel::biharmonic_2d(),
                             {.solver = SolverKind::Ldlt});
      moved += system.solve(displacement / steps).evaluate(moved);
    }
    return moved;
  }

  bool is_inverted(const RowMatrix& at, const std::array<Index, 3>& t) const {
    const Eigen::RowVector2d u = at.row(t[1]) - at.row(t[0]), v = at.row(t[2]) - at.row(t[0]);
    return u[0] * v[1] - u[1] * v[0] <= 0;
  }

  Index inverted(const RowMatrix& at) const {
    Index count = 0;
    for (const auto& t : triangles) count += is_inverted(at, t);
    return count;
  }
};

void write_block(const fs::path& folder) {
  constexpr int kMostSteps = 50;  // so that the search for enough of them ends
  const BlockCase mesh;
  const RowMatrix once = mesh.move(1);
  RowMatrix stepped = once;
  int steps = 1;
  while (mesh.inverted(stepped) > 0 && steps < kMostSteps) stepped = mesh.move(++steps);
  std::string nodes = "x,y,x_one_step,y_one_step,x_steps,y_steps,steps\n";
  for (Index i = 0; i < mesh.points.rows(); ++i)
    nodes += format("%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%d\n", mesh.points(i, 0), mesh.points(i, 1),
                    once(i, 0), once(i, 1), stepped(i, 0), stepped(i, 1), steps);
  write_lines(folder / "block_nodes.csv", nodes);
  std::string triangles = "a,b,c,is_block,inverted_one_step,inverted_steps\n";
  for (const auto& t : mesh.triangles) {
    const bool is_block = mesh.is_block(t[0]) && mesh.is_block(t[1]) && mesh.is_block(t[2]);
    triangles += format("%d,%d,%d,%d,%d,%d\n", static_cast<int>(t[0]), static_cast<int>(t[1]),
                        static_cast<int>(t[2]), is_block, mesh.is_inverted(once, t),
                        mesh.is_inverted(stepped, t));
  }
  write_lines(folder / "block_triangles.csv", triangles);
}

}  // namespace

void write_demonstrations(const fs::path& folder) {
  fs::create_directories(folder);
  write_plane(folder / "plane.csv");
  write_block(folder);
}

}  // namespace cadmorph::bench
