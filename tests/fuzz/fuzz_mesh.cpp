// Reads any bytes as a mesh file with the extension that --extension=EXT names (none: as a folder
// of OpenFOAM) and, where that succeeds, copies it with other coordinates: success, or an error of
// the project's own kind.

#include <algorithm>
#include <span>

#include "core/errors.h"
#include "core/formats/hdf5_file.h"
#include "core/mesh_file.h"
#include "fuzz_file.h"

using namespace cadmorph;

namespace {

std::string extension;

// A case is one text: the files of its polyMesh folder one after the other, a line "===" between.
std::filesystem::path put_case(const testing::FuzzFolder& folder, std::string_view text) {
  constexpr std::string_view kBetween = "===\n";
  std::filesystem::create_directories(folder / "case/constant/polyMesh");
  for (const std::string name :
       {"points", "faces", "owner", "neighbour", "boundary", "cellZones"}) {
    const std::size_t size = std::min(text.find(kBetween), text.size());
    folder.put("case/constant/polyMesh/" + name, text.substr(0, size));
    text.remove_prefix(std::min(size + kBetween.size(), text.size()));
  }
  return folder / "case";
}

void read_and_copy(const testing::FuzzFolder& folder, std::string_view bytes) {
  const MeshFile file(extension.empty() ? put_case(folder, bytes)
                                        : folder.put("mesh" + extension, bytes));
  const Index nodes = file.mesh().node_count();
  file.write(folder / ("copy" + extension), file.mesh().points + Points::Constant(nodes, 3, 1e-3));
}

}  // namespace

// VTK and HDF5 lose memory on damaged files.
extern "C" const char* __lsan_default_suppressions() { return "leak:libvtk\nleak:libhdf5\n"; }

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  constexpr std::string_view kOption = "--extension=";
  for (const std::string_view argument : std::span(*argv, static_cast<std::size_t>(*argc)))
    if (argument.starts_with(kOption)) extension = argument.substr(kOption.size());
  read_without_process();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    read_and_copy(testing::FuzzFolder(), testing::text_of(data, size));
  } catch (const Error&) {
  }
  return 0;
}
