#include "core/reference_cell.h"

#include <utility>

#include "core/bernstein.h"
#include "core/cell_topology.h"

namespace cadmorph {
namespace {

using enum CellType;
using Eigen::Vector3d;

std::vector<Vector3d> reference_corners(CellType type) {
  std::vector<Vector3d> cube = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  switch (info_of(type).shape) {
    case Shape::Simplex:
      return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    case Shape::Cube:
      if (type != Voxel) return cube;
      std::swap(cube[2], cube[3]);
      std::swap(cube[6], cube[7]);
      return cube;
    case Shape::Prism:
      return {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}, {0, 1, 1}, {1, 0, 1}};
    case Shape::Pyramid:
      return {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {0, 0, 1}};
    case Shape::Triangle:
      return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    default:
      return {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  }
}

/// All x^a y^b z^c with a, b, c up to 2 that `accept` takes.
template <class Accept>
std::vector<ShapePolynomial> monomials(Accept accept) {
  std::vector<ShapePolynomial> space;
  for (int c = 0; c <= 2; ++c)
    for (int b = 0; b <= 2; ++b)
      for (int a = 0; a <= 2; ++a)
        if (accept(a, b, c)) space.push_back({{a, b, c, 0}});
  return space;
}

std::vector<ShapePolynomial> with(std::vector<ShapePolynomial> space,
                                  const std::vector<ShapePolynomial>& more) {
  space.insert(space.end(), more.begin(), more.end());
  return space;
}

double term_value(const ShapeTerm& term, const Vector3d& x) {
  const double numerator =
      integer_power(x[0], term[0]) * integer_power(x[1], term[1]) * integer_power(x[2], term[2]);
  return numerator == 0 ? 0 : numerator / integer_power(1 - x[2], term[3]);
}

}  // namespace

double value(const ShapePolynomial& polynomial, const Vector3d& x) {
  double sum = 0;
  for (const ShapeTerm& term : polynomial) sum += term_value(term, x);
  return sum;
}

Vector3d gradient(const ShapePolynomial& polynomial, const Vector3d& x) {
  Vector3d sum = Vector3d::Zero();
  for (const ShapeTerm& term : polynomial) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (term[i] == 0) continue;
      ShapeTerm lower = term;
      --lower[i];
      sum[Index(i)] += term[i] * term_value(lower, x);
    }
    const auto& [a, b, c, below] = term;
    if (below > 0) sum[2] += below * term_value({a, b, c, below + 1}, x);
  }
  return sum;
}

std::vector<Vector3d> reference_nodes(CellType type) {
  const CellInfo& info = info_of(type);
  const std::vector<Vector3d> corners = reference_corners(type);
  const auto centre = [&](auto begin, auto end) {
    Vector3d sum = Vector3d::Zero();
    for (auto corner = begin; corner != end; ++corner) sum += corners[*corner];
    return Vector3d(sum / double(end - begin));
  };
  std::vector<Vector3d> nodes = corners;
  for (const LocalEdge& edge : info.edges.first(std::size_t(info.mid_nodes)))
    nodes.push_back((corners[edge.a] + corners[edge.b]) / 2);
  for (const LocalFace& face : info.faces)
    if (face.type == BiquadraticQuad)
      nodes.push_back(centre(face.nodes.begin(), face.nodes.begin() + 4));
  if (std::ssize(nodes) < info.nodes) {
    Vector3d sum = Vector3d::Zero();
    for (const Vector3d& corner : corners) sum += corner;
    nodes.push_back(sum / double(corners.size()));
  }
  return nodes;
}

std::vector<ShapePolynomial> shape_space(CellType type) {
  const auto squares = [](int a, int b, int c) { return (a == 2) + (b == 2) + (c == 2); };
  switch (type) {
    case Tetra:
      return monomials([](int a, int b, int c) { return a + b + c <= 1; });
    case Hexahedron:
    case Voxel:
      return monomials([&](int a, int b, int c) { return squares(a, b, c) == 0; });
    case Wedge:
      return monomials([](int a, int b, int c) { return a + b <= 1 && c <= 1; });
    case Pyramid:
      return with(monomials([](int a, int b, int c) { return a + b + c <= 1; }), {{{1, 1, 0, 1}}});
    case QuadraticTetra:
      return monomials([](int a, int b, int c) { return a + b + c <= 2; });
    case QuadraticHexahedron:  // serendipity: at most one factor of a term is squared
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
    case QuadraticPyramid:
      return with(monomials([](int a, int b, int c) { return a + b + c <= 2; }),
                  {{{1, 1, 0, 1}}, {{2, 1, 0, 1}}, {{1, 2, 0, 1}}});
    case BiquadraticQuadraticPyramid:
      return with(shape_space(QuadraticPyramid), {{{2, 2, 0, 2}}});
    case QuadraticTriangle:
      return monomials([](int a, int b, int c) { return a + b <= 2 && c == 0; });
    case BiquadraticTriangle:  // with x y (1 - x - y)
      return with(monomials([](int a, int b, int c) { return a + b <= 2 && c == 0; }),
                  {{{2, 1, 0, 0}, {1, 2, 0, 0}}});
    case QuadraticLinearQuad:
      return monomials([](int, int b, int c) { return b <= 1 && c == 0; });
    case QuadraticQuad:
      return monomials([&](int a, int b, int c) { return squares(a, b, c) <= 1 && c == 0; });
    default:
      return monomials([](int, int, int c) { return c == 0; });
  }
}

}  // namespace cadmorph
