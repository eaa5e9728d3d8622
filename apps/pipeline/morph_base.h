#pragma once

#include "apps/pipeline/base_side.h"

namespace cadmorph {

/// What a MorphJob keeps: all that depends on the base CAD and the base mesh alone.
struct MorphBase : BaseSide {
  /// See MorphJob.
  MorphBase(std::shared_ptr<const CadModel> cad, std::shared_ptr<const MeshFile> file,
            PipelineOptions options, Points start);

  const Mesh& mesh() const { return moved ? *moved : mesh_file->mesh(); }

  /// Of a position for each boundary node: those of the prescribed nodes alone.
  Points prescribed(const Points& surface_positions) const;

  /// Of a position for each prescribed node: those of all boundary nodes, the others at the base.
  /// Throws InvalidInputError on a wrong number.
  Points on_boundary(const Points& prescribed_positions) const;

  /// A flag a mesh node: prescribed, or of a cell whose node order is wrong, so that no repair
  /// takes to that.
  std::vector<char> fixed_nodes() const;

  /// The way of the prescribed nodes to `prescribed_positions`, which must outlive it: where faces
  /// turn, the surface follows them.
  SurfacePath path(const Points& prescribed_positions) const;

  PipelineOptions options;
  std::shared_ptr<const CadModel> cad;
  std::shared_ptr<const MeshFile> mesh_file;
  std::vector<Index> misordered;  ///< see misordered_cells
  std::optional<Mesh> moved;      ///< the file's mesh where the job starts elsewhere
  PipelineReport report;          ///< of the base side

 private:
  void set_start(Points start);
  void fill_report();
  void warn_of_inverted();
};

CadFigures figures_of(const CadModel& cad);

void set_quality(MeshFigures& figures, const QualityReport& quality, const ValidityReport& validity,
                 const QualityChecks& checks);

/// Names the file in an error about the mesh, which knows no file.
template <class Call>
auto about_file(const std::filesystem::path& file, Call&& call) {
  try {
    return call();
  } catch (const InvalidInputError& error) {
    throw InvalidInputError(file.string() + ": " + error.what());
  }
}

}  // namespace cadmorph
