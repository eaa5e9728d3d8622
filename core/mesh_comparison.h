#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/mesh_file.h"

namespace cadmorph {

struct CompareOptions {
  /// Largest distance between two positions of a node, in the node's shortest edge of the
  /// reference; and of floating-point values, in the largest magnitude of their array.
  double tolerance = 1e-6;
  std::optional<double> absolute;    ///< of positions instead, in the mesh's unit
  std::vector<std::string> ignored;  ///< names of arrays left out
  std::size_t listed = 10;           ///< nodes listed at most
};

/// A node that is elsewhere.
struct NodeDifference {
  Index node = 0;
  double distance = 0;  ///< in the mesh's unit
  double edge = 0;      ///< its shortest edge in the reference
};

/// An array that is missing, new, of another kind or with other values.
struct ArrayDifference {
  std::string name;
  ArrayLocation location = ArrayLocation::Point;
  std::string what = {};  ///< in words
  Index differing = 0;    ///< rows
  Index worst_row = -1;   ///< of the largest difference; -1 where values were not compared
  double largest = 0;
};

struct MeshComparison {
  /// What is wrong with cells or counts, in words; positions are compared when the node counts
  /// agree, arrays in any case.
  std::vector<std::string> structure;
  Index moved_nodes = 0;              ///< further than the tolerance
  double largest_distance = 0;        ///< over all nodes, in the mesh's unit
  std::vector<NodeDifference> nodes;  ///< the worst, those furthest beyond the tolerance first
  std::vector<ArrayDifference> arrays;
  Points displacement;  ///< mesh minus reference, N x 3; empty where the node counts differ

  bool is_same() const { return structure.empty() && moved_nodes == 0 && arrays.empty(); }
};

/// Compares cells (types, nodes, polyhedron faces), node positions, and arrays by name, type, shape
/// and values: integers and texts exactly, floating-point values within the tolerance; NaN equals
/// NaN. O(nodes + cells + values).
MeshComparison compare_meshes(const MeshFile& reference, const MeshFile& mesh,
                              const CompareOptions& options = {});

}  // namespace cadmorph
