#include "apps/pipeline/write_result.h"

#include <cmath>
#include <utility>

#include "apps/pipeline/output_file.h"
#include "apps/pipeline/refusal.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

// Numbers of CAD entities as `cadmorph match` prints them, from 1.
class EntityNumbers {
 public:
  explicit EntityNumbers(const CadModel& matched) : skeleton_(matched.skeleton()) {}

  // 0 for no entity, and for a vertex that only cuts a smooth edge of `match`.
  int operator()(CadDimension dimension, int entity) const {
    if (entity < 0) return 0;
    if (dimension == CadDimension::Vertex) return skeleton_.corner_of_vertex[VertexId(entity)] + 1;
    if (dimension == CadDimension::Edge) return skeleton_.curve_of_edge[EdgeId(entity)] + 1;
    return entity + 1;
  }

 private:
  const CadSkeleton& skeleton_;
};

void add_diagnostics(const MorphResult& result, ExtraArrays& extra) {
  const BaseSide& base = *result.base;
  const Mesh& mesh = base.mesh();
  const Association& association = base.association();
  const auto& nodes = base.boundary.nodes;
  constexpr int kInterior = 3;
  std::vector<int> dimensions(mesh.node_count(), kInterior), entities(mesh.node_count(), 0);
  RowMatrix uv = RowMatrix::Zero(mesh.node_count(), 2);
  const CadModel matched = result.match.joins_edges ? base.cad->with_joined_edges() : *base.cad;
  const EntityNumbers number(matched);
  for (const RowId i : association.is_free.ids()) {
    if (association.is_free[i]) continue;
    dimensions[nodes[i]] = static_cast<int>(association.dimension[i]);
    entities[nodes[i]] = number(association.dimension[i], association.entity[i]);
    if (association.entity[i] >= 0) uv.row(nodes[i]) = association.uv.row(i);
  }
  RowMatrix jacobians(mesh.cell_count(), 1);
  for (Index c = 0; c < mesh.cell_count(); ++c)
    jacobians(c, 0) = std::isnan(result.quality.values[c])
                          ? scaled_jacobian(mesh, result.positions, c)
                          : result.quality.values[c];
  extra.point_arrays["cadmorph_displacement"] = result.positions - base.mesh_file->mesh().points;
  extra.point_integers["cadmorph_cad_dimension"] = std::move(dimensions);
  extra.point_integers["cadmorph_cad_entity"] = std::move(entities);
  extra.point_arrays["cadmorph_uv"] = std::move(uv);
  extra.cell_arrays["cadmorph_scaled_jacobian"] = std::move(jacobians);
}

}  // namespace

WrittenMesh write_result(const MorphResult& result, const fs::path& output, bool has_diagnostics) {
  ExtraArrays extra;
  WrittenMesh written;
  if (has_diagnostics) add_diagnostics(result, extra);
  fs::path path = output;
  if (result.report.outcome != Outcome::Done) {
    path = failed_path(output);
    std::vector<int> is_bad(result.base->mesh().cell_count(), 0);
    for (const Index c : bad_cells(result)) is_bad[c] = 1;
    extra.cell_integers["cadmorph_bad"] = std::move(is_bad);
  }
  const MeshFile& file = *result.base->mesh_file;
  as_output([&] {
    if (!file.takes_arrays(path) && has_diagnostics) {
      written.diagnostics = vtu_path(path, ".diagnostics");
      file.write(written.diagnostics, result.positions, std::exchange(extra, {}));
    }
    written.rounding = file.write(path, result.positions, extra);
  });
  written.path = path;
  return written;
}

}  // namespace cadmorph
