#include "apps/picture/scratch_folder.h"

#include <cstdlib>
#include <system_error>

#include "apps/pipeline/output_file.h"

namespace cadmorph {

namespace fs = std::filesystem;

ScratchFolder::ScratchFolder() {
  std::error_code error;
  std::string pattern = (fs::temp_directory_path(error) / "cadmorph-XXXXXX").string();
  if (error || !mkdtemp(pattern.data()))
    throw OutputError("can't make a temporary folder " + pattern + "; set TMPDIR to a folder");
  path_ = pattern;
  removal_.emplace(path_);
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace cadmorph
