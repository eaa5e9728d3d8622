#pragma once

#include <deque>
#include <filesystem>
#include <future>
#include <vector>

#include "cad/brep.h"

namespace cadmorph {

/// STEP models in the order of their files; two are read while those before are at work.
class StepQueue {
 public:
  /// Throws IoError where a file is missing.
  explicit StepQueue(std::vector<std::filesystem::path> files);

  /// Throws as read_step does.
  CadModel next();

 private:
  void read_ahead();

  std::vector<std::filesystem::path> files_;
  std::size_t at_ = 0;
  std::deque<CadModel> ready_;
  std::future<std::deque<CadModel>> coming_;
};

}  // namespace cadmorph
