#include "apps/pipeline/field_files.h"

#include <algorithm>
#include <future>
#include <iterator>

#include "cad/step_reader.h"
#include "volume/field_file.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

FieldFigures figures_of(const fs::path& file, const DeformationTerms& terms) {
  return {.file = file,
          .base_cad = terms.base_cad,
          .variant_cad = terms.variant_cad,
          .mesh = terms.mesh_file,
          .mesh_unit_mm = terms.mesh_unit_mm,
          .centres = terms.steps.front().centres.rows(),
          .steps = static_cast<int>(terms.steps.size())};
}

// Moving single nodes has no field.
PipelineOptions without_repair(PipelineOptions options) {
  options.untangle = UntangleMode::Never;
  options.improve_below.reset();
  return options;
}

// Those of `cells` that are bad in the result: invalid, or with a corner that has inverted.
std::vector<Index> bad_cells(const ApplyReport& report) {
  std::vector<Index> corners, result;
  std::ranges::set_difference(report.quality_after.inverted_cells,
                              report.quality_before.inverted_cells, std::back_inserter(corners));
  std::ranges::set_union(report.validity_after.invalid_cells, corners, std::back_inserter(result));
  return result;
}

void measure(const Mesh& mesh, const Points& moved, ApplyReport& report) {
  const Orientation orientation = detect_orientation(mesh);
  report.quality_before = measure_quality(mesh, mesh.points, orientation);
  report.quality_after = measure_quality(mesh, moved, orientation);
  report.validity_before = check_validity(mesh, mesh.points, orientation);
  report.validity_after = check_validity(mesh, moved, orientation);
  report.bad_cells = bad_cells(report);
}

fs::path write(const MeshFile& mesh, const Points& moved, const ApplyReport& report,
               const fs::path& output) {
  ExtraArrays extra;
  if (!report.bad_cells.empty()) {
    std::vector<int> is_bad(static_cast<std::size_t>(mesh.mesh().cell_count()), 0);
    for (const Index c : report.bad_cells) is_bad[c] = 1;
    extra.cell_integers["cadmorph_bad"] = std::move(is_bad);
  }
  const fs::path path = report.bad_cells.empty() ? output : failed_path(output);
  try {
    mesh.write(path, moved, extra);
  } catch (const IoError& error) {
    throw OutputError(error.what());
  }
  return path;
}

}  // namespace

FieldReport field_files(const MorphFiles& files, const PipelineOptions& options) {
  if (!files.via.empty())
    throw InvalidInputError("a field leads from one CAD model to another, without models between");
  check_output(files.output, files.inputs());
  PhaseClock clock(options.progress);
  clock.start("reading");
  check_step_file(files.variant_cad);
  auto mesh_to_come =
      std::async(std::launch::async, [&] { return std::make_shared<const MeshFile>(files.mesh); });
  const auto base = std::make_shared<const CadModel>(read_step(files.base_cad));
  const CadModel variant = read_step(files.variant_cad);
  const auto mesh = mesh_to_come.get();
  clock.stop();

  const MorphJob job(base, mesh, without_repair(options));
  const MorphResult result = job.morph(variant);
  FieldReport report{.morph = result.report, .field = {}};
  if (result.report.outcome == Outcome::Done) {
    clock.start("writing");
    DeformationTerms terms = job.deformation(result);
    terms.base_cad = files.base_cad.string();
    terms.variant_cad = files.variant_cad.string();
    terms.mesh_file = files.mesh.string();
    try {
      write_field(files.output, terms);
    } catch (const IoError& error) {
      throw OutputError(error.what());
    }
    report.field = figures_of(files.output, terms);
    report.morph.written = files.output;
  }
  report.morph.peak_memory = peak_memory();
  auto& phases = report.morph.phases;
  phases.insert(phases.begin(), clock.phases().front());
  if (clock.phases().size() > 1) phases.push_back(clock.phases().back());
  for (const PhaseTime& phase : phases) report.morph.seconds += phase.seconds;
  return report;
}

ApplyReport apply_files(const fs::path& field, const fs::path& mesh, const fs::path& output) {
  check_output(output, {field, mesh});
  PhaseClock clock;
  clock.start("apply");
  auto terms_to_come = std::async(std::launch::async, [&] { return read_field(field); });
  const MeshFile file(mesh);
  const DeformationField deformation(terms_to_come.get());
  const Mesh& before = file.mesh();

  const MovedPoints moved = deformation.apply(before.points);
  ApplyReport report;
  report.field = figures_of(field, deformation.terms());
  report.mesh = mesh;
  report.nodes = before.node_count();
  report.cells = before.cell_count();
  report.at_nodes = moved.at_nodes;
  report.outside = moved.outside;
  report.max_displacement = (moved.positions - before.points).rowwise().norm().maxCoeff();
  measure(before, moved.positions, report);
  report.written = write(file, moved.positions, report, output);
  report.seconds = clock.phases().front().seconds;
  return report;
}

}  // namespace cadmorph
