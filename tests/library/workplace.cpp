#include "workplace.h"

#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace cadmorph::testing {

std::filesystem::path model(const std::string& path) {
  return std::filesystem::path(CADMORPH_SOURCE_DIR) / "models" / path;
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error("can't open " + path.string());
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

Workplace::Workplace() {
  std::string name = (std::filesystem::temp_directory_path() / "cadmorph-XXXXXX").string();
  if (!mkdtemp(name.data())) throw std::runtime_error("no folder for a test");
  folder_ = name;
}

Workplace::~Workplace() { std::filesystem::remove_all(folder_); }

int Workplace::run(const std::string& arguments) const {
  const std::string command = "cd '" + folder_.string() + "' && '" CADMORPH_PROGRAM "' " +
                              arguments + " > out.txt 2> err.txt";
  return WEXITSTATUS(std::system(command.c_str()));
}

}  // namespace cadmorph::testing
