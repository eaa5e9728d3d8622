#include "cad/face_sampler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace cadmorph {
namespace {

using Eigen::Vector2d;

struct Grid {
  int nu, nv;
};

constexpr int kMinCurved = 5;    // rows of a curved face: the least that tell of its form
constexpr double kNudge = 1e-3;  // of a row: far above the gap of two pcurves, far below the row
// Bound the memory of faces whose lines are far longer where they run fastest than on the mean, and
// of needles: 4e6 samples take 180 MB.
constexpr int kMaxPerDirection = 50'000;
constexpr double kMaxOnFace = 4e6;

struct Lengths {
  Vector2d largest;  // of the iso-parametric lines at their greatest speed, millimetres
  double area;
};

Lengths measure(const CadModel& model, FaceId face) {
  const CadFace& f = model.faces()[face];
  constexpr int n = 5;  // in each direction: lengths need be known roughly only, for a spacing
  Lengths lengths{Vector2d::Zero(), 0};
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const Vector2d at((i + 0.5) / n, (j + 0.5) / n);
      const SurfacePoint s = model.evaluate(face, f.lower + at.cwiseProduct(f.upper - f.lower));
      lengths.largest = lengths.largest.cwiseMax(Vector2d(s.du.norm(), s.dv.norm()));
      lengths.area += s.du.norm() * s.dv.norm() / (n * n);
    }
  lengths.largest = lengths.largest.cwiseProduct(f.upper - f.lower);
  lengths.area *= (f.upper - f.lower).prod();
  return lengths;
}

Grid grid_for(const CadModel& model, FaceId face, const Vector2d& lengths, double spacing) {
  const int least = model.faces()[face].type == SurfaceType::Plane ? 2 : kMinCurved;
  const double coarser = std::max(1.0, std::sqrt(lengths.prod() / kMaxOnFace) / spacing);
  const auto count = [&](double length) {
    const double wanted = std::ceil(length / (coarser * spacing));
    return static_cast<int>(std::clamp<double>(wanted, least, kMaxPerDirection));
  };
  return {count(lengths[0]), count(lengths[1])};
}

// Returns the largest distance along the wires.
double add_wire_samples(const CadModel& model, FaceId face, double spacing,
                        std::vector<Vector2d>& uv) {
  double widest = 0;
  for (const auto& wire : model.faces()[face].wires)
    for (const CoedgeId c : wire) {
      const CadEdge& edge = model.edges()[model.coedges()[c].edge];
      const int n = std::clamp(static_cast<int>(edge.length / spacing), 2, kMaxPerDirection);
      for (int i = 0; i <= n; ++i)
        uv.push_back(model.pcurve(c, edge.first + (edge.last - edge.first) * i / n));
      widest = std::max(widest, edge.length / n);
    }
  return widest;
}

std::vector<Vector2d> inside_grid(const CadModel& model, FaceId face, const Grid& grid) {
  const CadFace& f = model.faces()[face];
  const Vector2d size = f.upper - f.lower;
  std::vector<Vector2d> uv;
  for (int j = 0; j < grid.nv; ++j) {
    const double v = f.lower[1] + (j + 0.5) / grid.nv * size[1];
    std::vector<double> crossings = model.crossings(face, v);
    if (crossings.size() % 2 == 1)  // through the gap that two pcurves leave at a vertex
      crossings = model.crossings(face, v + kNudge / grid.nv * size[1]);
    for (int i = 0; i < grid.nu; ++i) {
      const double u = f.lower[0] + (i + 0.5) / grid.nu * size[0];
      const auto left = std::lower_bound(crossings.begin(), crossings.end(), u) - crossings.begin();
      if (crossings.empty() || left % 2 == 1) uv.emplace_back(u, v);
    }
  }
  return uv;
}

}  // namespace

std::vector<Vector2d> sample_domain(const CadModel& model, FaceId face, int n) {
  return inside_grid(model, face, {n, n});
}

FaceSamples sample_faces(const CadModel& model, Index count) {
  const std::size_t faces = model.faces().size();
  IdVector<FaceId, Lengths> lengths(faces);
  double area = 0;
  for (const FaceId f : lengths.ids()) {
    lengths[f] = measure(model, f);
    area += lengths[f].area;
  }
  FaceSamples samples;
  samples.spacing = std::sqrt(area / static_cast<double>(std::max<Index>(count, 1)));
  samples.face_spacing.resize(faces);
  IdVector<FaceId, std::vector<Vector2d>> uv(faces);
  parallel_for(static_cast<Index>(faces), 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const FaceId f(i);
      const Grid grid = grid_for(model, f, lengths[f].largest, samples.spacing);
      uv[f] = inside_grid(model, f, grid);
      samples.face_spacing[f] = std::max(
          {lengths[f].largest[0] / grid.nu, lengths[f].largest[1] / grid.nv,
           add_wire_samples(model, f, samples.spacing, uv[f]), std::numeric_limits<double>::min()});
    }
  });
  for (const FaceId f : lengths.ids()) {
    samples.uv.insert(samples.uv.end(), uv[f].begin(), uv[f].end());
    samples.face.insert(samples.face.end(), uv[f].size(), f);
  }
  samples.points.resize(static_cast<Index>(samples.uv.size()), 3);
  parallel_for(samples.points.rows(), 1024, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      samples.points.row(i) = model.evaluate(samples.face[i], samples.uv[i]).point;
  });
  return samples;
}

}  // namespace cadmorph
