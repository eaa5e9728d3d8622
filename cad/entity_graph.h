#pragma once

#include <compare>
#include <cstdint>
#include <span>
#include <vector>

#include "cad/brep.h"

namespace cadmorph {

/// The topology of a CAD model as a labelled graph. Nodes: faces, curves, corners, solids, and the
/// uses of curves by faces; arcs run both ways with different labels.
struct EntityGraph {
  struct Arc {
    int label, to;
  };
  /// The use of a curve by a face: its node and one of its coedges.
  struct Use {
    int node;
    CurveId curve;
    CoedgeId coedge;
  };
  int faces = 0, curves = 0, corners = 0;  ///< the first nodes, in this order
  std::vector<int> kind;                   ///< a node
  std::vector<std::vector<Arc>> arcs;      ///< a node
  std::vector<Use> uses;

  int size() const { return static_cast<int>(kind.size()); }
  int curve_node(CurveId curve) const { return faces + curve; }
  int corner_node(CornerId corner) const { return faces + curves + corner; }
  FaceId face(int node) const { return FaceId(node); }
  CurveId curve(int node) const { return CurveId(node - faces); }
  CornerId corner(int node) const { return CornerId(node - faces - curves); }
  int entity_count() const { return faces + curves + corners; }
};

struct GraphOptions {
  /// The uses tell a curve's first corner from its last one as seen with the face to the left from
  /// outside: a mirrored copy then has another graph.
  bool is_oriented = true;
  /// Of a model in one plane: the side from which it is seen, whatever its faces call their
  /// outside; else zero.
  Eigen::Vector3d seen_along = Eigen::Vector3d::Zero();
  bool has_solids = true;  ///< the solids are nodes; else a solid is no more than its faces
};

EntityGraph build_graph(const CadModel& model, const GraphOptions& options);

/// Joint colours of two graphs' nodes, refined until stable (Weisfeiler and Leman 1968): nodes of
/// different colours can't correspond.
class ColourRefinement {
 public:
  ColourRefinement(const EntityGraph& base, const EntityGraph& variant);

  /// Tells nodes of different labels (one a node) apart, as far as a label occurs equally often in
  /// both graphs; 0 says nothing.
  void hint(const std::vector<std::uint64_t>& base, const std::vector<std::uint64_t>& variant);

  /// Declares base node b and variant node v counterparts.
  void individualise(int b, int v);

  /// Splits colours by neighbourhood until none changes, or one is out of balance. Returns
  /// is_balanced(). O(a log a) for a arcs of the nodes whose colour changes.
  bool refine();

  /// Whether each colour has as many nodes in the base as in the variant.
  bool is_balanced() const { return unbalanced_ == 0; }

  /// Number of colours that nodes have.
  Index count() const;

  const std::vector<int>& base_colours() const { return colours_[0]; }
  const std::vector<int>& variant_colours() const { return colours_[1]; }

 private:
  struct Node {
    int graph, number;
    auto operator<=>(const Node&) const = default;
  };
  struct Seen {
    int colour;
    std::uint64_t neighbourhood;
    Node node;
    auto operator<=>(const Seen&) const = default;
  };
  struct Class {
    int size = 0;    // nodes of the colour
    int excess = 0;  // those of the base less those of the variant
  };

  void enter(Class& members, int graph, int count);
  int fresh_colour();
  void recolour(Node node, int colour);
  std::vector<Node> take_neighbours_of_changed();
  std::uint64_t neighbourhood(Node node) const;
  void split(std::span<const Seen> one_colour);

  const EntityGraph* graphs_[2];
  std::vector<int> colours_[2];
  std::vector<Class> classes_;  // a colour
  std::vector<Node> changed_;   // since their neighbours were last looked at
  int unbalanced_ = 0;          // colours
};

}  // namespace cadmorph
