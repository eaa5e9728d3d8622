#pragma once

#include "core/cell_faces.h"
#include "core/mesh.h"

namespace cadmorph {

/// What a morph did to the first cells of layers (nodes_of_layers) that moved, also on surface that
/// rests; where a mesh has no layers, to all that stand on surface that moved: prisms and hexahedra
/// with one face on it, or in a plane mesh triangles and quads with one edge. A face does not count
/// where the one opposite to it is outside, too: that of a mesh of one layer. Here and below faces
/// between cells of two regions are as much of the surface as those of the outside.
struct LayerFigures {
  Index cells = 0;             ///< such first cells; the rest counts only where there are some
  bool are_of_layers = false;  ///< false: all that stand there
  double share_kept = 1;       ///< whose height changed by at most 1 %
  double least = 1, most = 1;  ///< new height over old one
  double growth_before = 0;    ///< mean of the second cell's height over the first one's
  double growth_after = 0;     ///< 0: no cell stands on another
  /// Whether the cells are layers, which grow from the surface on.
  bool are_growing() const;
  /// Angle of a cell's axis to its face's normal, degrees: mean of the twentieth that leans most.
  double lean_before = 0, lean_after = 0;
};

/// Compares heights (between the middles of a cell's two faces, along the lower one's normal) at
/// `before` and `after`, N x 3. `is_surface`: one a node. Cells count where a node of their face
/// on the surface moved, or one of the other face by more than a hundredth of their height; where a
/// mesh has no layers, those on what moved that are at most 1.5 times as high as its shortest edge.
/// O(cells).
LayerFigures measure_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                            const std::vector<char>& is_surface, const Points& before,
                            const Points& after);

/// Mean size of log(new height / old one) of the first cells of layers, also where the surface
/// rests; 0 of those that changed by at most 1 %. Arguments and cost as in measure_layers.
double change_of_heights(const Mesh& mesh, const CellNeighbours& neighbours,
                         const std::vector<char>& is_surface, const Points& before,
                         const Points& after);

/// Which layers count.
enum class LayerGrowth {
  Any,
  Marked  ///< of a tenth at least from cell to cell
};

/// The nodes of layers that grow from the surface: on each first cell stands another that is at
/// least a tenth higher, and on that one a third that is higher at the same rate; or at a smaller
/// rate so many that the last is twice as high as the first. Cells at most half as high as the
/// shortest edge of their face on the surface tell of a layer; higher ones, and those that grow by
/// half as much, belong to it where they go on from it. A layer goes up to where the rate changes
/// or cells are higher than they are wide.
struct LayerNodes {
  std::vector<Index> all;   ///< ascending
  std::vector<Index> feet;  ///< of these, what the layers stand on, ascending
};
/// Of a mesh with points N x 3; `is_surface`: one a node. O(cells).
LayerNodes nodes_of_layers(const Mesh& mesh, const CellNeighbours& neighbours,
                           const std::vector<char>& is_surface, const Points& points,
                           LayerGrowth growth = LayerGrowth::Any);

/// Nodes of a layer that stand one above the other on a node of the surface.
struct LayerColumn {
  Index foot;
  std::vector<Index> nodes;  ///< from the foot upwards
};

/// Layers (see nodes_of_layers) as columns. A node that stands on two others, where layers of two
/// walls meet, is in none, nor is what stands on it.
struct LayerColumns {
  std::vector<LayerColumn> columns;  ///< by foot, ascending
  /// Corners of the faces that cells of the layers stand on, the normal away from the cells; of a
  /// plane mesh edges, `axis` x edge away from the cells.
  std::vector<std::vector<Index>> floors;
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();  ///< of a plane mesh's normal
};
LayerColumns find_layer_columns(const Mesh& mesh, const CellNeighbours& neighbours,
                                const std::vector<char>& is_surface, const Points& points,
                                LayerGrowth growth = LayerGrowth::Any);

/// Where the columns' nodes come when they keep their heights over the floors round their feet, and
/// turn with these. `before`, `after`: N x 3; returns `after` with these nodes moved.
Points carry_columns(const LayerColumns& layers, const Points& before, const Points& after);

}  // namespace cadmorph
