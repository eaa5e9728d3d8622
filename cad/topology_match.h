#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cad/brep.h"

namespace cadmorph {

/// x -> scale * rotation * x + translation.
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const {
    return scale * (rotation * x) + translation;
  }
};

/// What speaks against a match, in bits: what makes a term twice as large costs as much as what
/// makes another one so. See match_cost.
struct MatchCost {
  double deformation = 0;  ///< distance of the entities after the best similarity
  double neighbours = 0;   ///< distance of each from where its neighbours' motion puts it
  double lengths = 0;      ///< curves that change their lengths otherwise than the others do
  double parameters = 0;   ///< places of edges in their faces' parameters that are others
  double turn = 0;         ///< distance by which the part turns
  double rest = 0;         ///< faces that an exact turn takes from where one alike lies
  double passing = 0;      ///< faces that have to pass through one alike
  double order = 0;        ///< departure from the order of the files, where that tells something
  double names = 0;        ///< names that went to other faces
  double joints = 0;       ///< corners of smooth curves that count for nothing
  double sum() const {
    return deformation + neighbours + lengths + parameters + turn + rest + passing + order + names +
           joints;
  }
};

/// A match that was considered: what led to it, and its cost.
struct ConsideredMatch {
  std::string how;
  MatchCost cost;
  IdVector<FaceId, FaceId> faces = {};  ///< base face -> variant face
};

/// The variant's counterpart of every base entity. Curves and corners are those of
/// CadModel::skeleton.
struct TopologyMatch {
  IdVector<FaceId, FaceId> faces;        ///< base face -> variant face
  IdVector<CurveId, CurveId> curves;     ///< base curve -> variant curve
  IdVector<CornerId, CornerId> corners;  ///< base corner -> variant corner
  /// How sure each pair is, in (0, 1]. 1: the only possibility, or nothing else comes near; 1/2: as
  /// good as another one; less: another one lies nearer.
  IdVector<FaceId, double> face_confidence;
  IdVector<CurveId, double> curve_confidence;
  IdVector<CornerId, double> corner_confidence;
  Similarity alignment;       ///< base -> variant, best over all entities
  bool is_oriented = false;   ///< the outside of each face stays outside; else unknown, or mirrored
  bool is_congruent = false;  ///< the alignment carries one shape exactly onto the other
  bool joins_edges = false;   ///< edges were cut differently: CadModel::with_joined_edges
  std::string how;  ///< what decided: topology ("structure"), file order, position, a map file
  MatchCost cost;
  std::optional<ConsideredMatch> runner_up;  ///< the one of least cost among those not taken
};

/// What the runner-up costs more than the match taken, in bits; infinity without one.
double lead(const TopologyMatch& match);

/// "faces 1, 4", those of the base that the runner-up pairs otherwise, the first ten by their
/// numbers from 1; empty where it pairs edges alone otherwise.
std::string paired_otherwise(const TopologyMatch& match);

struct MatchOptions {
  /// Pairs given by the user: 1-based face numbers, base -> variant ("faces.csv": base,variant).
  std::vector<std::pair<int, int>> given_faces;
};

/// Finds the counterpart of each face, edge and vertex of `base` in `variant`, whatever the file
/// order: colour refinement on the graph of faces, curves and corners, remaining symmetries decided
/// by closeness after the best similarity alignment. Throws TopologyError that names the entities
/// without a partner.
TopologyMatch match_topology(const CadModel& base, const CadModel& variant,
                             const MatchOptions& options = {});

/// Two models, and what of one became what of the other.
struct MatchedModels {
  CadModel base, variant;  ///< those given, or with faces merged, or the variant's made analytic
  TopologyMatch match;
};

/// As match_topology; where one exporter cut faces that the other did not, with those faces merged:
/// in the variant, the base or both, the first of these that matches. Faces that seams of surfaces
/// of revolution cut in both are merged where the match is better for it. None are merged where
/// pairs are given, whose numbers are those of the files' faces. Where nothing of that matches,
/// slivers that the variant alone has are taken for points. Faces that are planes, cylinders,
/// cones or spheres in the base and exactly such in the variant, but written as B-splines, are
/// analytic there, too. Where joints of smooth curves turn by a little more in one of the models,
/// the variant's corners are as many as the base's.
MatchedModels match_models(const CadModel& base, const CadModel& variant,
                           const MatchOptions& options = {});

/// Reads a face map: two 1-based face numbers a line (base,variant), '#' comments, optional header.
std::vector<std::pair<int, int>> read_face_map(const std::filesystem::path& path);

}  // namespace cadmorph
