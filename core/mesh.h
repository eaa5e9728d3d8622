#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/numbering.h"
#include "core/types.h"

namespace cadmorph {

/// Cell types by VTK's numbers. Node orders are VTK's. One type is not VTK's: see as_vtk_has_it.
enum class CellType : std::uint8_t {
  Vertex = 1,
  PolyVertex = 2,
  Line = 3,
  PolyLine = 4,
  Triangle = 5,
  Polygon = 7,
  Pixel = 8,
  Quad = 9,
  Tetra = 10,
  Voxel = 11,
  Hexahedron = 12,
  Wedge = 13,
  Pyramid = 14,
  QuadraticEdge = 21,
  QuadraticTriangle = 22,
  QuadraticQuad = 23,
  QuadraticTetra = 24,
  QuadraticHexahedron = 25,
  QuadraticWedge = 26,
  QuadraticPyramid = 27,
  BiquadraticQuad = 28,
  TriquadraticHexahedron = 29,
  QuadraticLinearQuad = 30,
  QuadraticLinearWedge = 31,
  BiquadraticQuadraticWedge = 32,
  BiquadraticQuadraticHexahedron = 33,
  BiquadraticTriangle = 34,
  BiquadraticQuadraticPyramid = 38,  ///< of 14 nodes, the last in the middle of the base
  Polyhedron = 42,
};

/// A part of the mesh that its file names: a marker, a patch, a physical group, a set.
struct NodeGroup {
  std::string name;
  std::string kind;          ///< in the words of the format: "marker", "patch", "node set"
  std::vector<Index> nodes;  ///< ascending, each once
  std::string partner = {};  ///< name of the group that the file says is a period apart
};

/// A node that its file ties to others, such as the reference node of a coupling.
struct Tie {
  Index node = 0;
  std::vector<Index> others;  ///< in any order
  bool operator==(const Tie&) const = default;
};

/// An unstructured mesh of any VTK cells: solid, shell, line and vertex cells may be mixed.
struct Mesh {
  Points points;                    ///< N x 3, in the file's own unit
  std::vector<CellType> types;      ///< one a cell
  std::vector<Index> offsets;       ///< cells + 1 positions in `connectivity`
  std::vector<Index> connectivity;  ///< node ids, cell after cell
  /// Faces of polyhedra: cells + 1 positions in `polyhedron_faces`, equal neighbours for other
  /// cells; empty when the mesh has no polyhedron.
  std::vector<Index> polyhedron_offsets;
  /// Per polyhedron: node count of its first face, that face's node ids, next count, ...
  std::vector<Index> polyhedron_faces;
  std::vector<int> regions;  ///< region id of each cell; empty when the mesh has no regions
  std::string region_array;  ///< name of the cell array that `regions` came from; may be empty
  /// Regions that may be no more than blocks, which the mesher needed, and the number of what the
  /// file names them with: those of one zone are told apart where the CAD has a face between them.
  std::map<int, int> zone_of_block = {};
  std::vector<NodeGroup> groups = {};  ///< in the file's order
  std::vector<Tie> ties = {};          ///< in the file's order
  /// Whether solvers take a cell for what its faces enclose, as finite volumes do: no map, no
  /// corners.
  bool is_of_finite_volumes = false;
  /// The numbers of nodes and cells in their file; empty where it has none but their order.
  Numbering node_numbers = {}, cell_numbers = {};

  Index node_count() const { return points.rows(); }
  Index cell_count() const { return static_cast<Index>(types.size()); }
  std::span<const Index> cell(Index c) const {
    return {connectivity.data() + offsets[c],
            static_cast<std::size_t>(offsets[c + 1] - offsets[c])};
  }
  int region(Index c) const { return regions.empty() ? 0 : regions[c]; }
};

/// "cell 17", counted from 0 in the file's order, and in brackets the number that the file gives
/// it: "cell 17 (element 4711 of the file)".
std::string cell_name(const Mesh& mesh, Index cell);

/// The same of a node: "node 17 (number 4711 of the file)".
std::string node_name(const Mesh& mesh, Index node);

/// Makes room for so many more cells, and more nodes of them all.
void reserve_cells(Mesh& mesh, Index cells, Index nodes);

/// Appends a cell. Its nodes are in VTK's order; a polyhedron needs add_polyhedron.
void add_cell(Mesh& mesh, CellType type, std::span<const Index> nodes);

/// Appends cells of one type: the nodes of the first, those of the second, and so on. Not for types
/// whose numbers of nodes vary.
void add_cells(Mesh& mesh, CellType type, std::vector<Index> nodes);

/// Appends all cells of a part of the mesh, whose ids of nodes are those of the mesh.
void append_cells(Mesh& mesh, const Mesh& part);

/// Appends a polyhedron of faces, each the ids of its nodes.
void add_polyhedron(Mesh& mesh, std::span<const std::vector<Index>> faces);

/// Sorts the nodes of each group and leaves out what is double.
void tidy_groups(Mesh& mesh);

/// Topological dimension of a cell type: 0 vertex, 1 line, 2 shell, 3 solid; -1 for a number that
/// is no CellType.
int dimension(CellType type);

/// Highest dimension of any cell of the mesh; -1 when it has none.
int dimension(const Mesh& mesh);

/// One face of a solid cell, or a shell cell itself.
struct Facet {
  CellType type;             ///< Triangle, Quad, Polygon or a quadratic form of the first two
  std::vector<Index> nodes;  ///< VTK order, corners first; the normal points out of a solid cell
};

/// Returns the faces of solid cell `c` with outward normals (for a cell of positive volume in VTK's
/// node order). Throws InvalidInputError for a cell that is no solid or of an unknown type.
std::vector<Facet> cell_facets(const Mesh& mesh, Index c);

/// Number of corner nodes at the front of a facet's node list (3 for a quadratic triangle).
int corner_count(CellType type, Index node_count);

/// Checks sizes, ids and finiteness; throws InvalidInputError that names the first offending node
/// or cell. An empty mesh is an error too.
void check_mesh(const Mesh& mesh);

}  // namespace cadmorph
