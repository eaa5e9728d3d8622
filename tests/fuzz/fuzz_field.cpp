// Reads any bytes as the contents of a field file, made to look undamaged by their size and
// checksum: success, or an error of the project's own kind.

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <cstring>

#include "core/errors.h"
#include "fuzz_file.h"
#include "volume/field_file.h"

using namespace cadmorph;

namespace {

// After the mark's line: the byte order, the format (4 bytes), the size (8), the checksum (8).
std::string mended(std::string bytes) {
  const std::size_t line = bytes.find('\n');
  constexpr std::size_t kSize = 1 + 1 + 4, kChecksum = kSize + 8, kEnd = kChecksum + 8;
  if (line == std::string::npos || bytes.size() < line + kEnd) return bytes;
  const char* contents = bytes.data() + line + kEnd;
  const std::uint64_t size = bytes.size() - line - kEnd, checksum = XXH3_64bits(contents, size);
  std::memcpy(bytes.data() + line + kSize, &size, sizeof size);
  std::memcpy(bytes.data() + line + kChecksum, &checksum, sizeof checksum);
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing::FuzzFolder folder;
  const std::string bytes = mended(std::string(testing::text_of(data, size)));
  try {
    read_field(folder.put("field.cmf", bytes));
  } catch (const Error&) {
  }
  return 0;
}
