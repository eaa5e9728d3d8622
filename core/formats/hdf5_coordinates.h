#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/formats/hdf5_file.h"

namespace cadmorph {

/// Coordinates of one component in a dataset of float32 or float64: every `step`-th number, in
/// row-major order, from `first` on.
struct Hdf5Run {
  std::string dataset;
  Index first = 0;
  Index step = 1;
  Index count = 0;
  int component = 0;
  Index first_node = 0;
  std::vector<Index> nodes = {};  ///< of each number; empty: first_node and those that follow
};

/// Reads the coordinates of `runs` into `points`, which has its rows (of a node with several, the
/// last counts), and returns what copies the file. In a copy, numbers stored as they are
/// (contiguous, or in uncompressed chunks of whole rows) are replaced in place, no other byte
/// changes; a dataset stored otherwise (compressed) is written anew when a number in it changes.
/// Throws IoError. Cost: one reading of the whole file.
std::unique_ptr<const MeshCopier> read_hdf5_coordinates(const Hdf5File& file,
                                                        const std::vector<Hdf5Run>& runs,
                                                        Points& points);

}  // namespace cadmorph
