#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "apps/pipeline/morph_report.h"
#include "apps/pipeline/options.h"
#include "core/archive.h"
#include "core/boundary.h"
#include "core/errors.h"
#include "core/layer_heights.h"
#include "core/mesh_file.h"

namespace cadmorph {

/// All that depends on the base CAD and the base mesh alone, to be used for any number of variants.
struct BaseSide {
  /// Extracts the surface of the mesh, associates it with the CAD, measures the mesh and sets up
  /// the volume warp; announces its phases. `start`, if not empty, are the node positions (N x 3)
  /// on the CAD, in place of the file's. Throws InvalidInputError on a wrong size of it, and what
  /// extract_boundary, SurfaceMorph and VolumeMorph throw.
  BaseSide(std::shared_ptr<const CadModel> cad, std::shared_ptr<const MeshFile> mesh_file,
           PipelineOptions options, Points start = {});

  /// The mesh at the positions that the morph starts from.
  const Mesh& mesh() const { return own ? *own : mesh_file->mesh(); }
  const Association& association() const { return surface->association(); }

  /// Of a position for each boundary node: those of the prescribed nodes alone.
  Points prescribed(const Points& surface_positions) const;

  /// Of a position for each prescribed node: those of all boundary nodes, the others at the base.
  /// Throws InvalidInputError on a wrong number.
  Points on_boundary(const Points& prescribed_positions) const;

  /// Whether prescribed nodes at these positions are where they are at the base, to 1e-9 of the
  /// mesh's size: what the digits of a STEP file and a projection leave is no motion.
  bool is_at_base(const Points& prescribed_positions) const;

  /// A flag a mesh node: prescribed, or of a cell whose node order is wrong, so that no repair
  /// takes to that.
  std::vector<char> fixed_nodes() const;

  /// A flag a mesh node: on the base CAD, or amid straight edges of it.
  std::vector<char> on_cad() const;

  /// Layers that grow little keep their heights where that is asked for; as what graded meshes lose
  /// by the motion they are like all other cells.
  LayerGrowth layer_growth() const {
    return options.keep_layers ? LayerGrowth::Any : LayerGrowth::Marked;
  }
  /// nodes_of_layers of the mesh, found when first asked for; of any number of threads at once.
  const LayerNodes& layer_nodes() const;

  /// The same with straight cells, and facets, at the corners of second-order ones: no cell has the
  /// nodes amid edges then, and nothing prescribes them. Set up when first asked for; of any number
  /// of threads at once.
  std::shared_ptr<const BaseSide> straight() const;

  /// The way of the prescribed nodes to `prescribed_positions`, which must outlive it: where faces
  /// turn, the surface follows them.
  SurfacePath path(const Points& prescribed_positions) const;

  PipelineOptions options;
  std::shared_ptr<const CadModel> cad;
  std::shared_ptr<const MeshFile> mesh_file;
  /// The file's mesh where the morph starts elsewhere, or where the cells of a plane mesh do not
  /// all go round the same way (in_one_sense), or where blocks were joined.
  std::optional<Mesh> own;
  bool starts_elsewhere = false;  ///< than at the file's positions

  Boundary boundary;
  std::shared_ptr<const SurfaceMorph> surface;
  std::optional<VolumeMorph> volume;
  std::vector<RowId> rows;  ///< of nodes whose positions the surface prescribes
  Orientation orientation;
  CellNeighbours neighbours;
  QualityReport quality;
  ValidityReport validity;
  QualityChecks checks;
  std::vector<Index> misordered;      ///< see misordered_cells
  std::vector<FaceId> crossed_faces;  ///< see UnnamedInterfaces
  PipelineReport report;              ///< the figures of the base side

 private:
  friend class BaseCache;

  struct Straight {};
  BaseSide(const BaseSide& curved, Straight);

  void set_up(PhaseClock& clock);
  void store(OutputArchive& archive) const;
  void restore(InputArchive& archive);

  void set_start(Points start);
  void take_unnamed_interfaces(const std::vector<char>& parts);
  void drop_block_borders();
  void set_regions(std::vector<int> regions);
  void associate_anew();
  void set_up_volume();
  void measure();
  void fill_report();
  void warn_of_inverted();
  void warn_of_crossed();

  mutable std::once_flag has_layer_nodes_;
  mutable LayerNodes layer_nodes_;
  mutable std::once_flag has_straight_;
  mutable std::shared_ptr<const BaseSide> straight_;
};

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
