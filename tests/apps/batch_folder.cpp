#include "batch_folder.h"

#include <sstream>

namespace cadmorph::testing {

namespace fs = std::filesystem;

std::map<std::string, nlohmann::json> rows_of(const Workplace& place, const std::string& folder,
                                              const std::string& stem) {
  std::istringstream lines(place.read(folder + "/" + stem + ".jsonl"));
  std::map<std::string, nlohmann::json> rows;
  for (std::string line; std::getline(lines, line);) {
    nlohmann::json row = nlohmann::json::parse(line);
    row.erase("seconds");
    rows[row["id"]] = row;
  }
  return rows;
}

std::map<std::string, std::string> meshes_of(const Workplace& place, const std::string& folder) {
  std::map<std::string, std::string> meshes;
  for (const auto& entry : fs::recursive_directory_iterator(place.folder() / folder))
    if (entry.path().extension() == ".vtu") {
      const std::string name = entry.path().lexically_relative(place.folder() / folder).string();
      meshes[name] = place.read(folder + "/" + name);
    }
  return meshes;
}

}  // namespace cadmorph::testing
