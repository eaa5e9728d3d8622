#include "apps/pipeline/field_files.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <iterator>
#include <optional>

#include "apps/pipeline/output_file.h"
#include "core/length_units.h"
#include "core/plane_mesh.h"
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
  options.can_repair = false;
  return options;
}

// The unit in which the points have the box of the field's mesh; where none does, the field's: they
// may be a piece of it.
double detect_unit(const Points& points, const DeformationTerms& terms) {
  constexpr double kSameBox = 0.02;  // of the diagonal: units differ by a factor of 2.5 at least
  const Eigen::RowVector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  const double size = (terms.high - terms.low).norm();
  const auto misfit = [&](double unit) {
    const double scale = unit / terms.mesh_unit_mm;
    return std::max((scale * low - terms.low).norm(), (scale * high - terms.high).norm());
  };
  double best = terms.mesh_unit_mm;
  if (misfit(best) <= kSameBox * size) return best;
  for (const auto& [unit, name] : kLengthUnits)
    if (misfit(unit) <= kSameBox * size && misfit(unit) < misfit(best)) best = unit;
  return best;
}

// Points that only the change of units moved.
void keep_still(const Points& before, Points& after) {
  constexpr double kRounding = 1e-15;  // two roundings of a coordinate
  for (Index i = 0; i < before.size(); ++i)
    if (std::abs(after.data()[i] - before.data()[i]) <= kRounding * std::abs(before.data()[i]))
      after.data()[i] = before.data()[i];
}

// Those of `cells` that are bad in the result: invalid, or with a corner that has inverted.
std::vector<Index> bad_cells(const ApplyReport& report) {
  std::vector<Index> corners, result;
  std::ranges::set_difference(report.quality_after.inverted_cells,
                              report.quality_before.inverted_cells, std::back_inserter(corners));
  std::ranges::set_union(report.validity_after.invalid_cells, corners, std::back_inserter(result));
  return result;
}

void measure(const Mesh& given, const Points& moved, ApplyReport& report) {
  const std::optional<Mesh> turned = in_one_sense(given);
  const Mesh& mesh = turned ? *turned : given;
  const Orientation orientation = detect_orientation(mesh);
  report.quality_before = measure_quality(mesh, mesh.points, orientation);
  report.quality_after = measure_quality(mesh, moved, orientation);
  report.validity_before = check_validity(mesh, mesh.points, orientation);
  report.validity_after = check_validity(mesh, moved, orientation);
  report.bad_cells = bad_cells(report);
}

WrittenMesh write(const MeshFile& mesh, const Points& moved, const ApplyReport& report,
                  const fs::path& output) {
  ExtraArrays extra;
  if (!report.bad_cells.empty()) {
    std::vector<int> is_bad(static_cast<std::size_t>(mesh.mesh().cell_count()), 0);
    for (const Index c : report.bad_cells) is_bad[c] = 1;
    extra.cell_integers["cadmorph_bad"] = std::move(is_bad);
  }
  const fs::path path = report.bad_cells.empty() ? output : failed_path(output);
  WrittenMesh written{.path = path};
  as_output([&] { written.rounding = mesh.write(path, moved, extra); });
  return written;
}

// What moves any other points as it moved the nodes, repair by optimisation apart, which has no
// field.
DeformationTerms deformation_of(const MorphResult& result) {
  const BaseSide& base = *result.base;
  DeformationTerms terms = about_file(base.mesh_file->path(), [&] {
    return record_deformation(base.mesh(), *base.volume,
                              {result.surface_positions, base.path(result.surface_positions)},
                              result.report.stepping.steps);
  });
  terms.mesh_unit_mm = result.report.mesh.unit_mm;
  return terms;
}

// The fields of a series of morphs, one after the other.
class FieldRecord {
 public:
  void add(const MorphResult& result) {
    DeformationTerms leg = deformation_of(result);
    if (terms_.steps.empty()) {
      terms_ = std::move(leg);
      nodes_ = result.base->volume->surface_nodes();
      return;
    }
    terms_.steps.insert(terms_.steps.end(), leg.steps.begin(), leg.steps.end());
    terms_.new_nodes = result.positions(nodes_, Eigen::all);
  }

  DeformationTerms& terms() { return terms_; }

 private:
  DeformationTerms terms_;
  std::vector<Index> nodes_;  ///< of the mesh: those prescribed in the first morph
};

}  // namespace

FieldReport field_files(const MorphFiles& files, const PipelineOptions& options) {
  FieldRecord record;
  FieldReport report;
  MorphFiles trip = files;
  trip.on_leg = [&](const MorphResult& result) { record.add(result); };
  trip.write = [&](const MorphResult& result) -> WrittenMesh {
    if (result.report.outcome != Outcome::Done) return {};
    DeformationTerms& terms = record.terms();
    terms.base_cad = files.base_cad.string();
    terms.variant_cad = files.variant_cad.string();
    terms.mesh_file = files.mesh.string();
    as_output([&] { write_field(files.output, terms); });
    report.field = figures_of(files.output, terms);
    return {.path = files.output};
  };
  report.morph = morph_files(trip, without_repair(options));
  return report;
}

ApplyReport apply_files(const fs::path& field, const fs::path& mesh, const fs::path& output,
                        double mesh_unit_mm) {
  check_mesh_output(output, {field, mesh});
  PhaseClock clock;
  clock.start("apply");
  auto terms_to_come = std::async(std::launch::async, [&] { return read_field(field); });
  const MeshFile file(mesh);
  file.check_target(output);
  const DeformationField deformation(terms_to_come.get());
  const Mesh& before = file.mesh();

  ApplyReport report;
  report.mesh_unit_mm =
      mesh_unit_mm > 0 ? mesh_unit_mm : detect_unit(before.points, deformation.terms());
  const double scale = report.mesh_unit_mm / deformation.terms().mesh_unit_mm;
  MovedPoints moved = deformation.apply(scale == 1 ? before.points : Points(scale * before.points));
  if (scale != 1) {
    moved.positions /= scale;
    keep_still(before.points, moved.positions);
  }
  report.field = figures_of(field, deformation.terms());
  report.mesh = mesh;
  report.mesh_format = file.format();
  report.remarks = file.remarks();
  report.nodes = before.node_count();
  report.cells = before.cell_count();
  report.at_nodes = moved.at_nodes;
  report.outside = moved.outside;
  report.max_displacement = (moved.positions - before.points).rowwise().norm().maxCoeff();
  measure(before, moved.positions, report);
  const WrittenMesh written = write(file, moved.positions, report, output);
  report.written = written.path;
  report.rounding = written.rounding;
  report.seconds = clock.phases().front().seconds;
  return report;
}

}  // namespace cadmorph
