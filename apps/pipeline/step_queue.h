#pragma once

#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <vector>

#include "cad/brep.h"

namespace cadmorph {

/// Reads a CAD model as read_step does; empty: read_step. Called by one thread at a time.
using CadReader = std::function<CadModel(const std::filesystem::path& path)>;

/// STEP models in the order of their files; two are read while those before are at work.
class StepQueue {
 public:
  /// Throws IoError where a file is missing.
  explicit StepQueue(std::vector<std::filesystem::path> files, CadReader read = {});

  /// Throws as the reader does.
  CadModel next();

 private:
  void read_ahead();

  std::vector<std::filesystem::path> files_;
  CadReader read_;
  std::size_t at_ = 0;
  std::deque<CadModel> ready_;
  std::future<std::deque<CadModel>> coming_;
};

}  // namespace cadmorph
