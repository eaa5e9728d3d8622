#include "apps/summary/json_text.h"

#include <cmath>

#include "apps/version.h"

namespace cadmorph {

using Json = nlohmann::ordered_json;

Json json_header(int exit_code) {
  return {{"program", "cadmorph"}, {"version", kVersion}, {"exit_code", exit_code}};
}

Json json_number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::string json_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace cadmorph
