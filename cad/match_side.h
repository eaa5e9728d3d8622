#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cad/alignment.h"
#include "cad/entity_graph.h"

namespace cadmorph {

/// One of the two models while they are matched.
struct MatchSide {
  const CadModel& model;
  EntityGraph graph;
  std::vector<EntityFeature> features;  ///< of the graph's first entity_count() nodes
  std::vector<std::uint64_t> forms;     ///< of all nodes; see entity_forms
  std::vector<std::uint64_t> bulges;    ///< of the faces; see face_bulges
};

/// Builds graph (see build_graph), features and forms of a model.
MatchSide make_match_side(const CadModel& model, const GraphOptions& options);

/// Hash of what re-exports, NURBS conversions and moved poles often keep, whatever the position: of
/// the use of a curve by a face, the place of its pcurve in the parameters of the surface (planes
/// and heights relative to the size of the model); of a face, its type. 0 where there is nothing to
/// tell.
std::vector<std::uint64_t> entity_forms(const CadModel& model, const EntityGraph& graph);

/// Of each face of a solid that closes on itself round about, as the walls of holes and pins do: 1
/// where it bulges to the outside, 2 where to the inside; 0 of other faces. A hole's wall and a
/// pin's do not become each other.
std::vector<std::uint64_t> face_bulges(const CadModel& model);

/// "face 3 (cylinder 'bore' at 1 2 3)", for messages. Nodes are those of the graph.
std::string describe(const MatchSide& side, int node);

}  // namespace cadmorph
