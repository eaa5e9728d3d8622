#pragma once

#include <TopoDS_Shape.hxx>
#include <algorithm>
#include <catch2/catch.hpp>

#include "cad/face_sampler.h"
#include "cad_variants.h"
#include "mapped_geometry.h"
#include "surface/curve_maps.h"
#include "surface/face_map.h"

namespace cadmorph::testing {

inline constexpr int kFaceSamples = 16;  // of a curve

/// Two models and what became of what.
struct Change {
  Change(const TopoDS_Shape& from, const TopoDS_Shape& to)
      : base(to_model(from)),
        variant(to_model(to)),
        match(match_topology(base, variant)),
        prediction(base, variant, match),
        pair{base, variant, match, prediction},
        maps(map_curves(pair)) {
    REQUIRE_FALSE(match.joins_edges);
  }
  Change(const Change&) = delete;

  CadModel base, variant;
  TopologyMatch match;
  MotionPrediction prediction;
  ModelPair pair;
  CurveMaps maps;
};

/// One face of a change.
struct ChangedFace {
  ChangedFace(const Change& c, FaceId f, const Parameters& at_joints = Parameters(0, 2))
      : change(c),
        face(f),
        domain(c.base, f, kFaceSamples, at_joints),
        joints(points_at(at_joints)),
        moved_joints(joints) {}

  Points points_at(const Parameters& uv) const {
    Points points(uv.rows(), 3);
    for (Index i = 0; i < uv.rows(); ++i)
      points.row(i) = change.base.evaluate(face, uv.row(i)).point;
    return points;
  }

  /// Parameters of places within the wires.
  Parameters inside(int n = 7) const {
    const auto all = sample_domain(change.base, face, n);
    Parameters uv(std::ssize(all), 2);
    for (Index i = 0; i < uv.rows(); ++i) uv.row(i) = all[static_cast<std::size_t>(i)];
    return uv;
  }

  FaceMotion motion() const { return {change.maps, joints, moved_joints, border}; }

  FaceMapResult map(const Parameters& uv, int steps = 1) const {
    return map_face(domain, change.pair, motion(), uv, points_at(uv), steps);
  }

  Points images(const FaceMapResult& mapped) const {
    Points points(mapped.uv.rows(), 3);
    for (Index i = 0; i < points.rows(); ++i)
      points.row(i) = change.variant.evaluate(change.match.faces[face], mapped.uv.row(i)).point;
    return points;
  }

  const Change& change;
  FaceId face;
  FaceDomain domain;
  Points joints, moved_joints;
  FaceBorder border;
};

inline double largest_error(const Points& from, const Points& to, const PointMap& expected) {
  double most = 0;
  for (Index i = 0; i < from.rows(); ++i)
    most = std::max(most, (Eigen::Vector3d(to.row(i)) - expected(from.row(i))).norm());
  return most;
}

/// How far the map of all faces is from the expected one, at most.

}  // namespace cadmorph::testing
