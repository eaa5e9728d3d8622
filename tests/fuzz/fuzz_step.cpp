// Reads any bytes as a STEP file: a model, or an error of the project's own kind.

#include "cad/step_reader.h"
#include "core/errors.h"
#include "fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    cadmorph::read_step_bytes(cadmorph::testing::text_of(data, size), "part.step");
  } catch (const cadmorph::Error&) {
  }
  return 0;
}
