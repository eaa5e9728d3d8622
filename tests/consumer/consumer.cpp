// Morphs a mesh from a program that knows cadmorph by its installed package alone.

#include <cstdio>
#include <exception>

#include "apps/pipeline/pipeline.h"

int main(int argc, char** argv) {
  if (argc != 5) return 1;
  try {
    const cadmorph::PipelineReport report = cadmorph::morph_files(
        {.base_cad = argv[1], .variant_cad = argv[2], .mesh = argv[3], .output = argv[4]});
    std::printf("%lld nodes morphed\n", static_cast<long long>(report.nodes));
    return report.outcome == cadmorph::Outcome::Done ? 0 : 5;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
