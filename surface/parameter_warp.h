#pragma once

#include <optional>

#include "surface/curve_map.h"
#include "surface/curve_maps.h"
#include "surface/face_border.h"
#include "surface/face_domain.h"

namespace cadmorph {

/// What carries the nodes of a face along.
struct FaceMotion {
  const CurveMaps& curve_maps;
  Points joints_before, joints_after;  ///< positions of the domain's joints, millimetres
  const FaceBorder& border;
};

/// Parameters (N x 2) of the places on a face nearest to `targets` (N x 3).
Parameters project_points(const CadModel& model, FaceId face, const Points& targets);

/// How the parameters of a base face's wires and joints go over to those of its variant (Sieger et
/// al. 2013, sect. 4): a linear part, with period, sense and start of closed directions, and
/// displacements beyond it. Parameters are N x 2, in the faces' own units.
class ParameterWarp {
 public:
  /// Keeps references to all three.
  ParameterWarp(const FaceDomain& domain, const ModelPair& pair, const FaceMotion& motion)
      : domain_(domain),
        pair_(pair),
        motion_(motion),
        base_(pair.base.faces()[domain.face()]),
        variant_id_(pair.match.faces[domain.face()]),
        variant_(pair.variant.faces()[variant_id_]) {}

  /// Displacement of the samples beyond the linear pre-map; empty when parameters don't correspond.
  std::optional<Parameters> sample_values();

  /// Displacement of the border's nodes beyond the linear pre-map and `carried`, which the warp
  /// gives them; nothing where one has no image.
  std::optional<Parameters> border_misfit(const Parameters& carried) const;

  /// u' = offset + stretch u before the displacement.
  Eigen::Vector2d linear(const Eigen::Vector2d& uv) const {
    return offset_ + stretch_.cwiseProduct(uv);
  }

 private:
  struct OnCoedge {
    CoedgeId coedge;
    double t;
  };

  bool map_samples();
  std::optional<OnCoedge> image_of(const FaceDomain::Sample& sample) const;
  bool map_pole(std::size_t begin, std::size_t end);
  bool runs_backward(CoedgeId pole, CoedgeId variant_pole) const;
  std::optional<Eigen::Vector2d> nearest_image(const Eigen::Vector2d& uv) const;
  bool is_pole(std::size_t i) const;
  bool is_on_curve(std::size_t i) const { return domain_.samples()[i].joint < 0 && !is_pole(i); }
  void find_linear_part();
  void carry_range(int a);
  double sense(int a) const;
  void unwrap();
  void unwrap_direction(int a);
  template <class Carry>
  double phase(int a, const Carry& carry, double rough) const;

  const FaceDomain& domain_;
  const ModelPair& pair_;
  const FaceMotion& motion_;
  const CadFace& base_;
  FaceId variant_id_;
  const CadFace& variant_;
  Eigen::Vector2d stretch_ = Eigen::Vector2d::Ones(), offset_ = Eigen::Vector2d::Zero();
  Parameters image_, values_;
};

}  // namespace cadmorph
