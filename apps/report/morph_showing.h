#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/picture/picture_process.h"
#include "apps/report/report_page.h"

namespace cadmorph {

/// What shows a morph to people; empty paths are left out.
struct ShowFiles {
  std::filesystem::path report;   ///< .html
  std::filesystem::path picture;  ///< .png

  bool is_empty() const { return report.empty() && picture.empty(); }
};

/// What came of showing a morph.
struct ShowReport {
  ShowFiles written;  ///< empty paths: not asked for, or not possible
  std::vector<std::string> warnings;
  std::vector<std::string> failures;  ///< of files that could be made but not written
};

/// The report page and the picture of one morph, in the making.
class MorphShowing {
 public:
  explicit MorphShowing(ShowFiles files) : files_(std::move(files)) {}

  /// Takes what is to be shown from the result and starts to draw. Call before the job is gone.
  /// Throws nothing, for the result is yet to be written: failures are told by `write`.
  void collect(const MorphResult& result);

  /// Waits for the pictures and writes the files. What can't be drawn is left out and told in the
  /// warnings.
  ShowReport write(PipelineReport& report, int exit_code);

 private:
  void draw(const MorphResult& result);
  void describe(const MorphResult& result);

  ShowFiles files_;
  std::string overview_;  ///< name of the picture for `files_.picture`
  std::string failure_;   ///< of `collect`
  std::optional<PictureProcess> drawing_;
  PageContents contents_;
};

}  // namespace cadmorph
