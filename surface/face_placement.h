#pragma once

#include <map>
#include <string>
#include <vector>

#include "surface/curve_maps.h"
#include "surface/face_map.h"
#include "surface/placement.h"

namespace cadmorph {

/// What came of placing the nodes of all faces.
struct PlacedFaces {
  std::vector<FacetId> folded;  ///< facets that nothing unfolded, by face
  /// What faces took that would fold else, and the faces.
  std::map<std::string, std::vector<std::string>> remedies;
};

/// Places the nodes within faces by the parameter warp of each (`map_face`), and where that folds
/// facets by the way that folds the fewest.
class FacePlacement {
 public:
  /// Keeps references to all three.
  FacePlacement(const ModelPair& pair, const CurveMaps& maps, const BasePlacement& nodes)
      : pair_(pair), maps_(maps), nodes_(nodes) {}

  /// `placed` has the places of corners, edges and crossings. Parallel.
  PlacedFaces place_all(Placement& placed) const;

 private:
  FaceMotion motion_of(const FaceNodes& nodes, const Placement& placed) const;
  void place(FaceId face, FaceMapResult& mapped, Placement& placed) const;
  void unfold(FaceId face, const FaceMapResult& mapped, Placement& placed,
              PlacedFaces& result) const;

  const ModelPair& pair_;
  const CurveMaps& maps_;
  const BasePlacement& nodes_;
};

}  // namespace cadmorph
