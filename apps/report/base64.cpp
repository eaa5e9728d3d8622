#include "apps/report/base64.h"

#include <algorithm>

extern "C" {
#include <b64/cencode.h>
}

namespace cadmorph {

std::string base64(std::string_view bytes) {
  base64_encodestate state;
  base64_init_encodestate(&state);
  std::string text(2 * bytes.size() + 8, '\0');  // line breaks included
  int length =
      base64_encode_block(bytes.data(), static_cast<int>(bytes.size()), text.data(), &state);
  length += base64_encode_blockend(text.data() + length, &state);
  text.resize(length);
  std::erase(text, '\n');
  return text;
}

}  // namespace cadmorph
