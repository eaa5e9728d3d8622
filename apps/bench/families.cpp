#include "apps/bench/families.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <set>

#include "apps/bench/given_surface.h"
#include "apps/summary/text_table.h"
#include "cad/step_reader.h"
#include "core/boundary.h"
#include "core/errors.h"
#include "core/mesh_file.h"
#include "surface/surface_morph.h"
#include "volume/volume_morph.h"

namespace cadmorph::bench {
namespace {

namespace fs = std::filesystem;

std::set<fs::path> entries(const fs::path& folder) {
  std::error_code error;
  std::set<fs::path> result;
  for (const auto& entry : fs::directory_iterator(folder, error)) result.insert(entry.path());
  if (error) throw IoError("can't read the folder " + folder.string() + ": " + error.message());
  return result;
}

std::shared_ptr<const CadModel> read_cad(const fs::path& path) {
  return std::make_shared<const CadModel>(read_step(path));
}

fs::path step_file(const Subject& subject, int step) {
  return subject.folder / format("step%02d.step", step);
}

// Rows of Boundary::nodes whose positions are prescribed.
std::vector<Index> prescribed_rows(const Association& association) {
  std::vector<Index> rows;
  for (Index i = 0; i < static_cast<Index>(association.is_free.size()); ++i)
    if (!association.is_free[i]) rows.push_back(i);
  return rows;
}

Points rows_of(const Points& points, const std::vector<Index>& rows) {
  Points result(rows.size(), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(i) = points.row(rows[i]);
  return result;
}

/// A CAD model with a mesh of it, from which the surface goes to another.
class Stage {
 public:
  Stage(std::shared_ptr<const CadModel> cad, const Mesh& mesh, const Boundary& boundary)
      : cad_(std::move(cad)),
        boundary_(boundary),
        start_(rows_of(mesh.points, boundary.nodes)),
        surface_(cad_, mesh, boundary),
        rows_(prescribed_rows(surface_.association())) {}

  const std::vector<Index>& rows() const { return rows_; }

  Points positions_on(const CadModel& variant, Surface kind) const {
    const TopologyMatch match = match_topology(*cad_, variant);
    Points all = surface_.morph(variant, match).positions;
    if (kind == Surface::Harmonic)
      all = harmonic_surface(start_, boundary_, surface_.association(), variant, match, all);
    return rows_of(all, rows_);
  }

 private:
  std::shared_ptr<const CadModel> cad_;
  const Boundary& boundary_;
  Points start_;
  SurfaceMorph surface_;
  std::vector<Index> rows_;
};

Path absolute_path(const Subject& subject, Surface kind, const Stage& base, int stride) {
  Path result(kSteps);
  for (int step = stride; step <= kSteps; step += stride)
    result[step - 1] = base.positions_on(*read_cad(step_file(subject, step)), kind);
  return result;
}

// The mesh inside follows, so that the next association sees its local edges.
Path relative_path(const Subject& subject, Surface kind, const Stage& base, const Series& series,
                   const Boundary& boundary) {
  Path result;
  Mesh mesh = series.mesh;
  std::optional<Stage> stage;
  for (int step = 1; step <= kSteps; ++step) {
    const auto variant = read_cad(step_file(subject, step));
    result.push_back((stage ? *stage : base).positions_on(*variant, kind));
    if (step == kSteps) break;
    mesh.points = VolumeMorph(mesh, series.surface_nodes).morph(result.back());
    stage.emplace(variant, mesh, boundary);
    if (stage->rows() != base.rows())
      throw AssociationError(step_file(subject, step).string() +
                             ": the morphed surface lies on other CAD entities than the base's");
  }
  return result;
}

}  // namespace

std::vector<Subject> find_subjects(const fs::path& models) {
  std::vector<Subject> result;
  for (const fs::path& folder : entries(models)) {
    if (!fs::exists(folder / "base.step") || !fs::exists(folder / "step20.step")) continue;
    for (const fs::path& file : entries(folder))
      if (file.extension() == ".vtu" && file.stem() != "tet_quadratic")
        result.push_back({folder, folder.filename().string(), file.stem().string()});
  }
  if (result.empty())
    throw IoError(models.string() +
                  " holds no model family (a folder with base.step, step01.step ... step20.step "
                  "and meshes); make them with models/generate.sh");
  return result;
}

Series make_series(const Subject& subject, const std::set<Route>& routes, int stride) {
  Series series;
  series.subject = subject;
  series.mesh = MeshFile(subject.folder / (subject.mesh + ".vtu")).mesh();
  series.orientation = detect_orientation(series.mesh);
  const Boundary boundary = extract_boundary(series.mesh);
  const Stage base(read_cad(subject.folder / "base.step"), series.mesh, boundary);
  for (const Index row : base.rows()) series.surface_nodes.push_back(boundary.nodes[row]);
  for (const Route& route : routes) {
    const int place = static_cast<int>(route.surface);
    if (route.mode == Mode::Relative)
      series.relative[place] = relative_path(subject, route.surface, base, series, boundary);
    else
      series.absolute[place] = absolute_path(subject, route.surface, base, stride);
  }
  return series;
}

}  // namespace cadmorph::bench
