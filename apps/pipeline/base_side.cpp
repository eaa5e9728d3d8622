#include "apps/pipeline/base_side.h"

#include <utility>

#include "apps/pipeline/morph_base.h"

namespace cadmorph {
namespace {

std::vector<Index> prescribed_rows(const Association& association) {
  std::vector<Index> rows;
  for (Index i = 0; i < static_cast<Index>(association.is_free.size()); ++i)
    if (!association.is_free[i]) rows.push_back(i);
  return rows;
}

void set_up_volume(const BaseInputs& inputs, BaseSide& side) {
  side.rows = prescribed_rows(side.surface->association());
  std::vector<Index> nodes;
  for (const Index row : side.rows) nodes.push_back(side.boundary.nodes[row]);
  side.volume.emplace(inputs.mesh, std::move(nodes), inputs.options.volume);
}

void measure(const Mesh& mesh, BaseSide& side) {
  side.orientation = detect_orientation(mesh);
  side.quality = measure_quality(mesh, mesh.points, side.orientation);
  side.validity = check_validity(mesh, mesh.points, side.orientation);
  side.checks = check_quality(mesh, mesh.points, side.neighbours, side.orientation);
}

}  // namespace

BaseSide set_up_base_side(const BaseInputs& inputs, PhaseClock& clock) {
  BaseSide side;
  clock.start("boundary");
  about_file(inputs.file.path(), [&] {
    side.neighbours = find_cell_neighbours(inputs.mesh);
    side.boundary = extract_boundary(inputs.mesh, side.neighbours);
  });
  clock.start("association");
  side.surface.emplace(inputs.cad, inputs.mesh, side.boundary, inputs.options.surface);
  clock.start("volume set-up");
  set_up_volume(inputs, side);
  clock.start("quality before");
  measure(inputs.mesh, side);
  return side;
}

}  // namespace cadmorph
