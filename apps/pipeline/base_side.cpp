#include "apps/pipeline/base_side.h"

#include <algorithm>
#include <utility>

#include "apps/pipeline/base_cache.h"
#include "core/archive_types.h"
#include "core/blas.h"
#include "core/cell_topology.h"
#include "core/parallel.h"
#include "core/plane_mesh.h"
#include "surface/block_borders.h"
#include "surface/motion_path.h"
#include "surface/unnamed_interfaces.h"
#include "volume/mid_nodes.h"

namespace cadmorph {
namespace {

// Of the mesh's size (is_at_base): what the digits of a STEP file and a projection leave.
constexpr double kAtBase = 1e-9;

PipelineOptions with_progress_everywhere(PipelineOptions options) {
  if (!options.surface.association.progress)
    options.surface.association.progress = options.progress;
  if (!options.volume.rbf.progress) options.volume.rbf.progress = options.progress;
  return options;
}

// Counts cells of a lower dimension than the mesh, and nodes that they alone, or no cell, use and
// that are not on the surface.
void count_others(const Mesh& mesh, const Boundary& boundary, PipelineReport& report) {
  const int highest = dimension(mesh);
  report.mesh.has_solids = highest == 3;
  std::vector<char> is_used(static_cast<std::size_t>(mesh.node_count()), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (dimension(mesh.types[c]) < highest)
      ++report.mesh.other_cells;
    else
      for (const Index node : mesh.cell(c)) is_used[node] = 1;
  }
  for (const Index node : boundary.nodes) is_used[node] = 1;
  report.mesh.loose_nodes = std::ranges::count(is_used, 0);
}

}  // namespace

BaseSide::BaseSide(std::shared_ptr<const CadModel> base_cad, std::shared_ptr<const MeshFile> file,
                   PipelineOptions all_options, Points start)
    : options(with_progress_everywhere(std::move(all_options))),
      cad(std::move(base_cad)),
      mesh_file(std::move(file)) {
  starts_elsewhere = start.size() > 0;
  if (starts_elsewhere) set_start(std::move(start));
  if (auto turned = in_one_sense(mesh())) own = std::move(turned);
  PhaseClock clock(options.progress);
  if (options.cache.empty() || starts_elsewhere)
    set_up(clock);
  else
    report.run.cache = BaseCache::set_up(*this, clock);
  fill_report();
  report.run.phases = clock.phases();
}

void BaseSide::set_up(PhaseClock& clock) {
  clock.start("boundary");
  std::vector<char> parts;
  about_file(mesh_file->path(), [&] {
    neighbours = find_cell_neighbours(mesh());
    boundary = extract_boundary(mesh(), neighbours);
    parts = mark_parts_inside(mesh(), boundary, options.surface.groups);
    if (!parts.empty()) boundary = extract_boundary(mesh(), neighbours, parts);
  });
  clock.start("association");
  surface = std::make_shared<SurfaceMorph>(cad, mesh(), boundary, options.surface);
  take_unnamed_interfaces(parts);
  drop_block_borders();
  clock.start("volume set-up");
  set_up_volume();
  clock.start("quality before");
  measure();
}

// Where the file tells no regions apart, faces of cells on the CAD's faces inside are surface, too.
void BaseSide::take_unnamed_interfaces(const std::vector<char>& parts) {
  if (dimension(mesh()) < 3) return;
  const UnnamedInterfaces found = find_unnamed_interfaces(
      *cad, mesh(), neighbours, boundary, association(), options.surface.association.tolerance);
  crossed_faces = found.crossed;
  if (found.faces.empty()) return;
  boundary = extract_boundary(mesh(), neighbours, parts, found.faces);
  associate_anew();
}

// Faces between blocks of a mesh that are not in the CAD are no surface.
void BaseSide::drop_block_borders() {
  JoinedBlocks joined = join_blocks(mesh(), boundary, association());
  if (joined.regions.empty()) return;
  set_regions(std::move(joined.regions));
  boundary = std::move(joined.boundary);
  associate_anew();
}

void BaseSide::set_regions(std::vector<int> regions) {
  if (!own) own = mesh_file->mesh();
  own->regions = std::move(regions);
}

void BaseSide::associate_anew() {
  SurfaceMorphOptions known = options.surface;
  known.association.mesh_unit_mm = association().mesh_unit_mm;
  surface = std::make_shared<SurfaceMorph>(cad, mesh(), boundary, known);
}

void BaseSide::set_up_volume() {
  rows = association().prescribed_rows();
  std::vector<Index> nodes, free;
  for (const RowId row : rows) nodes.push_back(boundary.nodes[row]);
  std::ranges::set_difference(boundary.nodes, nodes, std::back_inserter(free));
  volume.emplace(mesh(), std::move(nodes), options.volume, free);
}

void BaseSide::measure() {
  orientation = detect_orientation(mesh());
  quality = measure_quality(mesh(), mesh().points, orientation);
  validity = check_validity(mesh(), mesh().points, orientation);
  checks = check_quality(mesh(), mesh().points, neighbours, orientation);
}

void BaseSide::store(OutputArchive& archive) const {
  const std::vector<int> joined =
      mesh().regions == mesh_file->mesh().regions ? std::vector<int>() : mesh().regions;
  archive(joined, boundary, crossed_faces, association(), rows, orientation, neighbours, quality,
          validity, checks);
  volume->store(archive);
}

void BaseSide::restore(InputArchive& archive) {
  Association found;
  std::vector<int> joined;
  archive(joined, boundary, crossed_faces, found, rows, orientation, neighbours, quality, validity,
          checks);
  if (!joined.empty()) set_regions(std::move(joined));
  surface =
      std::make_shared<SurfaceMorph>(cad, mesh(), boundary, std::move(found), options.surface);
  volume.emplace(mesh(), options.volume, archive);
}

void BaseSide::set_start(Points start) {
  if (start.rows() != mesh_file->mesh().node_count())
    throw InvalidInputError("a morph needs a start for each of the mesh's " +
                            std::to_string(mesh_file->mesh().node_count()) + " nodes");
  own = mesh_file->mesh();
  own->points = std::move(start);
}

void BaseSide::fill_report() {
  const Association& found = association();
  report.cad.base = figures_of(*cad);
  report.mesh.file = mesh_file->path();
  report.mesh.format = mesh_file->format();
  report.mesh.remarks = mesh_file->remarks();
  for (const std::string& note : mesh_file->notes())
    report.run.notes.push_back(mesh_file->path().filename().string() + ": " + note);
  count_others(mesh(), boundary, report);
  report.mesh.nodes = mesh().node_count();
  report.mesh.cells = mesh().cell_count();
  report.mesh.vertex_nodes = found.vertex_nodes;
  report.mesh.edge_nodes = found.edge_nodes;
  report.mesh.face_nodes = found.face_nodes;
  report.mesh.amid_nodes = found.amid_nodes;
  report.mesh.unmatched_nodes = found.unmatched_nodes;
  report.mesh.interior_nodes = report.mesh.nodes - report.mesh.vertex_nodes -
                               report.mesh.edge_nodes - report.mesh.face_nodes -
                               report.mesh.amid_nodes - report.mesh.unmatched_nodes;
  report.mesh.unit_mm = found.mesh_unit_mm;
  report.mesh.is_unit_detected = options.surface.association.mesh_unit_mm == 0;
  set_quality(report.before, quality, validity, checks);
  report.before.max_distance = found.max_distance;
  report.before.mean_distance = found.mean_distance;
  report.method = options.volume.method;
  report.kernel = options.volume.kernel;
  report.can_repair = options.can_repair;
  report.run.threads = thread_count();
  report.run.blas_kernel = blas_kernel();
  if (validity.invalid > 0 ||
      (quality.inverted > 0 && !plane_normal(mesh(), mesh().points).isZero(0)))
    warn_of_inverted();
  if (!crossed_faces.empty()) warn_of_crossed();
}

// A mesh of another state of the part, or a CAD with bodies that were not meshed.
void BaseSide::warn_of_crossed() {
  constexpr std::size_t kNamed = 6;  // faces, as many as a line holds
  std::string names;
  for (std::size_t i = 0; i < std::min(kNamed, crossed_faces.size()); ++i)
    names += (i > 0 ? ", " : "") + std::to_string(crossed_faces[i] + 1);
  if (crossed_faces.size() > kNamed) names += ", ...";
  const std::string text =
      std::to_string(crossed_faces.size()) + " faces of the base CAD (" + names +
      ") run through the mesh, and no face of a cell lies on them: is the mesh that of this CAD? "
      "What should lie there follows the volume";
  if (options.surface.unmatched == UnmatchedPolicy::Error) throw AssociationError(text);
  report.run.warnings.push_back(text);
  if (options.notice) options.notice(text);
}

// Called before the work goes on, which may take long and fail for cells that were inverted
// already.
void BaseSide::warn_of_inverted() {
  misordered = misordered_cells(mesh(), neighbours, orientation, validity.invalid_cells);
  const std::vector<Index>& inverted =
      validity.invalid > 0 ? validity.invalid_cells : quality.inverted_cells;
  std::string text = "the input mesh has " + std::to_string(inverted.size()) +
                     " inverted cells already, the first is " + cell_name(mesh(), inverted.front());
  if (!misordered.empty())
    text += "; the nodes of " + std::to_string(misordered.size()) +
            " of them are in a wrong order (" + cell_name(mesh(), misordered.front()) +
            "): mend that where the mesh comes from, no repair is tried there";
  report.run.warnings.push_back(text);
  if (options.notice) options.notice(text);
}

Points BaseSide::prescribed(const Points& surface_positions) const {
  Points result(rows.size(), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(i) = surface_positions.row(rows[i]);
  return result;
}

Points BaseSide::on_boundary(const Points& prescribed_positions) const {
  if (prescribed_positions.rows() != std::ssize(rows))
    throw InvalidInputError(std::to_string(prescribed_positions.rows()) + " positions for " +
                            std::to_string(rows.size()) + " surface nodes");
  Points result = mesh().points(boundary.nodes, Eigen::all);
  result(rows, Eigen::all) = prescribed_positions;
  return result;
}

bool BaseSide::is_at_base(const Points& prescribed_positions) const {
  const Points& all = mesh().points;
  const double size = (all.colwise().maxCoeff() - all.colwise().minCoeff()).norm();
  const Points moved = on_boundary(prescribed_positions) - Points(all(boundary.nodes, Eigen::all));
  return moved.rowwise().norm().maxCoeff() <= kAtBase * size;
}

std::vector<char> BaseSide::fixed_nodes() const {
  std::vector<char> is_fixed(mesh().node_count(), 0);
  for (const RowId row : rows) is_fixed[boundary.nodes[row]] = 1;
  for (const Index c : misordered)
    for (const Index node : mesh().cell(c)) is_fixed[node] = 1;
  return is_fixed;
}

std::vector<char> BaseSide::on_cad() const {
  std::vector<char> result(static_cast<std::size_t>(mesh().node_count()), 0);
  for (const RowId row : association().dimension.ids())
    result[boundary.nodes[row]] =
        association().dimension[row] != CadDimension::None || association().is_amid[row];
  return result;
}

const LayerNodes& BaseSide::layer_nodes() const {
  std::call_once(has_layer_nodes_, [&] {
    layer_nodes_ = nodes_of_layers(mesh(), neighbours, on_cad(), mesh().points, layer_growth());
  });
  return layer_nodes_;
}

BaseSide::BaseSide(const BaseSide& curved, Straight)
    : options(curved.options),
      cad(curved.cad),
      mesh_file(curved.mesh_file),
      own(corners_alone(curved.mesh())),
      starts_elsewhere(curved.starts_elsewhere),
      boundary(corners_alone(curved.boundary)),
      surface(curved.surface),
      orientation(orientation_of_corners(curved.mesh(), curved.orientation)),
      neighbours(curved.neighbours),
      misordered(curved.misordered),
      crossed_faces(curved.crossed_faces) {
  std::vector<char> has_cell(std::size_t(mesh().node_count()), 0);
  for (const Index node : mesh().connectivity) has_cell[node] = 1;
  std::vector<Index> nodes, free;
  std::ranges::copy_if(curved.rows, std::back_inserter(rows),
                       [&](RowId row) { return has_cell[boundary.nodes[row]]; });
  for (const RowId row : rows) nodes.push_back(boundary.nodes[row]);
  for (const Index node : boundary.nodes)
    if (has_cell[node] && !std::ranges::binary_search(nodes, node)) free.push_back(node);
  volume.emplace(mesh(), std::move(nodes), options.volume, free);
  quality = measure_quality(mesh(), mesh().points, orientation);
  validity = check_validity(mesh(), mesh().points, orientation);
}

std::shared_ptr<const BaseSide> BaseSide::straight() const {
  std::call_once(has_straight_, [&] { straight_.reset(new BaseSide(*this, Straight{})); });
  return straight_;
}

// Where faces turn, the surface follows them on the way; found out when it is first asked for.
SurfacePath BaseSide::path(const Points& prescribed_positions) const {
  const auto turning = std::make_shared<std::optional<MotionPath>>();
  return [this, turning, &prescribed_positions](double s) -> Points {
    if (!*turning) {
      turning->emplace(boundary, mesh().points(boundary.nodes, Eigen::all),
                       on_boundary(prescribed_positions), association().facet_face);
    }
    return prescribed((**turning)(s));
  };
}

}  // namespace cadmorph
