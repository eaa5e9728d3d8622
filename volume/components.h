#pragma once

#include <vector>

#include "core/mesh.h"

namespace cadmorph {

/// A part of a mesh whose inside depends on its own surface nodes alone.
struct Component {
  std::vector<Index> surface;  ///< positions in the list of surface nodes
  std::vector<Index> volume;   ///< node ids
  Index loose = 0;             ///< the last so many of `volume` are nodes of no cell

  template <class Archive>
  void serialize(Archive& archive) {
    archive(surface, volume, loose);
  }
};

/// Splits a mesh into components: connected cells of one region, joined across regions where they
/// share a node that is not prescribed, and where one of `free_surface` (nodes of the surface that
/// are not prescribed) lies at the place of another node of the surface. Bodies in contact through
/// prescribed nodes are morphed one by one (Sieger et al. 2013, sect. 7) and agree on these. A node
/// of no cell, such as the reference node of a coupling, belongs to the component of the nearest
/// prescribed node. Prescribed nodes of shells beside solids are the last component.
/// `surface_nodes`: ids of the prescribed nodes. O(cells).
std::vector<Component> split_components(const Mesh& mesh, const std::vector<Index>& surface_nodes,
                                        const std::vector<Index>& free_surface = {});

}  // namespace cadmorph
