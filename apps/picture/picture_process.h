#pragma once

#include <sys/types.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/picture/picture_scene.h"
#include "apps/picture/scratch_folder.h"

namespace cadmorph {

/// What came of drawing.
struct DrawnPictures {
  std::map<std::string, std::string> bytes;  ///< PNG files by Picture::output; all or none
  std::string failure;                       ///< why there are none
};

/// Draws a scene beside the running job: in a program of its own, cadmorph-picture, since rendering
/// may abort the process.
class PictureProcess {
 public:
  /// Writes the surfaces and starts to draw. Throws nothing: a failure is told by `wait`.
  PictureProcess(const DrawnMesh& drawn, std::vector<Picture> pictures);
  ~PictureProcess();
  PictureProcess(const PictureProcess&) = delete;
  PictureProcess& operator=(const PictureProcess&) = delete;

  /// Waits for the pictures, two minutes at most.
  DrawnPictures wait();

 private:
  void begin(const DrawnMesh& drawn, std::vector<Picture> pictures);
  std::string wait_for_end();

  std::optional<ScratchFolder> folder_;
  std::vector<std::string> names_;  ///< Picture::output
  pid_t process_ = -1;
  std::string failure_;
};

}  // namespace cadmorph
