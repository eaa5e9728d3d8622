#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/pipeline/diagnosis.h"
#include "apps/pipeline/output_file.h"
#include "apps/pipeline/phase_clock.h"
#include "cad/topology_match.h"
#include "core/layer_heights.h"
#include "core/mesh_file.h"
#include "core/quality_checks.h"
#include "core/validity.h"
#include "surface/surface_morph.h"
#include "volume/best_mesh.h"
#include "volume/deformation_field.h"
#include "volume/stepping.h"
#include "volume/untangle.h"
#include "volume/volume_morph.h"

namespace cadmorph {

/// When to repair inverted elements by optimisation.
enum class UntangleMode {
  Auto,  ///< when elements are inverted after all steps
  Never,
  Always,  ///< also to raise elements that became poor
};

/// What is done for the elements of a valid result.
enum class QualityMode {
  Best,  ///< where they lost, the worst are raised (find_best_mesh)
  Fast,  ///< nothing: the positions are those of the volume morph
};

struct PipelineOptions {
  SurfaceMorphOptions surface;
  VolumeMorphOptions volume;
  SteppingOptions stepping;
  UntangleMode untangle = UntangleMode::Auto;
  /// Has no meaning, as Fast, where `untangle` is Never or `can_repair` false.
  QualityMode quality = QualityMode::Best;
  /// Raises elements whose scaled Jacobian is below by optimisation.
  std::optional<double> improve_below;
  /// The result is refused when any cell's scaled Jacobian is below.
  std::optional<double> min_scaled_jacobian;
  /// False: the result is to be a function of the position, as a field is. Repair by optimisation,
  /// which moves single nodes, is then not advised.
  bool can_repair = true;
  /// Base and variant face numbers (1-based) given by the user.
  std::vector<std::pair<int, int>> face_map;
  /// File to keep the base side in for other runs; empty: none (docs/batch.md).
  std::filesystem::path cache = {};
  /// Called through the whole trip.
  Progress progress;
  /// Called before the work goes on with a warning that is not for later; the report has it, too.
  std::function<void(const std::string& warning)> notice = {};
};

/// Counts of a CAD model.
struct CadFigures {
  std::filesystem::path file;
  std::string unit;  ///< named in the file
  Index faces = 0, edges = 0, vertices = 0;
  int solids = 0;
  double diagonal = 0;  ///< millimetres
};

/// How the nodes and elements of a mesh are.
struct MeshFigures {
  double max_distance = 0;  ///< of surface nodes to the CAD, millimetres
  double mean_distance = 0;
  double min_scaled_jacobian = 0;
  double mean_scaled_jacobian = 0;
  Index worst_cell = -1;  ///< of the smallest scaled Jacobian
  Index inverted = 0;     ///< cells with a corner Jacobian that is not positive
  Index invalid = 0;      ///< cells that fail the exact validity test
  QualityChecks checks;   ///< as OpenFOAM's checkMesh states them
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

/// All figures of one trip. For a series of morphs: those of the whole where they are of the input
/// or the output, those of the last morph where they tell how it went.
struct PipelineReport {
  Outcome outcome = Outcome::Done;
  CadFigures base_cad, variant_cad;
  std::filesystem::path mesh_file;
  Index nodes = 0, cells = 0;
  Index vertex_nodes = 0, edge_nodes = 0, face_nodes = 0, unmatched_nodes = 0, interior_nodes = 0;
  Index amid_nodes = 0;              ///< in the middle of straight edges, off the CAD
  std::string mesh_format;           ///< "SU2"
  std::vector<std::string> remarks;  ///< on the mesh file: see MeshFile::remarks
  std::vector<GroupFigures> groups;  ///< of the mesh, in the file's order
  bool has_solids = true;
  Index loose_nodes =
      0;  ///< of no volume element (of a mesh of shells: no shell): follow the field
  Index other_cells = 0;    ///< of lower dimension than the mesh: boundary patches, beams, points
  double mesh_unit_mm = 1;  ///< millimetres per mesh unit
  bool is_unit_detected = true;  ///< not given by the user
  std::string matched_by;        ///< see TopologyMatch::how
  double least_confidence = 1;   ///< of any face pair
  Similarity alignment;          ///< base to variant
  MeshFigures before, after;
  double max_displacement = 0;          ///< millimetres
  double max_surface_displacement = 0;  ///< millimetres, of prescribed nodes
  LayerFigures layers;
  MorphMethod method = MorphMethod::Rbf;
  Kernel kernel;
  RbfReport solver;
  SteppingReport stepping;
  std::optional<UntangleReport> untangling;
  std::optional<BestMeshReport> best_mesh;  ///< none where it was not looked for
  std::optional<ImproveReport> improving;
  bool can_repair = true;              ///< see PipelineOptions
  double min_asked = 0;                ///< PipelineOptions::min_scaled_jacobian, or 0
  std::optional<Diagnosis> diagnosis;  ///< of a result that was refused
  std::vector<LegReport> legs;         ///< all of a series of morphs; else empty
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

/// A mesh file written.
struct WrittenMesh {
  std::filesystem::path path = {};
  std::filesystem::path diagnostics = {};  ///< the file beside with its arrays; may be none
  CoordinateRounding rounding = {};
};

/// A morphed mesh.
struct MorphResult {
  std::optional<CadModel> variant;  ///< the model matched: the one given, or its faces merged
  bool is_base_merged = false;      ///< see MorphJob::of
  Points positions;                 ///< N x 3, in the mesh's unit
  QualityReport quality;
  ValidityReport validity;
  TopologyMatch match;
  SurfaceMorphResult surface;  ///< before any node slid
  Points surface_positions;    ///< those prescribed, in the order of VolumeMorph::surface_nodes
  PipelineReport report;
};

/// One of several morphs: its result, or why there is none.
struct MorphAttempt {
  MorphResult result;
  std::exception_ptr error;
};

struct MorphBase;

class MorphDerivative;

/// The old side of a morph: everything that depends on the base CAD and the base mesh alone, to be
/// used for any number of variants.
class MorphJob {
 public:
  /// Extracts the surface of `mesh`, associates it with the base CAD, measures the mesh and sets up
  /// the volume warp. `start`, if not empty, are the node positions (N x 3) on the base CAD, in
  /// place of the file's: the result of an earlier morph. Throws InvalidInputError on a wrong size
  /// of it, and what extract_boundary, SurfaceMorph and VolumeMorph throw.
  MorphJob(std::shared_ptr<const CadModel> base, std::shared_ptr<const MeshFile> mesh,
           PipelineOptions options = {}, Points start = {});
  ~MorphJob();
  MorphJob(MorphJob&&) noexcept;

  /// Morphs the mesh onto `variant`. Faces that one exporter cut and the other did not are merged
  /// (see merge_cut_faces), with a warning, unless a face map is given. Inverted or poor elements
  /// are told in the report's outcome and diagnosis, not thrown. Throws TopologyError when the
  /// models do not correspond, SolverError when a system can't be solved.
  MorphResult morph(const CadModel& variant) const;

  /// Morphs onto several variants at once, which share what their volume morphs have in common (see
  /// VolumeMorph::morph_each). Each result is to the last bit the one of `morph`, but for its
  /// times, which are shares of the whole; an error of one leaves the others alone.
  std::vector<MorphAttempt> morph_each(const std::vector<CadModel>& variants) const;

  /// Morphs the surface alone: of the result only the match, the surface and its positions, and in
  /// the report what tells of them. Throws as morph does.
  MorphResult morph_surface(const CadModel& variant) const;

  /// Positions of the surface nodes (m x 3, rows as VolumeMorph::surface_nodes) with those on
  /// planes that slide where the others take them. Throws InvalidInputError on a wrong size.
  Points slide(const Points& surface_positions) const;

  /// The derivative of the volume morph at these positions, with `is_sliding` through the planes
  /// that slide. Throws what VolumeMorph::derivative throws.
  MorphDerivative derivative(const Points& surface_positions, bool is_sliding = false) const;

  /// Writes a result: to `output` when it is good, else, with the inverted cells marked in the cell
  /// array cadmorph_bad, to `<stem>.failed.<ext>` beside. `has_diagnostics` adds the arrays
  /// cadmorph_displacement, _cad_dimension (0 vertex, 1 edge, 2 face, 3 interior, -1 on no CAD
  /// entity), _cad_entity (1-based as in `cadmorph match`; 0: none there), _uv and
  /// _scaled_jacobian; the
  /// displacement from the file's positions, the entities of this job's base CAD.
  /// A format that has no arrays keeps them in `<stem>.diagnostics.vtu` beside. Throws OutputError;
  /// InvalidInputError where the format's numbers are too coarse (see MeshFile::write).
  WrittenMesh write(const MorphResult& result, const std::filesystem::path& output,
                    bool has_diagnostics = false) const;

  /// The job whose base CAD and association a result tells of: this one, or one that it keeps of
  /// the base CAD with its cut faces merged.
  const MorphJob& of(const MorphResult& result) const;

  const CadModel& base() const;
  const VolumeMorph& volume() const;
  /// The deformation field of a result: what moves any other points as it moved the nodes, repair
  /// by optimisation apart, which has no field. Throws what record_deformation throws.
  DeformationTerms deformation(const MorphResult& result) const;

  /// The mesh at the positions the job starts from.
  const Mesh& mesh() const;
  const Boundary& boundary() const;
  const Association& association() const;
  const CellNeighbours& neighbours() const;
  const Orientation& orientation() const;
  const QualityReport& base_quality() const;
  /// What came of the file to keep the base side in.
  const CacheReport& cache() const;
  /// The figures of the base side.
  const PipelineReport& base_report() const;

 private:
  struct Merged;

  void morph_merged(const CadModel& variant, MorphAttempt& refused) const;
  const MorphJob& merged_job(const CadModel& merged_base) const;

  std::unique_ptr<const MorphBase> base_;
  std::unique_ptr<Merged> merged_;
};

/// Largest memory of this process so far, bytes.
double peak_memory();

/// Time since this process was started, seconds.
double process_seconds();

struct MorphFiles {
  std::filesystem::path base_cad, variant_cad, mesh, output;
  bool has_diagnostics = false;
  std::vector<std::filesystem::path> via = {};  ///< CAD models on the way, in order

  /// Reads a CAD model as read_step does; empty: read_step. Called by one thread at a time.
  std::function<CadModel(const std::filesystem::path& path)> read_cad = {};

  /// Called with the result before it is written: for what shows more than the figures.
  std::function<void(const MorphJob& job, const MorphResult& result)> on_result = {};

  /// Called with the result of each morph of the series, unless it was refused.
  std::function<void(const MorphJob& job, const MorphResult& result)> on_leg = {};

  /// Writes something else than the mesh to `output`; returns what was written, if anything.
  std::function<WrittenMesh(const MorphJob& job, const MorphResult& result)> write = {};

  /// All that is read.
  std::vector<std::filesystem::path> inputs() const;
};

/// The whole trip: reads the STEP files and the mesh, morphs, writes. With CAD models on the way:
/// morphs from each to the next, the mesh associated anew with the model it has reached, its unit
/// kept; a leg that leaves inverted elements ends the trip and is refused; quality asked for is
/// asked of the last alone. Throws IoError, CadError or InvalidInputError for an input (a face map
/// has no meaning in a series), OutputError for the output, and what MorphJob throws.
PipelineReport morph_files(const MorphFiles& files, const PipelineOptions& options = {});

}  // namespace cadmorph
