#include "core/isoparametric.h"

#include <Eigen/LU>
#include <map>

#include "core/reference_cell.h"

namespace cadmorph {
namespace {

using enum CellType;
using Vec = Eigen::Vector3d;

/// Directions of the determinant at a reference point, as columns. In a pyramid the third runs to
/// the apex, so that they are the edges at each corner.
Eigen::Matrix3d directions(Shape shape, const Vec& x) {
  Eigen::Matrix3d result = Eigen::Matrix3d::Identity();
  if (shape == Shape::Pyramid) result.col(2) = Vec(0, 0, 1) - x;
  return result;
}

Element make_element(CellType type) {
  const CellInfo& info = info_of(type);
  const std::vector<Vec> nodes = reference_nodes(type);
  const std::vector<ShapePolynomial> space = shape_space(type);
  const Index count = std::ssize(nodes);
  Element element{info.shape, info.nodes, {}};
  Eigen::MatrixXd vandermonde(count, count);
  for (Index i = 0; i < count; ++i)
    for (Index j = 0; j < count; ++j) vandermonde(i, j) = value(space[j], nodes[i]);
  const Eigen::MatrixXd coefficients = vandermonde.inverse();
  std::vector<Vec> samples = nodes;
  Vec centre = Vec::Zero();
  for (int i = 0; i < info.corners; ++i) centre += nodes[i];
  samples.push_back(centre / double(info.corners));
  for (const Vec& x : samples) {
    if (element.shape == Shape::Pyramid && x[2] == 1) continue;
    Eigen::MatrixXd derivatives(count, 3);
    for (Index j = 0; j < count; ++j) derivatives.row(j) = gradient(space[j], x).transpose();
    element.samples.push_back(coefficients.transpose() * derivatives *
                              directions(element.shape, x));
  }
  return element;
}

}  // namespace

const Element& element_of(CellType type) {
  static const std::map<CellType, Element> elements = [] {
    std::map<CellType, Element> all;
    for (CellType t :
         {QuadraticTetra, QuadraticHexahedron, BiquadraticQuadraticHexahedron,
          TriquadraticHexahedron, QuadraticWedge, QuadraticLinearWedge, BiquadraticQuadraticWedge,
          QuadraticPyramid, BiquadraticQuadraticPyramid, QuadraticTriangle, BiquadraticTriangle,
          QuadraticLinearQuad, QuadraticQuad, BiquadraticQuad})
      all.emplace(t, make_element(t));
    return all;
  }();
  return elements.at(type);
}

}  // namespace cadmorph
