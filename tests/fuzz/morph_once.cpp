// The main job without its command line, for the sanitizers: morph_once BASE.step VARIANT.step MESH
// OUT.

#include <cstdio>

#include "apps/pipeline/morph_files.h"

int main(int argc, char** argv) {
  if (argc != 5) return 1;
  const cadmorph::PipelineReport report = cadmorph::morph_files(
      {.base_cad = argv[1], .variant_cad = argv[2], .mesh = argv[3], .output = argv[4]});
  std::printf("%s\n", report.run.written.c_str());
  return report.outcome == cadmorph::Outcome::Done ? 0 : 5;
}
