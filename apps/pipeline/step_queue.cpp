#include "apps/pipeline/step_queue.h"

#include <algorithm>
#include <utility>

#include "cad/step_reader.h"

namespace fs = std::filesystem;

namespace cadmorph {

StepQueue::StepQueue(std::vector<fs::path> files, CadReader read)
    : files_(std::move(files)), read_(read ? std::move(read) : CadReader(read_step)) {
  for (const fs::path& file : files_) check_step_file(file);
  read_ahead();
}

CadModel StepQueue::next() {
  if (ready_.empty()) {
    ready_ = coming_.get();
    read_ahead();
  }
  CadModel model = std::move(ready_.front());
  ready_.pop_front();
  return model;
}

// As many as make the number left even: a base alone, then pairs.
void StepQueue::read_ahead() {
  const std::size_t left = files_.size() - at_;
  if (left == 0) return;
  const auto begin = files_.begin() + std::ptrdiff_t(at_);
  const std::vector<fs::path> paths(begin, begin + (left % 2 == 1 ? 1 : 2));
  at_ += paths.size();
  coming_ = std::async(std::launch::async, [paths, read = read_] {
    std::deque<CadModel> models;
    for (const fs::path& path : paths) models.push_back(read(path));
    return models;
  });
}

}  // namespace cadmorph
