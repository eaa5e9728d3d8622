#include "apps/bench/families.h"

#include <array>
#include <optional>
#include <utility>

#include "apps/bench/given_surface.h"
#include "apps/summary/text_table.h"
#include "cad/step_reader.h"
#include "core/boundary.h"
#include "core/errors.h"
#include "surface/surface_morph.h"

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

fs::path step_file(const Subject& subject, int step) {
  return subject.folder / (step == 0 ? "base.step" : format("step%02d.step", step));
}

std::shared_ptr<const CadModel> cad_at(Series& series, int step) {
  auto& cad = series.cads[step];
  if (!cad) cad = std::make_shared<const CadModel>(read_step(step_file(series.subject, step)));
  return cad;
}

/// A CAD model with a mesh of it, from which the surface goes to another.
class Stage {
 public:
  Stage(std::shared_ptr<const CadModel> cad, const Mesh& mesh, const Boundary& boundary)
      : cad_(std::move(cad)),
        boundary_(boundary),
        start_(mesh.points(boundary.nodes, Eigen::all)),
        surface_(cad_, mesh, boundary),
        rows_(surface_.association().prescribed_rows()) {}

  const std::vector<RowId>& rows() const { return rows_; }

  /// By Surface, those asked for.
  std::array<Points, 2> positions_on(const CadModel& variant,
                                     const std::set<Surface>& kinds) const {
    const TopologyMatch match = match_topology(*cad_, variant);
    const Points own = surface_.morph(variant, match).positions;
    std::array<Points, 2> result;
    if (kinds.contains(Surface::RbfS)) result[0] = own(rows_, Eigen::all);
    if (kinds.contains(Surface::Harmonic))
      result[1] = harmonic_surface(start_, boundary_, surface_.association(), variant, match, own)(
          rows_, Eigen::all);
    return result;
  }

 private:
  std::shared_ptr<const CadModel> cad_;
  const Boundary& boundary_;
  Points start_;
  SurfaceMorph surface_;
  std::vector<RowId> rows_;
};

void set_absolute_paths(Series& series, const std::set<Surface>& kinds, const Stage& base,
                        int stride) {
  const int last = static_cast<int>(std::ssize(series.cads)) - 1;
  for (const Surface kind : kinds) series.paths[{kind, Mode::Absolute}].resize(last);
  for (int step = stride; step <= last; step += stride) {
    std::array<Points, 2> positions = base.positions_on(*cad_at(series, step), kinds);
    for (const Surface kind : kinds)
      series.paths[{kind, Mode::Absolute}][step - 1] = std::move(positions[static_cast<int>(kind)]);
  }
}

void set_relative_path(Series& series, Surface kind, const Stage& base, const Boundary& boundary) {
  Path& path = series.paths[{kind, Mode::Relative}];
  Mesh mesh = series.mesh;
  std::optional<Stage> stage;
  for (int step = 1; step < std::ssize(series.cads); ++step) {
    const auto variant = cad_at(series, step);
    if (step > 1) {
      stage.emplace(series.cads[step - 1], mesh, boundary);
      if (stage->rows() != base.rows())
        throw AssociationError(step_file(series.subject, step - 1).string() +
                               ": the morphed surface lies on other CAD entities than the base's");
    }
    Points target =
        std::move((stage ? *stage : base).positions_on(*variant, {kind})[static_cast<int>(kind)]);
    for (std::size_t i = 0; i < series.surface_nodes.size(); ++i)
      mesh.points.row(series.surface_nodes[i]) = target.row(i);
    path.push_back(std::move(target));
  }
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

Series make_series(const Subject& subject, const std::set<Route>& routes, int stride, int last) {
  Series series;
  series.subject = subject;
  series.cads.resize(last + 1);
  series.mesh_file = std::make_shared<const MeshFile>(subject.folder / (subject.mesh + ".vtu"));
  series.mesh = series.mesh_file->mesh();
  series.orientation = detect_orientation(series.mesh);
  const Boundary boundary = extract_boundary(series.mesh);
  const Stage base(cad_at(series, 0), series.mesh, boundary);
  for (const RowId row : base.rows()) series.surface_nodes.push_back(boundary.nodes[row]);
  std::set<Surface> absolute;
  for (const Route& route : routes) {
    if (route.mode == Mode::Relative)
      set_relative_path(series, route.surface, base, boundary);
    else
      absolute.insert(route.surface);
  }
  set_absolute_paths(series, absolute, base, stride);
  return series;
}

}  // namespace cadmorph::bench
