#include "volume/face_energy.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using namespace finite_volume;
using Work = FaceEnergy::Work;
using Slopes = FaceEnergy::FaceSlopes;

constexpr Index kGrain = 256;  // cells a task, as in shape_energy.cpp

// (2 / (1 + c))^p of a cosine with p = 2^doublings, and its derivative.
struct Term {
  double energy, slope;
};

double power(double x, int doublings) {
  for (int i = 0; i < doublings; ++i) x *= x;
  return x;
}

Term term(double cosine, int doublings) {
  const double energy = power(2 / (1 + cosine), doublings);
  return {energy, -(1 << doublings) * energy / (1 + cosine)};
}

// What a face is measured by: `d` leads from the cell's centre to the other's, or upright to a face
// on the outside.
struct Passage {
  Vector3d to_face, d;
  bool is_outside;
};

double add_orthogonality(const Vector3d& area, const Vector3d& d, int doublings, Slopes& slopes) {
  const double area_length = area.norm(), length = d.norm(), both = area_length * length;
  if (both == 0) return 0;
  const double cosine = area.dot(d) / both;
  const auto [energy, slope] = term(cosine, doublings);
  slopes.by_area += slope * (d / both - cosine / (area_length * area_length) * area);
  slopes.by_cell_centre -= slope * (area / both - cosine / (length * length) * d);
  return energy;
}

// The skewness of finite_volume::squared_skewness; the largest of what it compares is held.
double add_skewness(Corners corners, const FaceShape& face, const Passage& passage, int doublings,
                    Slopes& slopes) {
  const auto& [t, d, is_outside] = passage;
  const Vector3d& s = face.area;
  const double along = s.dot(d);
  if (along == 0) return power(2, doublings);
  const double share = s.dot(t) / along;
  const Vector3d offset = t - share * d;
  const double length = offset.squaredNorm();
  if (length == 0) return 1;
  double reach = 0;
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (const double r = std::abs(offset.dot(corners[i] - face.centre)); r > reach) {
      reach = r;
      slopes.corner = static_cast<int>(i);
    }
  const double least = is_outside ? kOutside : kInside;
  const double by_distance = least * least * d.squaredNorm(), by_size = reach * reach / length;
  const bool is_distance = by_distance >= by_size;
  const double squared = length / std::max(by_distance, by_size);
  const double k = kSkewnessSlope * kSkewnessSlope, root = std::sqrt(1 + k * squared);
  const auto [energy, slope] = term(1 / root, doublings);
  const double by_squared = slope * -0.5 * k / (root * root * root);

  Vector3d by_offset, by_d = Vector3d::Zero();
  if (is_distance) {
    by_offset = by_squared * 2 / by_distance * offset;
    by_d = -by_squared * squared / by_distance * 2 * least * least * d;
    slopes.corner = -1;
  } else {  // length^2 / reach^2
    const Vector3d arm = corners[slopes.corner] - face.centre;
    const double by_reach = -2 * by_squared * squared / reach * (offset.dot(arm) > 0 ? 1 : -1);
    by_offset = by_squared * 4 * squared / length * offset + by_reach * arm;
    slopes.by_corner = by_reach * offset;
    slopes.by_face_centre -= slopes.by_corner;
  }
  const double by_share = -by_offset.dot(d);
  const Vector3d by_t = by_offset + by_share / along * s;
  slopes.by_area += by_share / along * offset;
  slopes.by_face_centre += by_t;
  slopes.by_cell_centre -= by_t;
  by_d -= share * (by_offset + by_share / along * s);
  if (!is_outside) {
    slopes.by_cell_centre -= by_d;
    return energy;
  }
  // d = s (s . t) / |s|^2
  const double square = s.squaredNorm(), upright = s.dot(by_d) / square;
  const Vector3d through = upright * s;
  slopes.by_face_centre += through;
  slopes.by_cell_centre -= through;
  slopes.by_area += s.dot(t) / square * (by_d - 2 * upright * s) + upright * t;
  return energy;
}

// The positions of a face's corners.
Corners place_corners(int first, int count, Work& work) {
  work.placed.clear();
  for (int k = first; k < first + count; ++k) work.placed.push_back(work.at[work.corners[k]]);
  return work.placed;
}

// Adds what the derivatives by a face's centre and area say of its corners.
void add_to_corners(Corners x, const FaceShape& shape, const Vector3d& by_centre,
                    const Vector3d& by_area, std::span<Vector3d> by) {
  if (x.size() == 3) {
    const Vector3d u = x[1] - x[0], v = x[2] - x[0];
    const Vector3d by_u = v.cross(by_area) / 2, by_v = by_area.cross(u) / 2;
    by[0] += by_centre / 3 - by_u - by_v;
    by[1] += by_centre / 3 + by_u;
    by[2] += by_centre / 3 + by_v;
    return;
  }
  const std::size_t n = x.size();
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& corner : x) middle += corner;
  middle /= double(n);
  double total = 0;
  for (std::size_t i = 0; i < n; ++i)
    total += (x[i] - middle).cross(x[(i + 1) % n] - middle).norm() / 2;
  Vector3d by_middle = Vector3d::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = (i + 1) % n;
    const Vector3d u = x[i] - middle, v = x[j] - middle, part = u.cross(v) / 2;
    const double size = part.norm();
    Vector3d by_part = by_area;
    if (total > 0 && size > 0) {
      const Vector3d by_moment = by_centre / total;
      by_part += by_moment.dot((x[i] + x[j] + middle) / 3 - shape.centre) / size * part;
      by[i] += size / 3 * by_moment;
      by[j] += size / 3 * by_moment;
      by_middle += size / 3 * by_moment;
    }
    const Vector3d by_u = v.cross(by_part) / 2, by_v = by_part.cross(u) / 2;
    by[i] += by_u;
    by[j] += by_v;
    by_middle -= by_u + by_v;
  }
  for (Vector3d& row : by) row += by_middle / double(n);
}

// Adds what the derivative by a cell's centre says of its faces.
void add_to_faces(double sign, const Vector3d& by_centre, std::vector<Work::Face>& faces) {
  Vector3d guess = Vector3d::Zero();
  for (const Work::Face& face : faces) guess += face.shape.centre;
  guess /= double(faces.size());
  double volume = 0;
  Vector3d moment = Vector3d::Zero();
  for (const Work::Face& face : faces) {
    const double part = sign * face.shape.area.dot(face.shape.centre - guess) / 3;
    volume += part;
    moment += part * (0.75 * face.shape.centre + 0.25 * guess);
  }
  if (volume == 0) return;
  const Vector3d by_moment = by_centre / volume;
  const double by_volume = -by_moment.dot(moment / volume);
  Vector3d by_guess = Vector3d::Zero();
  for (Work::Face& face : faces) {
    const auto& [centre, area] = face.shape;
    const double part = sign * area.dot(centre - guess) / 3;
    const double by_part = by_moment.dot(0.75 * centre + 0.25 * guess) + by_volume;
    const Vector3d by_arm = by_part * sign / 3 * area;
    face.by_area += by_part * sign / 3 * (centre - guess);
    face.by_centre += 0.75 * part * by_moment + by_arm;
    by_guess += 0.25 * part * by_moment - by_arm;
  }
  for (Work::Face& face : faces) face.by_centre += by_guess / double(faces.size());
}

}  // namespace

FaceEnergy::FaceEnergy(const FiniteVolumes& volumes, const std::vector<Index>& cells,
                       const Points& positions)
    : volumes_(volumes),
      mesh_(volumes.mesh()),
      cells_(cells),
      is_own_(mesh_.cell_count(), 0),
      centres_(mesh_.cell_count()) {
  points_ = &volumes.place(positions, scratch_);
  for (const Index c : cells_) is_own_[c] = 1;
  PlacedCells placed(volumes, *points_);
  std::vector<FaceShape> faces;
  std::vector<char> is_known = is_own_;
  for (const Index c : cells_)
    for (Index f = volumes.neighbours().offsets[c]; f < volumes.neighbours().offsets[c + 1]; ++f)
      if (const Index other = volumes.neighbours().neighbour[f];
          other >= 0 && !std::exchange(is_known[other], 1))
        centres_[other] = cell_shape(placed, other, faces).centre;
}

void FaceEnergy::place(const Points& positions) {
  points_ = &volumes_.place(positions, scratch_);
  const PlacedCells placed(volumes_, *points_);
  parallel_for(std::ssize(cells_), kGrain, [&](Index begin, Index end) {
    PlacedCells own = placed;
    std::vector<FaceShape> faces;
    for (Index i = begin; i < end; ++i)
      centres_[cells_[i]] = cell_shape(own, cells_[i], faces).centre;
  });
}

// The faces that have three corners.
void FaceEnergy::read_faces(Index c, Work& work) const {
  const auto cell = mesh_.cell(c);
  work.faces.clear();
  work.corners.clear();
  auto other = volumes_.neighbours().of(c).begin();
  const auto add_face = [&](int count) {
    if (const int first = int(work.corners.size()) - count; *other != c)
      work.faces.push_back({first, count, *other, face_shape(place_corners(first, count, work)),
                            Vector3d::Zero(), Vector3d::Zero()});
    ++other;
  };
  if (mesh_.types[c] == CellType::Polyhedron)
    for_each_polyhedron_face(mesh_, c, [&](std::span<const Index> nodes) {
      for (const Index node : nodes)
        work.corners.push_back(int(std::ranges::find(cell, node) - cell.begin()));
      add_face(int(nodes.size()));
    });
  else
    for (const LocalFace& face : local_faces(mesh_.types[c])) {
      const int count = int(corner_count(face.type, face.count));
      for (int i = 0; i < count; ++i) work.corners.push_back(face.nodes[std::size_t(i)]);
      add_face(count);
    }
}

// Of the face of an own cell, its share where the other one is such, too.
FaceEnergy::FaceSlopes FaceEnergy::measure(Index c, Index other, std::span<const Vector3d> corners,
                                           const FaceShape& shape, int doublings) const {
  const double sign = volumes_.orientation()[static_cast<std::size_t>(mesh_.types[c])];
  const Vector3d area = sign * shape.area;
  FaceSlopes result;
  const double square = area.squaredNorm();
  if (square == 0) return result;
  const bool is_outside = other < 0;
  const Vector3d to_face = shape.centre - centres_[c];
  const Vector3d d = is_outside ? Vector3d(area.dot(to_face) / square * area)
                                : Vector3d(centres_[other] - centres_[c]);
  if (!is_outside) result.energy = add_orthogonality(area, d, doublings, result);
  result.energy +=
      add_skewness(corners, {shape.centre, area}, {to_face, d, is_outside}, doublings, result);
  const double share = !is_outside && is_own_[other] ? 0.5 : 1;
  result.energy *= share;
  result.by_area *= sign * share;
  result.by_face_centre *= share;
  result.by_corner *= share;  // by that of the other cell's centre: there
  result.stiffness = result.energy / std::sqrt(square);
  return result;
}

double FaceEnergy::measure_tetra(Index c, int doublings, Work& work) const {
  auto other = volumes_.neighbours().of(c).begin();
  double energy = 0;
  Vector3d by_centre = Vector3d::Zero();
  for (const auto& face : Tetra::kFaces) {
    const std::array<Vector3d, 3> x{work.at[face[0]], work.at[face[1]], work.at[face[2]]};
    const FaceSlopes slopes = measure(c, *other++, x, face_shape(x), doublings);
    energy += slopes.energy;
    by_centre += slopes.by_cell_centre;
    const Vector3d by_u = (x[2] - x[0]).cross(slopes.by_area) / 2,
                   by_v = slopes.by_area.cross(x[1] - x[0]) / 2;
    work.by[face[0]] -= by_u + by_v;
    work.by[face[1]] += by_u;
    work.by[face[2]] += by_v;
    for (const int node : face) {
      work.by[node] += slopes.by_face_centre / 3;
      work.stiffness[node] += slopes.stiffness;
    }
    if (slopes.corner >= 0) work.by[face[slopes.corner]] += slopes.by_corner;
  }
  for (Vector3d& by : work.by) by += by_centre / 4;
  return energy;
}

double FaceEnergy::measure_cell(Index c, int doublings, Work& work) const {
  read_faces(c, work);
  double energy = 0;
  Vector3d by_centre = Vector3d::Zero();
  for (Work::Face& face : work.faces) {
    const Corners x = place_corners(face.first, face.count, work);
    const FaceSlopes slopes = measure(c, face.other, x, face.shape, doublings);
    energy += slopes.energy;
    by_centre += slopes.by_cell_centre;
    face.by_centre = slopes.by_face_centre;
    face.by_area = slopes.by_area;
    if (slopes.corner >= 0) work.by[work.corners[face.first + slopes.corner]] += slopes.by_corner;
    for (int k = 0; k < face.count; ++k)
      work.stiffness[work.corners[face.first + k]] += slopes.stiffness;
  }
  const double sign = volumes_.orientation()[static_cast<std::size_t>(mesh_.types[c])];
  add_to_faces(sign, by_centre, work.faces);
  for (const Work::Face& face : work.faces) {
    const Corners x = place_corners(face.first, face.count, work);
    work.by_placed.assign(x.size(), Vector3d::Zero());
    add_to_corners(x, face.shape, face.by_centre, face.by_area, work.by_placed);
    for (int k = 0; k < face.count; ++k) work.by[work.corners[face.first + k]] += work.by_placed[k];
  }
  return energy;
}

double FaceEnergy::add(Index i, int doublings, double factor, Rows slopes,
                       Eigen::VectorXd& stiffness, Work& work) const {
  const Index c = cells_[i];
  const auto nodes = mesh_.cell(c);
  work.at.resize(nodes.size());
  for (std::size_t n = 0; n < nodes.size(); ++n) work.at[n] = points_->row(nodes[n]).transpose();
  work.by.assign(nodes.size(), Vector3d::Zero());
  work.stiffness.assign(nodes.size(), 0);
  const bool is_tetra = is_proper_tetra(PlacedCells(volumes_, *points_), c);
  const double energy =
      is_tetra ? measure_tetra(c, doublings, work) : measure_cell(c, doublings, work);
  const auto base_nodes = volumes_.base().cell(c);
  stiffness.setZero(std::ssize(base_nodes));
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    Index row = Index(n);
    if (volumes_.is_layer()) {
      row = std::ranges::find(base_nodes, volumes_.base_node(nodes[n])) - base_nodes.begin();
      work.by[n] -= volumes_.normal() * volumes_.normal().dot(work.by[n]);
    }
    slopes.row(row) += factor * work.by[n].transpose();
    stiffness[row] += work.stiffness[n];
  }
  return energy;
}

}  // namespace cadmorph
