#pragma once

#include <filesystem>

namespace cadmorph::bench {

/// Writes the data of two demonstrations of Sieger et al. 2013 to `folder`: plane.csv, a plane of
/// which a disc is raised and the rim held, by the biharmonic and the triharmonic warp (Fig. 1);
/// block_nodes.csv and block_triangles.csv, a block moved within a plane mesh in one step and in as
/// few steps as leave no triangle inverted (Fig. 8, top). Throws IoError.
void write_demonstrations(const std::filesystem::path& folder);

}  // namespace cadmorph::bench
