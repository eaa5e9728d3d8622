#include "volume/shape_energy.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/cell_topology.h"
#include "core/isoparametric.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"
#include "core/reference_cell.h"
#include "volume/space_order.h"

namespace cadmorph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kSqrt2 = std::numbers::sqrt2;
constexpr double kTwoOverSqrt3 = 2.0 * std::numbers::inv_sqrt3;
constexpr std::size_t kTypes = 256;  // CellType is a byte
constexpr double kInfinite = std::numeric_limits<double>::infinity();
// A sample whose determinant is below this share of its edges' product counts as flat: far above
// the rounding of a determinant, 1e-16, far below any cell that has a shape.
constexpr double kFlat = 1e-9;
// Of a cell's height: the farthest that a node goes at once. A node and the face opposite that come
// towards each other just meet then. With 0.25 or 0.9, 5 pairs keep 2 and 0.4 % less of the
// smallest scaled Jacobian on the mean.
constexpr double kReach = 0.5;
// The faces' energy has 2^2 times the power p of the shapes'. (2 / (1 + c))^4 falls with a cosine c
// as fast as 1 / q does with a shape q at c = q = 1/3, near checkMesh's limit of 70 degrees; with
// the power p alone it would be small beside the shapes' for poor faces.
constexpr int kFaceDoublings = 2;
// With finite volumes a cell that kept its shape counts 1.5^p, as a face of 36 degrees does, less
// than faces that are poor. Shapes below the least count against that: nearly flat cells may not
// stay so. With 1.25 the angles of the worst twentieth of a bracket's and a bore's faces are 2 %
// smaller, with 2 they are 4 and 1 % larger; with half or twice of kLeastShape 4 pairs are the
// same.
constexpr double kShapeWeight = 1.5;
constexpr double kLeastShape = 0.01;
// (|F|^2 / 3)^3 / det(F)^2 of a cell that may become as flat as this: of a stretch by 1.7, or of
// one to 0.55. With 1.25 or 2, 4 pairs by faces come out the same.
constexpr double kFreelyFlat = 1.5;
// Cells that a thread takes at a time.
constexpr Index kGrain = 256;

bool is_tetrahedron(CellType type) {
  return type == CellType::Tetra || type == CellType::QuadraticTetra;
}

// One over the determinant of the ideal cell's sample with unit edges.
double unit_of(Shape shape) {
  switch (shape) {
    case Shape::Prism:
    case Shape::Triangle:
      return kTwoOverSqrt3;
    case Shape::Cube:
    case Shape::Quad:
      return 1;
    default:
      return kSqrt2;
  }
}

// The largest product of three edges at a corner of a tetrahedron; that of the sample's own.
double longest_edges(const Matrix3d& j, bool is_tetrahedron) {
  const double a = j.col(0).norm(), b = j.col(1).norm(), c = j.col(2).norm();
  if (!is_tetrahedron) return a * b * c;
  const double d = (j.col(1) - j.col(0)).norm(), e = (j.col(2) - j.col(1)).norm(),
               f = (j.col(0) - j.col(2)).norm();
  return std::max({a * b * c, a * d * f, b * d * e, c * e * f});
}

Eigen::Matrix3d lane_of(const SampleLane rows[9], std::size_t lane) {
  Eigen::Matrix3d result;
  for (int k = 0; k < 9; ++k) result.data()[k] = rows[k][lane];
  return result;
}

// (|F|^2 / 3)^3 / det(F)^2 of a sample's edges; 1 where there is no shape of reference.
double flatness(const SampleReference& reference, std::size_t lane, const Matrix3d& j) {
  const double ratio = j.determinant() * reference.inverse_determinant[lane];
  if (ratio == 0) return 1;
  Matrix3d metric;
  int k = 0;
  for (int column = 0; column < 3; ++column)
    for (int row = column; row < 3; ++row)
      metric(row, column) = metric(column, row) = reference.metric[k++][lane];
  const double third = (j * metric).cwiseProduct(j).sum() / 3;
  return third * third * third / (ratio * ratio);
}

}  // namespace

const ShapeEnergy::Samples* ShapeEnergy::samples_of(Index cell) {
  using enum CellType;
  const CellType type = mesh_.types[cell];
  auto& known = samples_[static_cast<std::size_t>(type)];
  if (known) return known.get();
  auto result = std::make_unique<Samples>();
  const auto add_corners = [&](std::span<const LocalCorner> corners, double unit) {
    for (const LocalCorner& k : corners) result->push_back({{k[0], k[1], k[2], k[3]}, {}, unit});
  };
  const auto add_ring = [&](std::span<const int> ring, double unit) {
    const std::size_t n = ring.size();
    for (std::size_t i = 0; i < n; ++i)
      result->push_back({{ring[i], ring[(i + 1) % n], ring[(i + n - 1) % n], -1}, {}, unit});
  };
  switch (type) {
    case Triangle:
      add_ring(std::array{0, 1, 2}, kTwoOverSqrt3);
      break;
    case Quad:
      add_ring(std::array{0, 1, 2, 3}, 1);
      break;
    case Pixel:
      add_ring(std::array{0, 1, 3, 2}, 1);
      break;
    case Polygon: {
      const Index count = std::ssize(mesh_.cell(cell));
      const double unit = 1 / std::sin(2 * std::numbers::pi / double(count));
      for (Index i = 0; i < count; ++i) {  // edges from the centre
        NodeRows slopes = NodeRows::Zero(count, 3);
        slopes.leftCols<2>().setConstant(-1.0 / double(count));
        slopes(i, 0) += 1;
        slopes((i + 1) % count, 1) += 1;
        result->push_back({{}, slopes, unit});
      }
      samples_.push_back(std::move(result));
      return samples_.back().get();
    }
    case Tetra:
      result->push_back({{0, 1, 2, 3}, {}, kSqrt2});
      break;
    case Hexahedron:
    case Voxel: {
      const auto at = [&](int i) { return type == Voxel ? kVoxelOrder[std::size_t(i)] : i; };
      for (const LocalCorner& k : kHexahedronCorners)
        result->push_back({{at(k[0]), at(k[1]), at(k[2]), at(k[3])}, {}, 1});
      NodeRows centre(8, 3);
      const std::vector<Vector3d> nodes = reference_nodes(type);
      for (Index n = 0; n < 8; ++n) centre.row(n) = (nodes[n].transpose().array() - 0.5) / 2;
      result->push_back({{}, centre, 1});
      break;
    }
    case Wedge:
      add_corners(kWedgeCorners, kTwoOverSqrt3);
      break;
    case Pyramid:
      add_corners(kPyramidCorners, kSqrt2);
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
          result->push_back({{}, slopes, 1 / sine});
          slopes.col(1) = slopes.col(2);
        }
      });
      samples_.push_back(std::move(result));
      return samples_.back().get();
    }
    default: {
      const Element& element = element_of(type);
      const double unit = unit_of(element.shape);
      for (const NodeRows& slopes : element.samples) {
        result->push_back({{}, slopes, unit});
        if (element.shape != Shape::Triangle && element.shape != Shape::Prism) continue;
        NodeRows turned = slopes;  // the other two corners of the triangle that the tangents span
        for (int corner = 1; corner < 3; ++corner) {
          const VectorXd first = turned.col(0);
          turned.col(0) = turned.col(1) - first;
          turned.col(1) = -first;
          result->push_back({{}, turned, unit});
        }
      }
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
        result->push_back({{}, slopes, unit});
      }
    }
  }
  known = std::move(result);
  return known.get();
}

ShapeEnergy::ShapeEnergy(const Mesh& mesh, const Points& reference, Points positions,
                         FreeNodes free, std::vector<Index> cells, const Orientation& orientation,
                         const FiniteVolumes* volumes)
    : mesh_(mesh),
      positions_(std::move(positions)),
      free_(std::move(free)),
      normal_(plane_normal(mesh, reference, positions_)),
      samples_(kTypes),
      mid_nodes_(kTypes) {
  const bool is_shell = dimension(mesh) == 2 && normal_.isZero(0);
  sort_in_space(mesh, positions_, cells);
  // Tetrahedra are evaluated in lanes of their own.
  std::ranges::stable_partition(cells, [&](Index c) { return is_tetrahedron(mesh.types[c]); });
  if (volumes) faces_.emplace(*volumes, cells, positions_);
  cells_.reserve(cells.size());
  for (const Index c : cells) {
    const auto type = static_cast<std::size_t>(mesh.types[c]);
    const auto follows = [&](Index node) { return free_.follows(node); };
    const bool has_followers = free_.has_followers() && std::ranges::any_of(mesh.cell(c), follows);
    if (has_followers && mid_nodes_[type].empty()) mid_nodes_[type] = mid_nodes_of(mesh.types[c]);
    cells_.push_back({c, samples_of(c), is_shell ? 1.0 : double(orientation[type]),
                      has_followers ? &mid_nodes_[type] : nullptr});
  }
  if (const SlidingNodes* sliding = free_.sliding()) {
    spacing_.emplace(sliding->segments, free_);
    if (spacing_->is_empty()) spacing_.reset();
    // In plane meshes and shells triangles are the cells themselves.
    if (dimension(mesh) == 3 && !volumes) triangles_.emplace(sliding->triangles, reference, free_);
    if (triangles_ && triangles_->is_empty()) triangles_.reset();
  }
  number_nodes();
  make_chunks();
  std::vector<Index> first_cell;
  for (const Chunk& chunk : chunks_) first_cell.push_back(chunk.first);
  first_cell.push_back(std::ssize(cells_));
  sums_.emplace(first_cell, first_node_, nodes_, ids_, free_);
  const Points had = of_nodes(reference);
  placed_ = of_nodes(positions_);
  if (is_shell) set_normals(had);
  parallel_for(std::ssize(chunks_), 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) set_references(chunks_[i], had);
  });
  if (is_shell) set_normals(placed_);
}

// Numbers the nodes as the cells come, so that those of a few cells lie near to each other.
void ShapeEnergy::number_nodes() {
  std::vector<Index> number(mesh_.node_count(), -1);
  Index nodes = 0;
  for (const Cell& cell : cells_) nodes += std::ssize(mesh_.cell(cell.id));
  nodes_.reserve(nodes);
  first_node_.reserve(cells_.size() + 1);
  first_node_.push_back(0);
  for (const Cell& cell : cells_) {
    for (const Index node : mesh_.cell(cell.id)) {
      if (number[node] < 0) {
        number[node] = std::ssize(ids_);
        ids_.push_back(node);
      }
      nodes_.push_back(static_cast<std::uint32_t>(number[node]));
    }
    first_node_.push_back(std::ssize(nodes_));
  }
}

Points ShapeEnergy::of_nodes(const Points& points) const {
  Points result(std::ssize(ids_), 3);
  parallel_for(std::ssize(ids_), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) result.row(i) = points.row(ids_[i]);
  });
  return result;
}

// Of each cell, by the areas that its samples span.
void ShapeEnergy::set_normals(const Points& points) {
  normals_.resize(cells_.size());
  parallel_for(std::ssize(cells_), kGrain, [&](Index begin, Index end) {
    NodeRows x;
    for (Index i = begin; i < end; ++i) {
      Vector3d sum = Vector3d::Zero();
      read_nodes(i, points, x);
      for (const Sample& sample : *cells_[i].samples) {
        const Matrix3d j = edges(sample, x, Vector3d::Zero());
        sum += j.col(0).cross(j.col(1));
      }
      normals_[i] = sum.normalized();
    }
  });
}

void ShapeEnergy::make_chunks() {
  const Index count = std::ssize(cells_);
  Index references = 0;
  for (Index first = 0; first < count;) {
    Chunk chunk{first, first, references, is_tetrahedron(mesh_.types[cells_[first].id])};
    Index samples = 0;
    while (chunk.last < std::min(first + kGrain, count) &&
           is_tetrahedron(mesh_.types[cells_[chunk.last].id]) == chunk.are_tetrahedra)
      samples += std::ssize(*cells_[chunk.last++].samples);
    chunks_.push_back(chunk);
    references += (samples + kSampleLanes - 1) / kSampleLanes;
    first = chunk.last;
  }
  references_ = std::make_unique_for_overwrite<SampleReference[]>(references);
}

// Calls visit(group, lanes, edges) for the samples of a chunk, as many at a time as there are
// lanes.
template <class Visit>
void ShapeEnergy::for_each_group(const Chunk& chunk, const Points& points, Visit&& visit) const {
  std::array<Lane, kSampleLanes> lanes;
  alignas(SampleReference) SampleLane edges[9] = {};
  Index reference = chunk.first_reference;
  std::size_t count = 0;
  NodeRows x;
  for (Index i = chunk.first; i < chunk.last; ++i) {
    const std::uint32_t* const nodes = &nodes_[first_node_[i]];
    bool has_read = false;
    for (const Sample& sample : *cells_[i].samples) {
      if (sample.is_corner_of_solid()) {
        const double* const from = points.data() + 3 * std::ptrdiff_t(nodes[sample.corner[0]]);
        for (int k = 0; k < 3; ++k) {
          const double* const to = points.data() + 3 * std::ptrdiff_t(nodes[sample.corner[k + 1]]);
          for (int axis = 0; axis < 3; ++axis) edges[3 * k + axis][count] = to[axis] - from[axis];
        }
      } else {
        if (!std::exchange(has_read, true)) read_nodes(i, points, x);
        const Matrix3d j = ShapeEnergy::edges(sample, x, normals_.empty() ? normal_ : normals_[i]);
        for (int k = 0; k < 9; ++k) edges[k][count] = j.data()[k];
      }
      lanes[count++] = {i, &sample};
      if (count < lanes.size()) continue;
      visit(reference++, std::span(lanes), edges);
      count = 0;
    }
  }
  if (count > 0) visit(reference, std::span(lanes).first(count), edges);
}

void ShapeEnergy::set_references(const Chunk& chunk, const Points& points) {
  for_each_group(chunk, points, [&](Index group, std::span<const Lane> lanes, const auto& edges) {
    SampleReference& reference = references_[group] = {};
    for (std::size_t l = 0; l < lanes.size(); ++l) {
      const Cell& cell = cells_[lanes[l].cell];
      reference.unit[l] = cell.sign * lanes[l].sample->unit;
      reference.weight[l] = 1 / double(cell.samples->size());
      const Matrix3d j = lane_of(edges, l);
      const double det = cell.sign * j.determinant();
      if (faces_) {
        const double had =
            reference.unit[l] * j.determinant() / longest_edges(j, chunk.are_tetrahedra);
        reference.unit[l] /= kShapeWeight * std::max(had, kLeastShape);
      }
      if (!(det > kFlat * j.colwise().norm().prod())) continue;
      const Matrix3d inverse = j.inverse(), metric = inverse * inverse.transpose();
      reference.inverse_determinant[l] = 1 / det;
      int k = 0;
      for (int column = 0; column < 3; ++column)
        for (int row = column; row < 3; ++row) reference.metric[k++][l] = metric(row, column);
    }
  });
}

template <class Visit>
double ShapeEnergy::largest(const Points& points, Visit&& visit) {
  std::vector<double> of_chunks(chunks_.size(), 1);
  parallel_for(std::ssize(chunks_), 1, [&](Index begin, Index end) {
    for (Index c = begin; c < end; ++c) {
      if (chunks_[c].are_tetrahedra) continue;
      for_each_group(chunks_[c], points, [&](Index group, auto lanes, const auto& edges) {
        for (std::size_t l = 0; l < lanes.size(); ++l)
          of_chunks[c] = std::max(of_chunks[c], visit(references_[group], l, lane_of(edges, l)));
      });
    }
  });
  return std::ranges::max(of_chunks);
}

void ShapeEnergy::keep_flatness(const Points& plain) {
  if (faces_ || chunks_.empty()) return;
  const double worst = largest(placed_, [](const auto& reference, auto l, const Matrix3d& j) {
    const double quality = reference.unit[l] * j.determinant() / j.colwise().norm().prod();
    return quality > 0 ? 1 / quality : kInfinite;
  });
  if (!std::isfinite(worst)) return;
  const Points at_plain = of_nodes(plain);
  const double flattest = largest(at_plain, flatness);
  largest(at_plain, [&](SampleReference& reference, auto l, const Matrix3d& j) {
    const double free = std::max(kFreelyFlat, std::sqrt(flatness(reference, l, j) * flattest));
    const double scale = std::cbrt(worst * worst / free);
    for (SampleLane& entry : reference.metric) entry[l] *= scale;
    return 1.0;
  });
  keeps_flatness_ = true;
}

void ShapeEnergy::read_nodes(Index cell, const Points& points, NodeRows& x) const {
  const Index first = first_node_[cell], count = first_node_[cell + 1] - first;
  if (x.rows() != count) x.resize(count, 3);
  for (Index n = 0; n < count; ++n) x.row(n) = points.row(nodes_[first + n]);
}

Matrix3d ShapeEnergy::edges(const Sample& sample, const NodeRows& x, const Vector3d& normal) {
  Matrix3d j;
  if (sample.slopes.size() > 0) {
    j.noalias() = x.transpose().lazyProduct(sample.slopes);
    if (!normal.isZero(0)) {
      j.leftCols<2>() -= normal * (normal.transpose() * j.leftCols<2>());
      j.col(2) = normal;
    }
    return j;
  }
  const auto& k = sample.corner;
  for (int i = 0; i < 3; ++i)
    j.col(i) = k[i + 1] < 0 ? normal : Vector3d((x.row(k[i + 1]) - x.row(k[0])).transpose());
  return j;
}

inline void ShapeEnergy::add_slopes(const Sample& sample, const Matrix3d& by_edges,
                                    double* of_nodes) {
  if (sample.slopes.size() > 0) {
    Eigen::Map<Points>(of_nodes, sample.slopes.rows(), 3).noalias() +=
        sample.slopes.lazyProduct(by_edges.transpose());
    return;
  }
  const int count = edge_count(sample);
  for (int k = 0; k < count; ++k)
    for (int axis = 0; axis < 3; ++axis) {
      of_nodes[3 * sample.corner[k + 1] + axis] += by_edges(axis, k);
      of_nodes[3 * sample.corner[0] + axis] -= by_edges(axis, k);
    }
}

// Calls visit(lane, energy, slopes by the edges, edges) for each sample of a chunk, while all are
// positive; returns their energy.
template <class Visit>
double ShapeEnergy::evaluate(const Chunk& chunk, Visit&& visit) const {
  const bool has_half_power = faces_ || (keeps_flatness_ && !chunk.are_tetrahedra);
  const SamplePowers powers{squarings_, has_half_power ? squarings_ : squarings_ - 1};
  double sum = 0;
  SampleEnergy result;
  for_each_group(chunk, placed_, [&](Index group, std::span<const Lane> lanes, const auto& edges) {
    evaluate_samples(edges, references_[group], chunk.are_tetrahedra, powers, result);
    for (std::size_t l = 0; l < lanes.size(); ++l) {
      sum += result.energy[l];
      visit(lanes[l], result.energy[l], lane_of(result.by_edges, l), lane_of(edges, l));
    }
  });
  return sum;
}

// Adds the slopes of the faces to those of the cells, and calls visit(cell, energy, stiffness) for
// each cell; returns the energy.
template <class Visit>
double ShapeEnergy::add_faces(const Chunk& chunk, Points& slopes, Visit&& visit) const {
  FaceEnergy::Work work;
  VectorXd stiffness;
  double sum = 0;
  for (Index i = chunk.first; i < chunk.last; ++i) {
    const double energy = faces_->add(i, squarings_ + 1 + kFaceDoublings, 1.0 / (2 << squarings_),
                                      of_cell(slopes, chunk, i), stiffness, work);
    sum += energy;
    visit(i, energy, stiffness);
  }
  return sum;
}

void ShapeEnergy::give_to_corners(const Chunk& chunk, Points& slopes) const {
  if (!free_.has_followers()) return;
  for (Index i = chunk.first; i < chunk.last; ++i) {
    if (!cells_[i].mid_nodes) continue;
    const auto nodes = mesh_.cell(cells_[i].id);
    auto own = of_cell(slopes, chunk, i);
    for (const LocalMidNode& mid : *cells_[i].mid_nodes) {
      const Index node = nodes[std::size_t(mid.node)];
      if (!free_.follows(node)) continue;
      const Eigen::RowVector3d share =
          free_.by_corners(node, own.row(mid.node)) / double(mid.corners.size());
      for (const int corner : mid.corners) own.row(corner) += share;
      own.row(mid.node).setZero();
    }
  }
}

double ShapeEnergy::operator()(const VectorXd& x, VectorXd& gradient) {
  free_.move(x, positions_);
  placed_ = of_nodes(positions_);
  evaluated_ = x;
  if (faces_) faces_->place(positions_);
  std::vector<double> energies(chunks_.size());
  std::atomic<bool> is_infinite = false;  // then nobody needs the rest
  parallel_for(std::ssize(chunks_), 1, [&](Index begin, Index end) {
    Points slopes;
    for (Index c = begin; c < end && !is_infinite; ++c) {
      const Chunk& chunk = chunks_[c];
      slopes.setZero(first_node_[chunk.last] - first_node_[chunk.first], 3);
      energies[c] =
          evaluate(chunk, [&](const Lane& lane, double, const Matrix3d& by_edges, const auto&) {
            add_slopes(*lane.sample, by_edges, of_cell(slopes, chunk, lane.cell).data());
          });
      if (faces_ && std::isfinite(energies[c]))
        energies[c] += add_faces(chunk, slopes, [](auto&&...) {});
      if (!std::isfinite(energies[c])) is_infinite = true;
      give_to_corners(chunk, slopes);
      sums_->set_slopes(c, first_node_[chunk.first], slopes);
    }
  });
  sum_ = 0;
  for (const double energy : energies) sum_ += energy;
  if (spacing_) sum_ += spacing_->evaluate(positions_, squarings_ + 1);
  if (triangles_) sum_ += triangles_->evaluate(positions_, squarings_ + 1);
  if (!std::isfinite(sum_)) {
    gradient.setZero(x.size());
    return kInfinite;
  }
  sums_->gather_slopes(free_, 1 / sum_, gradient);
  if (spacing_) spacing_->add_slopes(free_, 1 / sum_, gradient);
  if (triangles_) triangles_->add_slopes(free_, 1 / sum_, gradient);
  return std::log(sum_) / (2 << squarings_);
}

const Points& ShapeEnergy::positions_at(const VectorXd& x) {
  free_.move(x, positions_);
  evaluated_.resize(0);
  return positions_;
}

const HessianGuess& ShapeEnergy::guess_hessian(const VectorXd& x) {
  if (VectorXd gradient; evaluated_.size() == 0 || evaluated_ != x) (*this)(x, gradient);
  const double p = 2 << squarings_;
  sums_->reserve_blocks();
  parallel_for(std::ssize(chunks_), 1, [&](Index begin, Index end) {
    Points slopes;
    for (Index c = begin; c < end; ++c) {
      const Chunk& chunk = chunks_[c];
      std::vector<double> energies(chunk.last - chunk.first);
      slopes.setZero(first_node_[chunk.last] - first_node_[chunk.first], 3);
      sums_->clear_blocks(c);
      evaluate(
          chunk, [&](const Lane& lane, double energy, const Matrix3d& by_edges, const Matrix3d& j) {
            const Sample& sample = *lane.sample;
            const Cell& cell = cells_[lane.cell];
            energies[lane.cell - chunk.first] += energy;
            add_slopes(sample, by_edges, of_cell(slopes, chunk, lane.cell).data());
            const Matrix3d inverse = j.inverse();  // rows: how the edges' coordinates vary in space
            const auto add = [&](Index node, double square) {
              ChunkSums::Block& block = sums_->block(first_node_[lane.cell] + node);
              block.stiffness += energy / sum_ * square;
              block.inverse_square_reach =
                  std::max(block.inverse_square_reach, square / (kReach * kReach));
            };
            if (sample.slopes.size() > 0) {
              const NodeRows of = sample.slopes * inverse;
              for (Index node = 0; node < of.rows(); ++node) add(node, of.row(node).squaredNorm());
              if (!cell.mid_nodes) return;
              // The square of a mean is at most the mean of the squares.
              const auto nodes = mesh_.cell(cell.id);
              for (const LocalMidNode& mid : *cell.mid_nodes)
                if (free_.follows(nodes[std::size_t(mid.node)]))
                  for (const int corner : mid.corners)
                    add(corner, of.row(mid.node).squaredNorm() / double(mid.corners.size()));
              return;
            }
            const int edges = edge_count(sample);
            for (int i = 0; i < edges; ++i) add(sample.corner[i + 1], inverse.row(i).squaredNorm());
            add(sample.corner[0], inverse.topRows(edges).colwise().sum().squaredNorm());
          });
      if (faces_)
        add_faces(chunk, slopes, [&](Index i, double energy, const VectorXd& stiffness) {
          energies[i - chunk.first] += energy;
          for (Index node = 0; node < stiffness.size(); ++node)
            sums_->block(first_node_[i] + node).stiffness +=
                (1 << kFaceDoublings) / sum_ * stiffness[node];
        });
      give_to_corners(chunk, slopes);
      for (Index i = chunk.first; i < chunk.last; ++i) {
        const double energy = energies[i - chunk.first];
        if (!(energy > 0)) continue;
        const auto own = of_cell(slopes, chunk, i);
        for (Index node = 0; node < own.rows(); ++node)
          sums_->block(first_node_[i] + node).add_square(p / (energy * sum_), own.row(node));
      }
    }
  });
  std::vector<NodeBlocks::Block> blocks = sums_->gather_blocks(free_);
  if (spacing_) spacing_->add_blocks(free_, sum_, blocks);
  if (triangles_) triangles_->add_blocks(free_, sum_, blocks);
  hessian_.emplace(free_, blocks);
  return *hessian_;
}

}  // namespace cadmorph
