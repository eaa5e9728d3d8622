#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

#include "apps/picture/picture_scene.h"
#include "apps/picture/scratch_folder.h"

namespace cadmorph {

/// Draws a scene beside the running job: in a program of its own, cadmorph-picture, since rendering
/// may abort the process.
class PictureProcess {
 public:
  /// Writes the surfaces and starts to draw. Throws what write_surfaces and write_scene throw.
  PictureProcess(const DrawnMesh& drawn, std::vector<Picture> pictures);
  ~PictureProcess();
  PictureProcess(const PictureProcess&) = delete;
  PictureProcess& operator=(const PictureProcess&) = delete;

  /// Waits for the pictures, two minutes at most. Returns why there are none; empty when all are
  /// there.
  std::string wait();

  /// The bytes of a picture drawn. Throws IoError.
  std::string png(const std::string& output) const;

 private:
  ScratchFolder folder_;
  pid_t process_ = -1;
  std::string failure_;
};

}  // namespace cadmorph
