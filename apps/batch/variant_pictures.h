#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "apps/picture/picture_process.h"
#include "apps/pipeline/morph_job.h"

namespace cadmorph {

/// Small pictures of a batch's variants, one file each in a folder of the batch's, drawn one at a
/// time beside the job.
class VariantPictures {
 public:
  /// `batch`: the folder of the batch.
  explicit VariantPictures(const std::filesystem::path& batch) : folder_(batch / kFolder) {}

  /// Starts to draw a variant's result, once the one before is drawn. Throws OutputError when that
  /// one's file can't be written.
  void draw(const std::string& id, const MorphResult& result);

  /// Waits for the last. Throws as `draw` does.
  void finish();

  /// The picture of a variant; empty where there is none.
  std::string read(const std::string& id) const;

  /// Why a picture could not be drawn; empty where all could.
  const std::string& failure() const { return failure_; }

  static constexpr const char* kFolder = "pictures";

 private:
  std::filesystem::path file_of(const std::string& id) const { return folder_ / (id + ".png"); }

  std::filesystem::path folder_;
  std::string drawn_;  ///< id of what is being drawn
  std::unique_ptr<PictureProcess> drawing_;
  std::string failure_;
};

}  // namespace cadmorph
