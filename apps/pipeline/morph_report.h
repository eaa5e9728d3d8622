#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/pipeline/diagnosis.h"
#include "apps/pipeline/phase_clock.h"
#include "cad/topology_match.h"
#include "core/layer_heights.h"
#include "core/mesh_file.h"
#include "core/quality_checks.h"
#include "volume/best_mesh.h"
#include "volume/morph_method.h"
#include "volume/stepping.h"
#include "volume/untangle.h"

namespace cadmorph {

/// Counts of a CAD model.
struct CadFigures {
  std::filesystem::path file;
  std::string unit;  ///< named in the file
  Index faces = 0, edges = 0, vertices = 0;
  int solids = 0;
  double diagonal = 0;  ///< millimetres
};

/// Below this scaled Jacobian solvers converge badly.
inline constexpr double kPoor = 0.1;

/// How the nodes and elements of a mesh are.
struct MeshFigures {
  double max_distance = 0;  ///< of surface nodes to the CAD, millimetres
  double mean_distance = 0;
  double min_scaled_jacobian = 0;
  double mean_scaled_jacobian = 0;
  double worst_twentieth = 0;  ///< mean scaled Jacobian of the worst 5 % of the cells
  Index poor = 0;              ///< cells below kPoor
  Index worst_cell = -1;       ///< of the smallest scaled Jacobian
  Index inverted = 0;          ///< cells with a corner Jacobian that is not positive
  Index invalid = 0;           ///< cells that fail the exact validity test
  QualityChecks checks;        ///< as OpenFOAM's checkMesh states them
};

/// What a named part of the mesh did (see Mesh::groups).
struct GroupFigures {
  std::string name, kind;
  Index nodes = 0;
  double max_displacement = 0;  ///< millimetres
};

/// What raising poor elements came to.
struct ImproveReport {
  double below = 0;                       ///< scaled Jacobian asked for
  Index poor_before = 0, poor_after = 0;  ///< cells below
  double min_before = 0, min_after = 0;
  Index slid_nodes = 0;  ///< surface nodes that slid on the CAD
};

enum class CacheUse { None, Used, Written, NotWritten };

/// What came of PipelineOptions::cache.
struct CacheReport {
  std::filesystem::path file = {};
  CacheUse use = CacheUse::None;
  std::string remark = {};  ///< why there was no use of the file, or none written; else empty
};

enum class Outcome { Done, Inverted, PoorQuality };

/// One morph of a series, onto one CAD model, from the mesh of the morph before.
struct LegReport {
  CadFigures cad;          ///< the model it leads to
  std::string matched_by;  ///< see TopologyMatch::how
  MeshFigures after;
  SteppingReport stepping;
  std::optional<UntangleReport> untangling;
  double seconds = 0;
};

/// What PipelineOptions::keep_layers came to.
struct KeptLayers {
  Index columns = 0;  ///< of nodes, on as many nodes of the surface
  Index kept = 0;     ///< that have their old heights, all of their nodes
  Index partly = 0;   ///< some of their nodes, or a part of the way to these heights
  double seconds = 0;
};

/// The two CAD models and their match.
struct CadReport {
  CadFigures base, variant;
  std::string matched_by;       ///< see TopologyMatch::how
  double least_confidence = 1;  ///< of any face pair
  Similarity alignment;         ///< base to variant
};

/// The mesh as it was read, and where its nodes lie on the base CAD.
struct MeshReport {
  std::filesystem::path file;
  std::string format;                ///< "SU2"
  std::vector<std::string> remarks;  ///< see MeshFile::remarks
  Index nodes = 0, cells = 0;
  Index other_cells = 0;  ///< of lower dimension than the mesh: boundary patches, beams, points
  bool has_solids = true;
  double unit_mm = 1;            ///< millimetres per mesh unit
  bool is_unit_detected = true;  ///< not given by the user
  Index vertex_nodes = 0, edge_nodes = 0, face_nodes = 0, unmatched_nodes = 0, interior_nodes = 0;
  Index amid_nodes = 0;              ///< in the middle of straight edges, off the CAD
  Index loose_nodes = 0;             ///< of no volume element nor shell: see carry_loose_nodes
  std::vector<GroupFigures> groups;  ///< in the file's order
};

/// What the run was told, what it cost and what it wrote.
struct RunReport {
  CacheReport cache = {};
  std::vector<std::string> warnings;
  std::vector<std::string> notes;  ///< what took an effort and asks for nothing
  std::vector<PhaseTime> phases;
  double seconds = 0;      ///< sum of the phases: from the trip's start to its end
  double peak_memory = 0;  ///< bytes, of the process so far
  int threads = 1;
  std::string blas_kernel;        ///< OpenBLAS core name; empty for another BLAS
  std::filesystem::path written;  ///< the mesh written: the output, or the failed one
  CoordinateRounding rounding;    ///< of its coordinates, to the digits that its format holds
};

/// All figures of one trip. For a series of morphs: those of the whole where they are of the input
/// or the output, those of the last morph where they tell how it went.
struct PipelineReport {
  Outcome outcome = Outcome::Done;
  CadReport cad;
  MeshReport mesh;
  RunReport run;
  MeshFigures before, after;
  double max_displacement = 0;          ///< millimetres
  double max_surface_displacement = 0;  ///< millimetres, of prescribed nodes
  LayerFigures layers;
  std::optional<KeptLayers> kept_layers;  ///< none where it was not asked for
  MorphMethod method = MorphMethod::Rbf;
  Kernel kernel;
  RbfReport solver;
  SteppingReport stepping;
  std::optional<UntangleReport> untangling;
  Index followed_nodes = 0;  ///< of the surface, that slid with what moves beside them
  std::optional<BestMeshReport> best_mesh;  ///< none where it was not looked for
  std::optional<ImproveReport> improving;
  bool can_repair = true;              ///< see PipelineOptions
  double min_asked = 0;                ///< PipelineOptions::min_scaled_jacobian, or 0
  std::optional<Diagnosis> diagnosis;  ///< of a result that was refused
  std::vector<LegReport> legs;         ///< all of a series of morphs; else empty
};

CadFigures figures_of(const CadModel& cad);

void set_quality(MeshFigures& figures, const QualityReport& quality, const ValidityReport& validity,
                 const QualityChecks& checks);

}  // namespace cadmorph
