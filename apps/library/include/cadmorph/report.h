#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "api.h"
#include "types.h"

namespace cadmorph::CADMORPH_V1 {

/// Counts of a CAD model.
struct CadFigures {
  std::string name, unit;
  Index faces = 0, edges = 0, vertices = 0;
  int solids = 0;
  double diagonal_mm = 0;
};

/// How many nodes of the mesh lie where.
struct NodeFigures {
  Index vertex = 0, edge = 0, face = 0;  ///< on the CAD
  Index amid_straight_edges = 0;         ///< of second order, off the CAD
  Index unmatched = 0;                   ///< on the outside, on no CAD face
  Index interior = 0;
  Index loose = 0;  ///< of no element of the mesh's dimension
};

/// How the mesh is.
struct QualityFigures {
  double max_distance_mm = 0, mean_distance_mm = 0;  ///< of surface nodes to the CAD
  double min_scaled_jacobian = 0, mean_scaled_jacobian = 0;
  Index worst_cell = -1;     ///< of the smallest scaled Jacobian
  Index inverted_cells = 0;  ///< with a corner Jacobian that is not positive
  Index invalid_cells = 0;   ///< that fail the exact test
  double max_non_orthogonality_deg = 0, mean_non_orthogonality_deg = 0;
  double max_skewness = 0, max_aspect_ratio = 0;
  double min_volume = 0;  ///< in the mesh's unit, cubed
};

/// What a named part of the mesh did.
struct GroupFigures {
  std::string name, kind;
  Index nodes = 0;
  double max_displacement_mm = 0;
};

/// Why a result was refused, and where to look.
struct Diagnosis {
  Index bad_cells = 0;          ///< inverted, or below the quality asked for
  Index bad_cells_in_base = 0;  ///< of these: inverted in the input already
  Index worst_cell = -1;
  Eigen::Vector3d location = Eigen::Vector3d::Zero();  ///< of it, in the mesh's unit
  int nearest_face = 0;                                ///< base CAD face near most, from 1; 0: none
  double first_inversion = 1;  ///< share of the change at which the first element inverts
  std::vector<std::string> advice;
};

struct PhaseTime {
  std::string name;
  double seconds = 0;
};

enum class Outcome { Done, Inverted, PoorQuality };

/// All figures of a morph; before it, in Morpher::report, those of the base alone.
struct Report {
  Outcome outcome = Outcome::Done;
  CadFigures base_cad, variant_cad;
  std::string mesh_name, mesh_format;
  Index node_count = 0, cell_count = 0;
  double mesh_unit_mm = 1;  ///< millimetres per mesh unit
  bool is_unit_detected = true;
  NodeFigures nodes;
  std::vector<GroupFigures> groups;
  std::string matched_by;       ///< what decided which face became which
  double least_confidence = 1;  ///< of any pair of faces, in (0, 1]
  QualityFigures before, after;
  double max_displacement_mm = 0, max_surface_displacement_mm = 0;
  std::string solver;  ///< the one used; empty for another method than Rbf
  Index centres = 0;   ///< of the radial basis functions
  int iterations = 0;
  int steps = 0;             ///< the change was split into
  Index repaired_cells = 0;  ///< inverted before optimisation, and not after
  Index raised_cells = 0;    ///< below MorphOptions::improve_below before, and not after
  bool is_raised = false;    ///< elements that lost shape were raised (Quality::Best)
  /// Positions are a linear function of the surface's: one step, no repair, nothing raised. Nodes
  /// of no solid or shell don't count.
  bool is_plain = true;
  std::optional<Diagnosis> diagnosis;  ///< of a result that was refused
  std::vector<std::string> warnings;
  std::vector<std::string> notes;  ///< what took an effort and asks for nothing
  std::vector<PhaseTime> phases;
  double seconds = 0;  ///< of all phases; of a morph with the base's
  int threads = 1;
  std::string blas_kernel;  ///< OpenBLAS's code; empty for another BLAS
};

}  // namespace cadmorph::CADMORPH_V1
