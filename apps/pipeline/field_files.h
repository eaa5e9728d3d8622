#pragma once

#include "apps/pipeline/morph_files.h"

namespace cadmorph {

/// What a field file holds.
struct FieldFigures {
  std::filesystem::path file;
  std::string base_cad, variant_cad, mesh;  ///< as named when it was made
  double mesh_unit_mm = 1;                  ///< millimetres per unit of its coordinates
  Index centres = 0;                        ///< of one step
  int steps = 0;
};

struct FieldReport {
  PipelineReport morph;  ///< `written` is the field file; empty when the result was refused
  FieldFigures field;
};

/// Morphs as morph_files does, without repair by optimisation, and writes the deformation field to
/// `files.output`, or nothing when elements stay inverted or poor: the outcome and diagnosis tell.
/// Throws as morph_files does; InvalidInputError for what record_deformation refuses.
FieldReport field_files(const MorphFiles& files, const PipelineOptions& options = {});

struct ApplyReport {
  FieldFigures field;
  std::filesystem::path mesh, written;  ///< written: the output, or the failed mesh
  std::string mesh_format;
  std::vector<std::string> remarks;  ///< on the mesh file
  CoordinateRounding rounding;       ///< see PipelineReport
  Index nodes = 0, cells = 0;
  double mesh_unit_mm = 1;      ///< millimetres per unit of the mesh, given or detected
  Index at_nodes = 0;           ///< at the place of a node whose position the CAD gave
  Index outside = 0;            ///< outside the box of the mesh the field was made for
  double max_displacement = 0;  ///< in the mesh's unit
  QualityReport quality_before, quality_after;
  ValidityReport validity_before, validity_after;
  std::vector<Index> bad_cells;  ///< inverted ones: the result is refused when there are any
  double seconds = 0;
};

/// Moves the points of a mesh file by a field file and writes it to `output`; with inverted cells
/// to `<stem>.failed.<ext>` beside, the cells marked in cadmorph_bad. `mesh_unit_mm` is the length
/// of the mesh's unit in millimetres; 0: the field's, unless the mesh has the field's box in
/// another of mm, cm, m, inch and foot. Throws IoError or InvalidInputError for an input,
/// OutputError for the output.
ApplyReport apply_files(const std::filesystem::path& field, const std::filesystem::path& mesh,
                        const std::filesystem::path& output, double mesh_unit_mm = 0);

}  // namespace cadmorph
