#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/formats/coordinate_places.h"
#include "core/formats/face_cells.h"
#include "core/mesh.h"

namespace cadmorph {

/// A patch of the boundary.
struct FoamPatch {
  std::string name;
  std::string type;  ///< "patch", "wall", "empty", "processor", ...
  std::vector<Index> faces;
  Index processor = -1;  ///< of a processor patch: its own and the other side's number
  Index other_processor = -1;
  std::string partner = {};    ///< of a cyclic patch: the other side's name
  std::string refers_to = {};  ///< of a part of a cyclic patch: the whole one's name
};

/// A zone of cells, faces or points.
struct FoamZone {
  std::string name;
  std::string kind;  ///< "cellZone", "faceZone" or "pointZone"
  std::vector<Index> members;
};

/// The points file of a polyMesh folder.
struct FoamPoints {
  SourceFile source;
  CoordinatePlaces places;
};

/// Where the points, faces and cells of a piece are in the whole mesh; empty where no file tells.
struct FoamAddressing {
  std::vector<Index> points;
  std::vector<Index> faces;  ///< 1-based; negative: the face is turned around
  std::vector<Index> cells;
};

/// What a polyMesh folder holds.
struct PolyMesh {
  std::filesystem::path folder;
  Points points;
  FoamPoints file;
  FaceList faces;
  Index cell_count = 0;
  std::vector<FoamPatch> patches;
  std::vector<FoamZone> zones;
  FoamAddressing addressing;
};

/// The file of that name, or the compressed one (".gz"); empty when there is neither.
std::filesystem::path find_foam_file(const std::filesystem::path& folder, const std::string& name);

/// Reads a polyMesh folder. Throws IoError.
PolyMesh read_poly_mesh(const std::filesystem::path& folder);

/// Reads nothing of it but the points and their addressing.
PolyMesh read_poly_mesh_points(const std::filesystem::path& folder);

/// The pieces of a decomposed mesh put together.
struct JoinedPieces {
  PolyMesh mesh;
  std::vector<std::vector<Index>> nodes;  ///< of the points of each piece
  std::vector<std::string> remarks;
};

/// Joins the pieces of processors 0, 1, ...: by their addressing to what the mesh was before it was
/// decomposed; where pieces have none, at their processor patches, piece after piece. Throws
/// IoError when they do not fit together.
JoinedPieces join_pieces(std::vector<PolyMesh> pieces);

/// The nodes of a whole mesh that the points of a piece are, by its addressing. Throws IoError when
/// the two are not of the same mesh; adds a remark where points differ by rounding.
std::vector<Index> nodes_of_piece(const PolyMesh& whole, const PolyMesh& piece,
                                  std::vector<std::string>& remarks);

/// The cells, patches and zones as a mesh. Zones that hold each cell once are its regions.
Mesh to_mesh(PolyMesh&& poly_mesh);

}  // namespace cadmorph
