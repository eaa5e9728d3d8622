#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/quality_checks.h"

namespace cadmorph {

/// How a surface is coloured: by one of its arrays, or all alike.
enum class Colouring { Plain, Scale, ReversedScale, Marks };

/// One view of a surface.
struct Panel {
  std::string surface;    ///< .vtu file in the scene's folder
  bool is_moved = false;  ///< drawn at its positions plus its point array "displacement"
  Colouring colouring = Colouring::Plain;
  std::string array;  ///< that colours; a cell array, or the length of "displacement"
  std::string title, subtitle;
  bool is_cut = false;  ///< has ragged edges, outlined thinly
};

/// A picture file of one or more panels.
struct Picture {
  std::string output;  ///< .png file in the scene's folder
  int width = 1600, height = 1200;
  int columns = 1;  ///< of panels, row by row
  bool is_transparent = false;
  std::string bar_title;     ///< of the colour bar; none when empty
  double low = 0, high = 1;  ///< values at the ends of the colours
  std::vector<Panel> panels;
};

/// Pictures that share one camera, and a folder.
struct Scene {
  int cut_axis = 1;  ///< the camera looks along it
  std::vector<Picture> pictures;
};

/// A mesh to be drawn at one set of positions or at two.
struct DrawnMesh {
  const Mesh& mesh;
  const CellNeighbours& neighbours;
  const QualityReport& before;
  const Points* moved = nullptr;         ///< N x 3; null: the mesh as it is, alone
  const QualityReport* after = nullptr;  ///< goes with `moved`
  std::string unit = "mm";               ///< of the coordinates, for labels
  int cut_axis = 1;
  /// Cells outside are not drawn; the worst 5 % and all figures are the whole mesh's.
  std::optional<Eigen::AlignedBox3d> box = {};
};

/// Writes the surfaces a scene of `drawn` needs into `folder`: surface.vtu and cut.vtu, the cells
/// that reach above the middle, of mesh or box, along the cut axis. Where a small part of a large
/// surface moved, a body in a far field, only what lies around that part.
void write_surfaces(const DrawnMesh& drawn, const std::filesystem::path& folder);

/// One picture for a quick look. Of a morph: before and after, the surface coloured by displacement
/// or, if `is_quality`, by scaled Jacobian; below, cut open with the worst 5 % of the elements in
/// red. Of a mesh alone: its surface coloured by scaled Jacobian, and the cut.
Picture overview(const DrawnMesh& drawn, bool is_quality = false);

/// The pictures of the report, without words: base.png, variant.png, displacement.png and cut.png.
std::vector<Picture> separate_pictures(const DrawnMesh& drawn);

/// The small picture of an overview: the moved surface, coloured by displacement.
Picture thumbnail(const DrawnMesh& drawn);

/// scene.json in `folder`. Throw what write_text does; IoError, InvalidInputError.
void write_scene(const std::filesystem::path& folder, const Scene& scene);
Scene read_scene(const std::filesystem::path& folder);

}  // namespace cadmorph
