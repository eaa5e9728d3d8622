#pragma once

#include "cad/topology_match.h"

namespace cadmorph {

/// Position and size of a face, curve or corner, whatever its parametrisation.
struct EntityFeature {
  Eigen::Vector3d centre;  ///< area or length centroid, millimetres
  double size;             ///< square root of the area, or the length, millimetres
};

/// Features of all faces, curves and corners, in the order of EntityGraph.
std::vector<EntityFeature> entity_features(const CadModel& model);

/// Least-squares similarity of paired points, rotation proper (Umeyama 1991). Where the points
/// leave a rotation open (fewer than three, or on a line, up to the part `line` of its length) the
/// smallest one is taken.
Similarity fit_similarity(const std::vector<Eigen::Vector3d>& from,
                          const std::vector<Eigen::Vector3d>& to, double line = 1e-4);

/// Least-squares shift of paired points after a given change of scale, without a turn.
Similarity fit_shift(const std::vector<Eigen::Vector3d>& from,
                     const std::vector<Eigen::Vector3d>& to, double scale);

/// Root mean square distance of s(from) to `to`.
double residual(const Similarity& s, const std::vector<Eigen::Vector3d>& from,
                const std::vector<Eigen::Vector3d>& to);

/// Sets match.alignment and is_congruent: the identity where the two models coincide as point sets;
/// else the similarity that carries equal surface parameters onto each other, where it does so
/// exactly, but for a spin of a body of revolution about its axis (a seam that moved); else the fit
/// of corners, then of curve and face centroids, without a turn where it speaks for one by
/// accident.
void align(const CadModel& base, const CadModel& variant, TopologyMatch& match);

/// Whether corners and curves of the variant lie clearly nearer to where a mirror image of the base
/// has them than to where any similarity of it does: a mesh would be turned inside out.
bool is_mirror_image(const CadModel& base, const CadModel& variant, const TopologyMatch& match);

/// Whether an aligned match is of models that coincide: nothing moves.
bool stays(const TopologyMatch& match);

/// Whether a motion carries points of a face onto those of equal relative parameters of another.
bool carries_parameters(const Similarity& motion, const CadModel& base, FaceId face,
                        const CadModel& variant, FaceId to_face);

/// Part of the faces whose points of equal relative parameters match.alignment carries onto each
/// other: of several exact alignments of a symmetric part the one that re-exports keep.
double parameter_agreement(const CadModel& base, const CadModel& variant,
                           const TopologyMatch& match);

}  // namespace cadmorph
