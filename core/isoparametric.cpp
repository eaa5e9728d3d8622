#include "core/isoparametric.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <map>

#include "core/cell_topology.h"

namespace cadmorph {
namespace {

using enum CellType;
using Vec = Eigen::Vector3d;

/// x^a y^b z^c / (1-z)^d.
using Monomial = std::array<int, 4>;
using Polynomial = std::vector<Monomial>;

double power(double x, int exponent) { return exponent == 0 ? 1 : std::pow(x, exponent); }

double value(const Monomial& m, const Vec& x) {
  const double numerator = power(x[0], m[0]) * power(x[1], m[1]) * power(x[2], m[2]);
  return numerator == 0 ? 0 : numerator / power(1 - x[2], m[3]);
}

Vec gradient(const Monomial& m, const Vec& x) {
  Vec g = Vec::Zero();
  for (int i = 0; i < 3; ++i) {
    if (m[i] == 0) continue;
    Monomial lower = m;
    --lower[i];
    g[i] = m[i] * value(lower, x);
  }
  if (m[3] > 0) g[2] += m[3] * value({m[0], m[1], m[2], m[3] + 1}, x);
  return g;
}

Shape shape_of(CellType type) {
  switch (type) {
    case QuadraticTetra:
      return Shape::Simplex;
    case QuadraticHexahedron:
    case BiquadraticQuadraticHexahedron:
    case TriquadraticHexahedron:
      return Shape::Cube;
    case QuadraticWedge:
    case QuadraticLinearWedge:
    case BiquadraticQuadraticWedge:
      return Shape::Prism;
    case QuadraticPyramid:
      return Shape::Pyramid;
    case QuadraticTriangle:
    case BiquadraticTriangle:
      return Shape::Triangle;
    default:
      return Shape::Quad;
  }
}

/// Corners of the reference cell, right-handed for VTK's node order.
std::vector<Vec> reference_corners(Shape shape) {
  switch (shape) {
    case Shape::Simplex:
      return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    case Shape::Cube:
      return {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
              {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    case Shape::Prism:
      return {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}, {0, 1, 1}, {1, 0, 1}};
    case Shape::Pyramid:
      return {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {0, 0, 1}};
    case Shape::Triangle:
      return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    case Shape::Quad:
      return {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  }
  return {};
}

Vec centre_of(const std::vector<Vec>& corners) {
  Vec sum = Vec::Zero();
  for (const Vec& corner : corners) sum += corner;
  return sum / static_cast<double>(corners.size());
}

/// Sets the reference positions of the mid nodes of one face from its corners.
void place_mid_nodes(const LocalFace& face, std::vector<Vec>& nodes) {
  const int corners = corner_count(face.type, face.count);
  const int step = face.type == QuadraticLinearQuad ? 2 : 1;
  const auto at = [&](int i) -> Vec& { return nodes[face.nodes[i]]; };
  int next = corners;
  for (int i = 0; i < corners && next < face.count; i += step, ++next)
    at(next) = (at(i) + at((i + 1) % corners)) / 2;
  if (next == face.count) return;
  at(next) = Vec::Zero();
  for (int i = 0; i < corners; ++i) at(next) += at(i) / corners;
}

std::vector<Vec> reference_nodes(CellType type) {
  std::vector<Vec> nodes = reference_corners(shape_of(type));
  nodes.resize(cell_node_count(type), centre_of(nodes));
  for (const LocalFace& face : local_faces(type)) place_mid_nodes(face, nodes);
  if (dimension(type) == 2)
    place_mid_nodes({type, cell_node_count(type), {0, 1, 2, 3, 4, 5, 6, 7, 8}}, nodes);
  return nodes;
}

/// Adds all x^a y^b z^c with a, b, c up to 2 that `accept` takes.
template <class Accept>
std::vector<Polynomial> monomials(Accept accept) {
  std::vector<Polynomial> space;
  for (int c = 0; c <= 2; ++c)
    for (int b = 0; b <= 2; ++b)
      for (int a = 0; a <= 2; ++a)
        if (accept(a, b, c)) space.push_back({{a, b, c, 0}});
  return space;
}

/// The polynomials that a type's shape functions span.
std::vector<Polynomial> shape_space(CellType type) {
  const auto squares = [](int a, int b, int c) { return (a == 2) + (b == 2) + (c == 2); };
  switch (type) {
    case QuadraticTetra:
      return monomials([](int a, int b, int c) { return a + b + c <= 2; });
    case QuadraticHexahedron:
      return monomials([&](int a, int b, int c) { return squares(a, b, c) <= 1; });
    case BiquadraticQuadraticHexahedron:
      return monomials([&](int a, int b, int c) {
        return squares(a, b, c) <= 1 || (squares(a, b, c) == 2 && c == 2);
      });
    case TriquadraticHexahedron:
      return monomials([](int, int, int) { return true; });
    case QuadraticWedge:
      return monomials([](int a, int b, int c) { return a + b <= (c == 2 ? 1 : 2); });
    case QuadraticLinearWedge:
      return monomials([](int a, int b, int c) { return a + b <= 2 && c <= 1; });
    case BiquadraticQuadraticWedge:
      return monomials([](int a, int b, int) { return a + b <= 2; });
    case QuadraticPyramid: {
      auto space = monomials([](int a, int b, int c) { return a + b + c <= 2; });
      for (const Monomial& m : {Monomial{1, 1, 0, 1}, {2, 1, 0, 1}, {1, 2, 0, 1}})
        space.push_back({m});
      return space;
    }
    case BiquadraticTriangle: {
      auto space = monomials([](int a, int b, int c) { return a + b <= 2 && c == 0; });
      space.push_back({{2, 1, 0, 0}, {1, 2, 0, 0}});
      return space;
    }
    case QuadraticTriangle:
      return monomials([](int a, int b, int c) { return a + b <= 2 && c == 0; });
    case QuadraticLinearQuad:
      return monomials([](int, int b, int c) { return b <= 1 && c == 0; });
    case QuadraticQuad:
      return monomials([&](int a, int b, int c) { return squares(a, b, c) <= 1 && c == 0; });
    default:
      return monomials([](int, int, int c) { return c == 0; });
  }
}

/// Directions of the determinant at a reference point, as columns. In a pyramid the third runs to
/// the apex, so that they are the edges at each corner.
Eigen::Matrix3d directions(Shape shape, const Vec& x) {
  Eigen::Matrix3d result = Eigen::Matrix3d::Identity();
  if (shape == Shape::Pyramid) result.col(2) = Vec(0, 0, 1) - x;
  return result;
}

Element make_element(CellType type) {
  const std::vector<Vec> nodes = reference_nodes(type);
  const std::vector<Polynomial> space = shape_space(type);
  const auto count = static_cast<int>(nodes.size());
  Element element{shape_of(type), count, {}};
  Eigen::MatrixXd vandermonde = Eigen::MatrixXd::Zero(count, count);
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j)
      for (const Monomial& m : space[j]) vandermonde(i, j) += value(m, nodes[i]);
  const Eigen::MatrixXd coefficients = vandermonde.inverse();
  std::vector<Vec> samples = nodes;
  samples.push_back(centre_of(reference_corners(element.shape)));
  for (const Vec& x : samples) {
    if (element.shape == Shape::Pyramid && x[2] == 1) continue;
    Eigen::MatrixXd derivatives = Eigen::MatrixXd::Zero(count, 3);
    for (int j = 0; j < count; ++j)
      for (const Monomial& m : space[j]) derivatives.row(j) += gradient(m, x).transpose();
    element.samples.push_back(coefficients.transpose() * derivatives *
                              directions(element.shape, x));
  }
  return element;
}

}  // namespace

const Element& element_of(CellType type) {
  static const std::map<CellType, Element> elements = [] {
    std::map<CellType, Element> all;
    for (CellType t : {QuadraticTetra, QuadraticHexahedron, BiquadraticQuadraticHexahedron,
                       TriquadraticHexahedron, QuadraticWedge, QuadraticLinearWedge,
                       BiquadraticQuadraticWedge, QuadraticPyramid, QuadraticTriangle,
                       BiquadraticTriangle, QuadraticLinearQuad, QuadraticQuad, BiquadraticQuad})
      all.emplace(t, make_element(t));
    return all;
  }();
  return elements.at(type);
}

}  // namespace cadmorph
