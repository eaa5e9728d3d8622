#include "rbf_sets.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/rbf/centre_frame.h"

namespace cadmorph::test {
namespace {

using Eigen::RowVector3d;
using std::numbers::pi;

class Random {
 public:
  double operator()(double low, double high) {
    return low + (high - low) * ((generator_() + 0.5) / 4294967296.0);
  }

 private:
  std::mt19937 generator_{1};
};

RowMatrix to_rows(const std::vector<RowVector3d>& points) {
  RowMatrix result(static_cast<Index>(points.size()), 3);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = points[i];
  return result;
}

RowVector3d turned(const RowVector3d& p, double angle) {
  return {p.x() * std::cos(angle) - p.y() * std::sin(angle),
          p.x() * std::sin(angle) + p.y() * std::cos(angle), p.z()};
}

// Nodes on the faces of a box, moved by up to 15 % of their spacing within their face.
std::vector<RowVector3d> box_faces(const RowVector3d& low, const RowVector3d& high, double spacing,
                                   Random& random) {
  std::vector<RowVector3d> points;
  int count[3];
  for (int d = 0; d < 3; ++d)
    count[d] = std::max(2, static_cast<int>(std::lround((high(d) - low(d)) / spacing)));
  int index[3];
  for (index[0] = 0; index[0] <= count[0]; ++index[0])
    for (index[1] = 0; index[1] <= count[1]; ++index[1])
      for (index[2] = 0; index[2] <= count[2]; ++index[2]) {
        RowVector3d p;
        bool is_on_face = false;
        for (int d = 0; d < 3; ++d) {
          const bool is_end = index[d] == 0 || index[d] == count[d];
          is_on_face = is_on_face || is_end;
          p(d) = low(d) + (high(d) - low(d)) * index[d] / count[d];
          if (!is_end) p(d) += spacing * random(-0.15, 0.15);
        }
        if (is_on_face) points.push_back(p);
      }
  return points;
}

// Points of the volume: two in five within a few thousandths to a few spacings of the surface.
template <class Inside>
RowMatrix scatter(Index count, const std::vector<RowVector3d>& surface, const RowVector3d& low,
                  const RowVector3d& high, double spacing, Random& random, const Inside& inside) {
  std::vector<RowVector3d> points;
  while (static_cast<Index>(points.size()) < count) {
    RowVector3d p;
    const bool is_near = random(0, 1) < 0.4;
    const RowVector3d& node = surface[static_cast<std::size_t>(random(0, surface.size()))];
    const double offset = 1.7 * spacing * std::pow(10, random(-3, 0));
    for (int d = 0; d < 3; ++d)
      p(d) = is_near ? node(d) + offset * random(-1, 1) : random(low(d), high(d));
    const bool is_in_box = (p.array() >= low.array()).all() && (p.array() <= high.array()).all();
    if (is_in_box && inside(p)) points.push_back(p);
  }
  return to_rows(points);
}

double naca0012(double x) {
  return 0.6 * (0.2969 * std::sqrt(x) - 0.1260 * x - 0.3516 * x * x + 0.2843 * x * x * x -
                0.1036 * x * x * x * x);
}

// Point i of n about a section of unit chord, closer together at its nose and tail.
RowVector3d section(int i, int n) {
  const double x = 0.5 * (1 + std::cos(2 * pi * i / n));
  return {x, i > n / 2 ? -naca0012(x) : naca0012(x), 0};
}

// Ratio of the geometric series of `layers` terms from `first` that sums to `length`.
double growth(double first, int layers, double length) {
  double low = 1.0001, high = 10;
  for (int i = 0; i < 200; ++i) {
    const double q = 0.5 * (low + high);
    (first * (std::pow(q, layers) - 1) / (q - 1) > length ? high : low) = q;
  }
  return low;
}

// Layers about the section on the plane z = 0, the first at 1e-5 of the chord.
void add_symmetry_plane(int around, int layers, std::vector<RowVector3d>& points) {
  constexpr double kFirst = 1e-5;
  const double ratio = growth(kFirst, layers, 3);
  double offset = 0, step = kFirst;
  for (int l = 0; l < layers; ++l, step *= ratio) {
    offset += step;
    for (int i = 0; i < around; ++i) {
      const RowVector3d tangent =
          section((i + 1) % around, around) - section((i + around - 1) % around, around);
      RowVector3d normal = RowVector3d(tangent.y(), -tangent.x(), 0).normalized();
      if (i == 0) normal = {1, 0, 0};
      const double angle = 2 * pi * i / around, blend = std::min(1.0, offset);
      normal = (1 - blend) * normal + blend * RowVector3d(std::cos(angle), std::sin(angle), 0);
      points.push_back(section(i, around) + offset * normal.normalized());
    }
  }
}

RowVector3d wing_motion(const RowVector3d& p) {
  const bool is_far = p.z() > 2.001 || std::abs(p.y()) > 3.99 || p.x() < -3.99 || p.x() > 4.99;
  if (is_far) return RowVector3d::Zero();
  const double outside = std::hypot(std::max(0.0, std::abs(p.x() - 0.5) - 0.5), p.y());
  double fade = 1;
  if (p.z() == 0) {
    fade = std::max(0.0, 1 - outside / 1.5);
    fade *= fade * (3 - 2 * fade);
  }
  const double x = std::clamp(p.x(), -0.3, 1.3), span = p.z() / 2;
  const RowVector3d twisted = turned({x - 0.25, p.y(), 0}, -8 * pi / 180 * span);
  const double camber = 0.02 * (1 - 4 * (x - 0.5) * (x - 0.5));
  const double flap = std::max(0.0, x - 0.7) * std::tan(6 * pi / 180);
  return fade * RowVector3d(twisted.x() + 0.25 - x,
                            twisted.y() - p.y() + 0.15 * span * span - flap + camber, 0);
}

// Nodes of the unit square: a shaken square lattice, or a triangular one.
std::vector<Eigen::RowVector2d> sheet(int n, bool is_triangular, unsigned seed) {
  std::mt19937 generator(seed);
  const auto shake = [&] { return 0.15 / n * (2 * (generator() / 4294967296.0) - 1); };
  const int rows = is_triangular ? static_cast<int>(std::lround(n * 2 / std::sqrt(3.0))) : n;
  std::vector<Eigen::RowVector2d> points;
  for (int j = 0; j <= rows; ++j) {
    const bool is_shifted = is_triangular && j % 2 == 1;
    const int last = is_shifted ? n + 1 : n;
    for (int i = 0; i <= last; ++i) {
      Eigen::RowVector2d p(is_shifted ? std::clamp((i - 0.5) / n, 0.0, 1.0) : double(i) / n,
                           double(j) / rows);
      const double a = shake(), b = shake();
      if (p.x() > 0 && p.x() < 1) p.x() += a;
      if (p.y() > 0 && p.y() < 1) p.y() += b;
      points.push_back(p);
    }
  }
  return points;
}

bool is_on_rim(const Eigen::RowVector2d& p) {
  return p.minCoeff() < 1e-9 || p.maxCoeff() > 1 - 1e-9;
}

// The second sheet of an unmatched pair; a plate's rim is shared by its sides in any case.
std::vector<Eigen::RowVector2d> other_sheet(SheetShape shape, int n,
                                            const std::vector<Eigen::RowVector2d>& first) {
  std::vector<Eigen::RowVector2d> points = sheet(n, true, 8);
  if (shape == SheetShape::Tube) return points;
  std::erase_if(points, is_on_rim);
  std::copy_if(first.begin(), first.end(), std::back_inserter(points), is_on_rim);
  return points;
}

}  // namespace

RbfSet turning_hole(Index surface_nodes, Index volume_nodes) {
  constexpr double kRadius = 0.35, kReach = 0.7;
  Random random;
  const double area = 8 + 2 * (4 - pi * kRadius * kRadius) + 2 * pi * kRadius;
  const double h = std::sqrt(area / static_cast<double>(surface_nodes));
  const RowVector3d low(-1, -1, -0.5), high(1, 1, 0.5);
  const auto is_on_end = [](const RowVector3d& p) {
    return std::abs(std::abs(p.z()) - 0.5) < 1e-12;
  };

  std::vector<RowVector3d> points = box_faces(low, high, h, random);
  std::erase_if(points, [&](const RowVector3d& p) {
    return is_on_end(p) && std::hypot(p.x(), p.y()) < kRadius + 0.6 * h;
  });
  const int around = static_cast<int>(std::lround(2 * pi * kRadius / h));
  const int along = std::max(2, static_cast<int>(std::lround(1 / h)));
  for (int i = 0; i < around; ++i)
    for (int k = 0; k <= along; ++k) {
      const double angle = 2 * pi * (i + 0.5 * (k % 2)) / around;
      points.emplace_back(kRadius * std::cos(angle), kRadius * std::sin(angle),
                          -0.5 + double(k) / along);
    }
  std::vector<RowVector3d> motion;
  for (const RowVector3d& p : points) {
    const double r = std::hypot(p.x(), p.y());
    double part = 0;
    if (r <= kRadius + 1e-9)
      part = 1;
    else if (is_on_end(p))
      part = std::max(0.0, (kReach - r) / (kReach - kRadius));
    RowVector3d moved = turned(p, part * 20 * pi / 180);
    moved.head<2>() *= 1 + 0.15 * part;
    motion.push_back(moved - p);
  }
  const auto inside = [](const RowVector3d& p) { return std::hypot(p.x(), p.y()) >= kRadius; };
  return {"turning hole", to_rows(points), to_rows(motion),
          scatter(volume_nodes, points, low, high, h, random, inside)};
}

RbfSet sphere_in_box(Index surface_nodes, Index volume_nodes) {
  constexpr double kRadius = 0.3;
  Random random;
  const Index on_sphere = surface_nodes / 2;
  const RowVector3d low(-1, -1, -1), high(1, 1, 1);
  std::vector<RowVector3d> points = box_faces(
      low, high, std::sqrt(24.0 / static_cast<double>(surface_nodes - on_sphere)), random);
  const std::size_t box_nodes = points.size();
  const double golden = pi * (3 - std::sqrt(5.0));
  for (Index i = 0; i < on_sphere; ++i) {
    const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(on_sphere);
    const double r = std::sqrt(1 - z * z), angle = golden * static_cast<double>(i);
    points.emplace_back(kRadius * r * std::cos(angle), kRadius * r * std::sin(angle), kRadius * z);
  }
  std::vector<RowVector3d> motion(points.size(), RowVector3d::Zero());
  for (std::size_t i = box_nodes; i < points.size(); ++i) {
    const RowVector3d& p = points[i];
    motion[i] = {0.1 + 0.1 * p.x() + 0.3 * p.z() * p.z(), 0.05 * p.y() + 0.2 * std::abs(p.x()),
                 0.1 * p.z() - 0.05 * std::max(0.0, p.y())};
  }
  const double h = std::sqrt(4 * pi * kRadius * kRadius / static_cast<double>(on_sphere));
  const auto inside = [](const RowVector3d& p) { return p.norm() >= kRadius; };
  return {"sphere in box", to_rows(points), to_rows(motion),
          scatter(volume_nodes, points, low, high, h, random, inside)};
}

RbfSet graded_wing(Index surface_nodes, Index volume_nodes) {
  Random random;
  const int on_wing = static_cast<int>(0.55 * static_cast<double>(surface_nodes));
  const int on_plane = static_cast<int>(0.3 * static_cast<double>(surface_nodes));
  const int far_nodes = static_cast<int>(surface_nodes) - on_wing - on_plane;
  const int around = std::max(24, static_cast<int>(std::sqrt(on_wing * 1.6))) / 2 * 2;
  const int along = on_wing / around;
  std::vector<RowVector3d> points;
  for (int k = 0; k <= along; ++k)
    for (int i = 0; i < around; ++i)
      points.push_back(section(i, around) + RowVector3d(0, 0, 2.0 * k / along));
  add_symmetry_plane(around, std::max(8, on_plane / around), points);

  const RowVector3d low(-4, -4, 0), high(5, 4, 5);
  const double spacing = std::sqrt((2.0 * 9 * 8 + 2 * 9 * 5 + 2 * 8 * 5) / std::max(far_nodes, 50));
  for (const RowVector3d& p : box_faces(low, high, spacing, random))
    if (p.z() != 0 || std::hypot(p.x() - 0.5, p.y()) >= 3.5) points.push_back(p);
  const RowMatrix all = to_rows(points);
  std::vector<RowVector3d> distinct, motion;
  for (const Index row : distinct_rows(all).rows) {
    distinct.push_back(all.row(row));
    motion.push_back(wing_motion(distinct.back()));
  }
  const auto inside = [](const RowVector3d& p) {
    return p.z() > 2 || p.x() <= 0 || p.x() >= 1 || std::abs(p.y()) >= naca0012(p.x());
  };
  return {"graded wing", to_rows(distinct), to_rows(motion),
          scatter(volume_nodes, distinct, low, high, 0.05, random, inside)};
}

RbfSet thin_sheets(SheetShape shape, Index surface_nodes, double gap, bool is_matched) {
  const int n = std::max(6, static_cast<int>(std::lround(std::sqrt(surface_nodes / 2.0))) - 1);
  const double thickness = gap / n;
  const auto first = sheet(n, false, 7);
  const auto second = is_matched ? first : other_sheet(shape, n, first);
  std::vector<RowVector3d> points, motion;
  for (int side = 0; side < 2; ++side)
    for (const Eigen::RowVector2d& q : side == 0 ? first : second) {
      const double z = (side - 0.5) * thickness;
      double thicker = side * thickness * 0.25 * (1 + std::sin(6 * q.x()) * std::cos(5 * q.y()));
      RowVector3d p(q.x() - 0.5, q.y() - 0.5, z), normal(0, 0, 1);
      if (shape == SheetShape::Tube) {
        if (q.x() > 1 - 1e-9) continue;
        normal = {std::cos(2 * pi * q.x()), std::sin(2 * pi * q.x()), 0};
        p = (1 / (2 * pi) + z) * normal + RowVector3d(0, 0, q.y());
      }
      const double r = std::hypot(p.x(), p.y()), fade = std::clamp((0.35 - r) / 0.2, 0.0, 1.0);
      const RowVector3d bent(0.02 * p.y(), 0.03 * p.x() * p.z(),
                             0.1 * std::sin(3 * p.x()) * std::cos(2 * p.y()));
      const RowVector3d turn = turned(p, fade * 20 * pi / 180) - p;
      points.push_back(p);
      motion.push_back(bent + thicker * normal + turn);
    }
  const char* name = shape == SheetShape::Plate ? "plate" : "tube";
  return {std::string(name) + (is_matched ? ", matched" : ", unmatched"), to_rows(points),
          to_rows(motion), RowMatrix(0, 3)};
}

}  // namespace cadmorph::test
