#pragma once

#include <string>
#include <vector>

#include "core/mesh.h"
#include "tests/core/formats/format_checks.h"

namespace cadmorph::test {

/// What a polyMesh folder of OpenFOAM holds, faces of the boundary behind those inside.
struct FoamMesh {
  struct Patch {
    std::string name, type;
    Index start = 0, count = 0;
    std::string more = {};  ///< further entries
  };
  Points points;
  std::vector<std::vector<Index>> faces;
  std::vector<Index> owner, neighbour;
  std::vector<Patch> patches;
  std::vector<std::vector<Index>> cell_zones;  ///< named "zone0", "zone1", ...
  std::vector<Index> point_addressing, face_addressing, cell_addressing;
};

/// How OpenFOAM was built and told to write.
struct FoamStyle {
  bool is_binary = false;
  int label_bits = 32, scalar_bits = 64;
  bool is_big_endian = false;
  bool is_compressed = false;
};

/// A mesh of solid cells with the patches "left" (x = 0) and "rest".
FoamMesh foam_mesh(const Mesh& mesh);

/// What decomposePar makes of it: pieces of the cells with each number in `processors`.
std::vector<FoamMesh> decomposed(const FoamMesh& mesh, const std::vector<int>& processors);

/// Writes the files of a polyMesh folder ("case/constant/polyMesh").
void put_foam_mesh(const FormatFolder& folder, const std::string& poly_mesh, const FoamMesh& mesh,
                   const FoamStyle& style = {});

}  // namespace cadmorph::test
