#include <algorithm>
#include <utility>

#include "cad/brep_impl.h"

namespace cadmorph {
namespace {

// Of the diagonal: fillets and cuts leave edges of 1e-5 to 5e-4 where they nearly meet; those that
// a mesh resolves are longer.
constexpr double kShort = 1e-3;

void take_for_point(CadModel::Impl& model, EdgeId id) {
  CadEdge& edge = model.edges[id];
  const VertexId kept = edge.start, gone = edge.end;
  edge.is_degenerate = true;
  edge.length = 0;
  model.curves[id].Nullify();
  for (CadEdge& other : model.edges)
    for (VertexId* vertex : {&other.start, &other.end})
      if (*vertex == gone) *vertex = kept;
}

}  // namespace

std::vector<EdgeId> CadModel::short_edges() const {
  std::vector<std::pair<double, EdgeId>> found;
  for (const CadCurve& curve : skeleton().curves)
    if (curve.links.size() == 1 && !curve.is_closed() && curve.length < kShort * diagonal())
      found.emplace_back(curve.length, curve.links.front().edge);
  std::ranges::sort(found);
  std::vector<EdgeId> edges;
  for (const auto& [length, edge] : found) edges.push_back(edge);
  return edges;
}

CadModel CadModel::with_points_for(const std::vector<EdgeId>& edges) const {
  auto model = std::make_shared<Impl>(*impl_);
  for (const EdgeId edge : edges) take_for_point(*model, edge);
  model->edges_as_points = static_cast<int>(edges.size());
  return CadModel(std::move(model));
}

}  // namespace cadmorph
