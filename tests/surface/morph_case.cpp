#include "morph_case.h"

#include <Eigen/Geometry>

#include "cad/step_reader.h"
#include "cad/topology_match.h"
#include "core/mesh_file.h"
#include "volume/volume_morph.h"

namespace cadmorph::testing {

using Eigen::Vector3d;

MorphCase mesh_case(CadModel base, Mesh mesh) {
  MorphCase c;
  c.base = std::make_shared<const CadModel>(std::move(base));
  c.mesh = std::move(mesh);
  c.boundary = extract_boundary(c.mesh);
  c.diagonal = c.base->diagonal();
  return c;
}

MorphCase model_case(CadModel base, const std::string& vtu) {
  return mesh_case(std::move(base), MeshFile(model_file(vtu)).mesh());
}

MorphCase file_case(const std::string& step, const std::string& vtu) {
  return model_case(read_step(model_file(step)), vtu);
}

MorphCase shape_case(const std::string& name) {
  return file_case("shapes/" + name + ".step", "shapes/" + name + ".vtu");
}

SurfaceMorphResult morph_surface(const MorphCase& c, const CadModel& variant,
                                 const SurfaceMorphOptions& options) {
  const MatchedModels models = match_models(*c.base, variant);
  return SurfaceMorph(std::make_shared<const CadModel>(models.base), c.mesh, c.boundary, options)
      .morph(models.variant, models.match);
}

Morphed morph(const MorphCase& c, const CadModel& variant, const SurfaceMorphOptions& options) {
  const SurfaceMorph surface(c.base, c.mesh, c.boundary, options);
  Morphed result;
  result.surface = surface.morph(variant, match_topology(*c.base, variant));
  const std::vector<RowId> rows = surface.association().prescribed_rows();
  std::vector<Index> nodes;
  for (const RowId row : rows) nodes.push_back(c.boundary.nodes[row]);
  const Points prescribed = result.surface.positions(rows, Eigen::all);
  result.points = VolumeMorph(c.mesh, nodes).morph(prescribed);
  return result;
}

double largest_difference(const Points& a, const Points& b) {
  return (a - b).rowwise().norm().maxCoeff();
}

Points images(const Points& points, const std::function<Vector3d(const Vector3d&)>& map) {
  Points moved(points.rows(), 3);
  for (Index n = 0; n < points.rows(); ++n) moved.row(n) = map(points.row(n).transpose());
  return moved;
}

Points surface_points(const Boundary& boundary, const Points& points) {
  return points(boundary.nodes, Eigen::all);
}

Index folded_facets(const Boundary& boundary, const Points& points, const Points& expected) {
  const auto area = [&](const Points& p, Index f) {
    const auto nodes = boundary.facet(f);
    const int corners = corner_count(boundary.types[f], std::ssize(nodes));
    Vector3d sum = Vector3d::Zero();
    for (int i = 1; i + 1 < corners; ++i) {
      const Vector3d a = p.row(nodes[i]) - p.row(nodes[0]);
      const Vector3d b = p.row(nodes[i + 1]) - p.row(nodes[0]);
      sum += a.cross(b);
    }
    return sum;
  };
  Index folded = 0;
  for (Index f = 0; f < boundary.facet_count(); ++f)
    folded += area(points, f).dot(area(expected, f)) <= 0;
  return folded;
}

const std::vector<std::string>& all_shapes() {
  static const std::vector<std::string> names{"box",           "plate_12_holes",
                                              "plate_4_holes", "bracket",
                                              "stepped_shaft", "sphere",
                                              "torus",         "cone_frustum",
                                              "cone",          "cylinder",
                                              "blade",         "two_blocks",
                                              "sphere_in_box", "cylinder_quadratic"};
  return names;
}

}  // namespace cadmorph::testing
