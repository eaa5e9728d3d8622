#pragma once

#include "cad/brep.h"
#include "core/kd_tree.h"

namespace cadmorph {

/// Points on the trimmed faces of a model, with their parameters.
struct FaceSamples {
  RowMatrix points;  ///< N x 3, millimetres
  std::vector<Eigen::Vector2d> uv;
  std::vector<FaceId> face;
  double spacing;                         ///< aimed at between neighbours, millimetres
  IdVector<FaceId, double> face_spacing;  ///< a face's largest, millimetres
};

/// Samples every face inside its wires and along them, about `count` points in all, at least 5 x 5
/// a curved face (Sieger et al. 2013, sect. 4). Parallel over faces.
FaceSamples sample_faces(const CadModel& model, Index count);

/// Inside samples of one face alone, about n x n.
std::vector<Eigen::Vector2d> sample_domain(const CadModel& model, FaceId face, int n);

}  // namespace cadmorph
