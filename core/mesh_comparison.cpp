#include "core/mesh_comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/edge_lengths.h"

namespace cadmorph {
namespace {

std::string count_text(Index count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

// Whether cell `c` has the same type, nodes and faces in both.
bool is_same_cell(const Mesh& a, const Mesh& b, Index c) {
  if (a.types[c] != b.types[c] || !std::ranges::equal(a.cell(c), b.cell(c))) return false;
  if (a.types[c] != CellType::Polyhedron) return true;
  const auto faces = [c](const Mesh& mesh) {
    return std::span(mesh.polyhedron_faces)
        .subspan(mesh.polyhedron_offsets[c],
                 mesh.polyhedron_offsets[c + 1] - mesh.polyhedron_offsets[c]);
  };
  return std::ranges::equal(faces(a), faces(b));
}

std::vector<std::string> compare_structure(const Mesh& reference, const Mesh& mesh) {
  std::vector<std::string> result;
  if (mesh.node_count() != reference.node_count())
    result.push_back(count_text(mesh.node_count(), "node") + ", not " +
                     std::to_string(reference.node_count()));
  if (mesh.cell_count() != reference.cell_count()) {
    result.push_back(count_text(mesh.cell_count(), "cell") + ", not " +
                     std::to_string(reference.cell_count()));
    return result;
  }
  Index differing = 0, first = -1;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (!is_same_cell(reference, mesh, c) && ++differing == 1) first = c;
  if (differing > 0)
    result.push_back(count_text(differing, "cell") + " of other type or nodes, the first is " +
                     cell_name(reference, first));
  return result;
}

void compare_positions(const Mesh& reference, const Mesh& mesh, const CompareOptions& options,
                       MeshComparison& result) {
  result.displacement = mesh.points - reference.points;
  const Eigen::VectorXd edges = incident_edges(reference).shortest;
  std::vector<std::pair<double, Index>> moved;  // distance over what is allowed
  for (Index n = 0; n < reference.node_count(); ++n) {
    const double distance = result.displacement.row(n).norm();
    result.largest_distance = std::max(result.largest_distance, distance);
    const double allowed = options.absolute.value_or(options.tolerance * edges[n]);
    if (distance > allowed) moved.emplace_back(distance / allowed, n);
  }
  result.moved_nodes = std::ssize(moved);
  const auto listed = std::min(options.listed, moved.size());
  const auto is_worse = [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : a.second < b.second;
  };
  std::partial_sort(moved.begin(), moved.begin() + static_cast<std::ptrdiff_t>(listed), moved.end(),
                    is_worse);
  for (std::size_t i = 0; i < listed; ++i) {
    const Index n = moved[i].second;
    result.nodes.push_back({n, result.displacement.row(n).norm(), edges[n]});
  }
}

void compare_texts(const DataArray& reference, const DataArray& array, ArrayDifference& result) {
  for (std::size_t i = 0; i < reference.texts.size(); ++i)
    if (reference.texts[i] != array.texts[i] && ++result.differing == 1)
      result.worst_row = static_cast<Index>(i);
}

// 0 for equal values; infinite when one of them is not a number.
double difference(const DataArray& reference, const DataArray& array, Index row, Index column) {
  if (!reference.wide_integers.empty()) {
    const auto at = static_cast<std::size_t>(row * reference.values.cols() + column);
    const auto apart = static_cast<std::uint64_t>(reference.wide_integers[at]) -
                       static_cast<std::uint64_t>(array.wide_integers[at]);
    return static_cast<double>(std::min(apart, -apart));
  }
  const double a = reference.values(row, column), b = array.values(row, column);
  if (a == b || (std::isnan(a) && std::isnan(b))) return 0;
  const double apart = std::abs(a - b);
  return std::isnan(apart) ? INFINITY : apart;
}

void compare_values(const DataArray& reference, const DataArray& array, double tolerance,
                    ArrayDifference& result) {
  double magnitude = 0;
  for (const double value : reference.values.reshaped())
    if (std::isfinite(value)) magnitude = std::max(magnitude, std::abs(value));
  const double allowed = reference.is_integral ? 0 : tolerance * magnitude;
  for (Index row = 0; row < reference.values.rows(); ++row) {
    double largest = 0;
    for (Index k = 0; k < reference.values.cols(); ++k)
      largest = std::max(largest, difference(reference, array, row, k));
    if (largest > allowed) ++result.differing;
    if (largest > result.largest) {
      result.largest = largest;
      result.worst_row = row;
    }
  }
}

// What differs between two arrays of one name; no text when nothing does.
ArrayDifference compare_array(const DataArray& reference, const DataArray& array,
                              double tolerance) {
  ArrayDifference result{.name = reference.name, .location = reference.location};
  if (array.type != reference.type) {
    result.what = "of type " + array.type + ", not " + reference.type;
  } else if (array.values.rows() != reference.values.rows() ||
             array.values.cols() != reference.values.cols() ||
             array.texts.size() != reference.texts.size()) {
    result.what = "of another size";
  } else {
    compare_texts(reference, array, result);
    compare_values(reference, array, tolerance, result);
    if (result.differing > 0) result.what = count_text(result.differing, "row") + " differ";
  }
  return result;
}

using ArrayKey = std::pair<ArrayLocation, std::string>;

std::map<ArrayKey, DataArray> arrays_by_name(const MeshFile& file, const CompareOptions& options) {
  std::map<ArrayKey, DataArray> result;
  for (DataArray& array : file.arrays())
    if (std::ranges::find(options.ignored, array.name) == options.ignored.end()) {
      const ArrayKey key{array.location, array.name};
      result.emplace(key, std::move(array));
    }
  return result;
}

std::vector<ArrayDifference> compare_arrays(const MeshFile& reference, const MeshFile& mesh,
                                            const CompareOptions& options) {
  const auto expected = arrays_by_name(reference, options);
  const auto found = arrays_by_name(mesh, options);
  std::vector<ArrayDifference> result;
  for (const auto& [key, array] : expected) {
    const auto other = found.find(key);
    ArrayDifference difference{.name = key.second, .location = key.first, .what = "missing"};
    if (other != found.end()) difference = compare_array(array, other->second, options.tolerance);
    if (!difference.what.empty()) result.push_back(std::move(difference));
  }
  for (const auto& [key, array] : found)
    if (!expected.contains(key))
      result.push_back({.name = key.second, .location = key.first, .what = "not in the reference"});
  return result;
}

}  // namespace

MeshComparison compare_meshes(const MeshFile& reference, const MeshFile& mesh,
                              const CompareOptions& options) {
  MeshComparison result;
  result.structure = compare_structure(reference.mesh(), mesh.mesh());
  if (reference.mesh().node_count() == mesh.mesh().node_count())
    compare_positions(reference.mesh(), mesh.mesh(), options, result);
  result.arrays = compare_arrays(reference, mesh, options);
  return result;
}

}  // namespace cadmorph
