// Reads any bytes as each table that users write (face map, manifest, parameters, sensitivities)
// and as each file that a batch reads back: success, or an error of the project's own kind.

#include "apps/batch/batch_results.h"
#include "apps/batch/sensitivity_files.h"
#include "cad/topology_match.h"
#include "core/errors.h"
#include "fuzz_file.h"

using namespace cadmorph;

namespace {

void try_out(const auto& read) {
  try {
    read();
  } catch (const Error&) {
  }
}

MeshFile read_triangle() {
  const testing::FuzzFolder folder;
  return MeshFile(folder.put("triangle.su2",
                             "NDIME= 2\nNELEM= 1\n5 0 1 2 0\nNPOIN= 3\n0 0 0\n1 0 1\n0 1 2\n"
                             "NMARK= 0\n"));
}

void read_batch(const testing::FuzzFolder& folder, std::string_view bytes) {
  const std::filesystem::path batch = folder / "batch";
  std::filesystem::create_directory(batch);
  folder.put("batch/batch.json", bytes);
  folder.put("batch/results.jsonl", bytes);
  const BatchFolder results(batch, {});
  try_out([&] { results.read_list(); });
  try_out([&] { results.read_identity(); });
  try_out([&] { results.read_rows(); });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const MeshFile triangle = read_triangle();
  const testing::FuzzFolder folder;
  const std::string_view bytes = testing::text_of(data, size);
  const std::filesystem::path table = folder.put("table.csv", bytes);
  try_out([&] { read_face_map(table); });
  try_out([&] { read_manifest(table, ".vtu"); });
  try_out([&] { read_parameters(table); });
  try_out([&] { read_sensitivity(table, "", triangle); });
  read_batch(folder, bytes);
  return 0;
}
