#include "core/rbf/unit_field.h"

#include "core/rbf/field_evaluator.h"
#include "core/rbf/field_terms.h"
#include "core/rbf/multiscale_correction.h"

namespace cadmorph {
namespace {

// The source side of the evaluator's trees.
SourceTree source_tree(const H2Matrix& h2, const H2Matrix::Sources& sources) {
  SourceTree tree;
  tree.separation = EvaluatorOptions{}.separation;
  tree.skeleton_points = h2.skeleton_points();
  tree.skeleton_weights = sources.skeletons;
  for (std::size_t i = 0; i < h2.tree().nodes.size(); ++i) {
    const Octree::Node& node = h2.tree().nodes[i];
    const int id = static_cast<int>(i);
    const Index first = h2.skeleton_begin(id);
    tree.nodes.push_back({.centre = node.centre,
                          .radius = node.radius,
                          .first_child = node.first_child,
                          .child_count = node.child_count,
                          .begin = node.begin,
                          .end = node.end,
                          .skeleton_begin = first,
                          .skeleton_end = first + h2.rank(id)});
  }
  return tree;
}

}  // namespace

void describe(const UnitField& field, FieldTerms& terms) {
  terms.linear = field.linear;
  if (field.correction) terms.correction = field.correction->levels();
  if (!field.far_field) {
    terms.centres = *field.centres;
    terms.weights = field.weights;
    return;
  }
  H2Matrix::Sources sources = field.far_field->compress(field.weights);
  terms.tree = source_tree(*field.far_field, sources);
  terms.centres = field.far_field->tree().points;
  terms.weights = std::move(sources.weights);
}

}  // namespace cadmorph
