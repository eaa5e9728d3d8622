#include "volume/shape_energy.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/cell_topology.h"
#include "core/isoparametric.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kSqrt2 = std::numbers::sqrt2;
constexpr double kTwoOverSqrt3 = 2.0 * std::numbers::inv_sqrt3;
constexpr std::size_t kTypes = 256;
constexpr double kInfinite = std::numeric_limits<double>::infinity();
// Weight of the shape of reference.
constexpr double kKeep = 0.1;
// A sample whose determinant is below this share of its edges' product counts as flat.
constexpr double kFlat = 1e-9;
// Of the largest stiffness: nodes that no energy holds.
constexpr double kLeastStiffness = 1e-9;

// Columns b x c, c x a, a x b: the derivative of the determinant by a, b, c.
Matrix3d cofactors(const Matrix3d& j) {
  Matrix3d result;
  result << j.col(1).cross(j.col(2)), j.col(2).cross(j.col(0)), j.col(0).cross(j.col(1));
  return result;
}

}  // namespace

const ShapeEnergy::Samples* ShapeEnergy::samples_of(Index cell) {
  using enum CellType;
  const CellType type = mesh_.types[cell];
  auto& known = samples_[static_cast<std::size_t>(type)];
  if (known) return known.get();
  auto result = std::make_unique<Samples>();
  const auto add_corner = [&](const std::array<int, 4>& corner, double unit) {
    result->push_back({corner, {}, false, unit});
  };
  switch (type) {
    case Tetra:
      result->push_back({{0, 1, 2, 3}, {}, true, kSqrt2});
      break;
    case Hexahedron:
    case Voxel: {
      using Order = std::array<int, 8>;
      const Order o = type == Voxel ? Order{0, 1, 3, 2, 4, 5, 7, 6} : Order{0, 1, 2, 3, 4, 5, 6, 7};
      NodeRows centre(8, 3);
      for (int i = 0; i < 4; ++i) {
        add_corner({o[i], o[(i + 1) % 4], o[(i + 3) % 4], o[i + 4]}, 1);
        add_corner({o[i + 4], o[(i + 3) % 4 + 4], o[(i + 1) % 4 + 4], o[i]}, 1);
        const double r = i == 1 || i == 2 ? 0.25 : -0.25, s = i > 1 ? 0.25 : -0.25;
        centre.row(o[i]) << r, s, -0.25;
        centre.row(o[i + 4]) << r, s, 0.25;
      }
      result->push_back({{}, centre, false, 1});
      break;
    }
    case Wedge:  // the normal of (0, 1, 2) points away from (3, 4, 5)
      for (int i = 0; i < 3; ++i) {
        add_corner({i, (i + 2) % 3, (i + 1) % 3, i + 3}, kTwoOverSqrt3);
        add_corner({i + 3, (i + 1) % 3 + 3, (i + 2) % 3 + 3, i}, kTwoOverSqrt3);
      }
      break;
    case Pyramid:
      for (int i = 0; i < 4; ++i) {
        add_corner({i, (i + 1) % 4, (i + 3) % 4, 4}, kSqrt2);
        add_corner({4, i, (i + 3) % 4, (i + 2) % 4}, kSqrt2);
      }
      break;
    case Polyhedron: {
      const auto nodes = mesh_.cell(cell);
      const auto weights = [&](std::span<const Index> some) {
        VectorXd w = VectorXd::Zero(std::ssize(nodes));
        for (const Index node : some)
          w[std::ranges::find(nodes, node) - nodes.begin()] += 1.0 / double(some.size());
        return w;
      };
      for_each_polyhedron_face(mesh_, cell, [&](std::span<const Index> face) {
        const VectorXd middle = weights(face);
        NodeRows slopes(std::ssize(nodes), 3);
        slopes.col(0) = middle - weights(nodes);
        slopes.col(1) = weights({&face.back(), 1}) - middle;
        for (const Index& node : face) {
          slopes.col(2) = weights({&node, 1}) - middle;
          const double sine = std::sin(2 * std::numbers::pi / double(face.size()));
          result->push_back({{}, slopes, false, 1 / sine});
          slopes.col(1) = slopes.col(2);
        }
      });
      samples_.push_back(std::move(result));
      return samples_.back().get();
    }
    default: {
      const Element& element = element_of(type);
      const double unit = element.shape == Shape::Prism  ? kTwoOverSqrt3
                          : element.shape == Shape::Cube ? 1
                                                         : kSqrt2;
      for (const NodeRows& slopes : element.samples)
        result->push_back({{}, slopes, element.shape == Shape::Simplex, unit});
      if (element.shape != Shape::Pyramid) break;
      const auto tangent = [&](int i) {  // at the apex, towards a corner
        VectorXd w = VectorXd::Zero(element.nodes);
        w[i % 4 + 9] = 4;
        w[4] = -3;
        w[i % 4] = -1;
        return w;
      };
      for (int i = 0; i < 4; ++i) {
        NodeRows slopes(element.nodes, 3);
        slopes << tangent(i), tangent(i + 3), tangent(i + 2);
        result->push_back({{}, slopes, false, unit});
      }
    }
  }
  known = std::move(result);
  return known.get();
}

ShapeEnergy::ShapeEnergy(const Mesh& mesh, const Points& reference, Points positions,
                         FreeNodes free, const std::vector<Index>& cells,
                         const Orientation& orientation)
    : mesh_(mesh),
      positions_(std::move(positions)),
      free_(std::move(free)),
      samples_(kTypes),
      slopes_(mesh, cells, free_) {
  for (const Index c : cells) {
    cells_.push_back({c, samples_of(c),
                      double(orientation[static_cast<std::size_t>(mesh.types[c])]),
                      std::ssize(shapes_)});
    for (const Sample& sample : *cells_.back().samples) {
      const Matrix3d j = edges(sample, mesh.cell(c), reference);
      const double det = cells_.back().sign * j.determinant();
      Shape0 shape{Matrix3d::Zero(), 0};
      if (det > kFlat * j.colwise().norm().prod()) {
        const Matrix3d inverse = j.inverse();
        shape = {inverse * inverse.transpose(), 1 / det};
      }
      shapes_.push_back(shape);
    }
  }
}

Matrix3d ShapeEnergy::edges(const Sample& sample, std::span<const Index> nodes,
                            const Points& points) const {
  Matrix3d j = Matrix3d::Zero();
  if (sample.slopes.size() == 0) {
    const auto& k = sample.corner;
    for (int i = 0; i < 3; ++i)
      j.col(i) = (points.row(nodes[k[i + 1]]) - points.row(nodes[k[0]])).transpose();
    return j;
  }
  for (std::size_t n = 0; n < nodes.size(); ++n)
    j += points.row(nodes[n]).transpose() * sample.slopes.row(n);
  return j;
}

// x^(p / 2), p = 2^(Halvings + 1).
template <int Halvings>
double ShapeEnergy::power(double x) {
  for (int i = 0; i < Halvings; ++i) x *= x;
  return x;
}

template <int Halvings>
ShapeEnergy::Terms ShapeEnergy::terms(const Sample& sample, const Shape0& shape, double sign,
                                      const Matrix3d& j) {
  const Matrix3d cofactor = cofactors(j);
  const double det = j.col(0).dot(cofactor.col(0));
  const double unit = sign * det * sample.unit;
  if (!(unit > 0)) return {kInfinite, Matrix3d::Zero(), 0};
  const double scale = 1 / (unit * unit);
  const Vector3d a = j.col(0), b = j.col(1), c = j.col(2);
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), cc = c.squaredNorm();
  Terms result;
  if (sample.is_simplex) {
    const Vector3d d = b - a, e = c - b, f = a - c;
    const double dd = d.squaredNorm(), ee = e.squaredNorm(), ff = f.squaredNorm();
    const double at_0 = power<Halvings>(aa * bb * cc * scale),
                 at_a = power<Halvings>(aa * dd * ff * scale),
                 at_b = power<Halvings>(bb * dd * ee * scale),
                 at_c = power<Halvings>(cc * ee * ff * scale);
    result.energy = (at_0 + at_a + at_b + at_c) / 4;
    const Vector3d of_d = (at_a + at_b) / (4 * dd) * d, of_e = (at_b + at_c) / (4 * ee) * e,
                   of_f = (at_c + at_a) / (4 * ff) * f;
    result.by_edges.col(0) = (at_0 + at_a) / (4 * aa) * a - of_d + of_f;
    result.by_edges.col(1) = (at_0 + at_b) / (4 * bb) * b + of_d - of_e;
    result.by_edges.col(2) = (at_0 + at_c) / (4 * cc) * c + of_e - of_f;
  } else {
    result.energy = power<Halvings>(aa * bb * cc * scale);
    result.by_edges.col(0) = result.energy / aa * a;
    result.by_edges.col(1) = result.energy / bb * b;
    result.by_edges.col(2) = result.energy / cc * c;
  }
  double by_det = result.energy;
  if (const double ratio = sign * det * shape.inverse_determinant; ratio > 0) {
    const Matrix3d stretched = j * shape.metric;
    const double norm = stretched.cwiseProduct(j).sum(), third = norm / 3;
    const double kept = kKeep * std::sqrt(power<Halvings>(third * third * third / (ratio * ratio)));
    result.energy += kept;
    // s^(p/4): p/4 (6 / |F|^2 F J0^-T - 2 / det), over the factor p that all terms share.
    result.by_edges += 1.5 * kept / norm * stretched;
    by_det += 0.5 * kept;
  }
  result.by_edges -= by_det / det * cofactor;
  result.stiffness = result.energy;
  return result;
}

template <int Halvings>
double ShapeEnergy::evaluate(Index i) {
  const Cell& cell = cells_[i];
  const auto nodes = mesh_.cell(cell.id);
  auto slope = slopes_.of(i);
  slope.setZero();
  double energy = 0;
  for (std::size_t s = 0; s < cell.samples->size(); ++s) {
    const Sample& sample = (*cell.samples)[s];
    const Terms t = terms<Halvings>(sample, shapes_[cell.first_shape + s], cell.sign,
                                    edges(sample, nodes, positions_));
    energy += t.energy;
    if (!std::isfinite(energy)) return kInfinite;
    if (sample.slopes.size() > 0) {
      slope.noalias() += sample.slopes.lazyProduct(t.by_edges.transpose());
      continue;
    }
    for (int k = 0; k < 3; ++k) slope.row(sample.corner[k + 1]) += t.by_edges.col(k).transpose();
    slope.row(sample.corner[0]) -= t.by_edges.rowwise().sum().transpose();
  }
  slope /= double(cell.samples->size());
  return energy / double(cell.samples->size());
}

template <class Work>
auto ShapeEnergy::with_power(const Work& work) const {
  switch (halvings_) {
    case 0:
      return work.template operator()<0>();
    case 1:
      return work.template operator()<1>();
    case 2:
      return work.template operator()<2>();
    case 3:
      return work.template operator()<3>();
    case 4:
      return work.template operator()<4>();
    case 5:
      return work.template operator()<5>();
    default:
      return work.template operator()<6>();
  }
}

double ShapeEnergy::operator()(const VectorXd& x, VectorXd& gradient) {
  free_.move(x, positions_);
  const Index count = std::ssize(cells_);
  std::vector<double> energies(count);
  with_power([&]<int Halvings>() {
    parallel_for(count, 256, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) energies[i] = evaluate<Halvings>(i);
    });
  });
  double sum = 0;
  for (const double energy : energies) sum += energy;
  if (!std::isfinite(sum)) {
    gradient.setZero(x.size());
    return kInfinite;
  }
  slopes_.gather(free_, 1 / sum, gradient);
  return std::log(sum) / (2 << halvings_);
}

VectorXd ShapeEnergy::stiffness_diagonal() {
  VectorXd result = VectorXd::Zero(free_.unknowns());
  double sum = 0;
  for (const Cell& cell : cells_) {
    const auto nodes = mesh_.cell(cell.id);
    VectorXd at_node = VectorXd::Zero(std::ssize(nodes));
    for (std::size_t s = 0; s < cell.samples->size(); ++s) {
      const Sample& sample = (*cell.samples)[s];
      const Matrix3d j = edges(sample, nodes, positions_);
      const double stiffness = with_power([&]<int Halvings>() {
        return terms<Halvings>(sample, shapes_[cell.first_shape + s], cell.sign, j).stiffness;
      });
      const double weight = stiffness / double(cell.samples->size());
      sum += weight;
      const Matrix3d inverse = j.inverse();  // rows: how the edges' coordinates vary in space
      if (sample.slopes.size() > 0) {
        at_node += weight * (sample.slopes * inverse).rowwise().squaredNorm();
        continue;
      }
      for (int i = 0; i < 3; ++i)
        at_node[sample.corner[i + 1]] += weight * inverse.row(i).squaredNorm();
      at_node[sample.corner[0]] += weight * inverse.colwise().sum().squaredNorm();
    }
    for (std::size_t n = 0; n < nodes.size(); ++n)
      if (free_.contains(nodes[n])) free_.add_diagonal(nodes[n], at_node[n], result);
  }
  return result.array().max(kLeastStiffness * result.maxCoeff()) / sum;
}

}  // namespace cadmorph
