#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cadmorph::bench {

/// A CSV file that grows by groups of rows and keeps what an earlier run wrote. No field may hold a
/// comma, a quote or a line break.
class ResultsFile {
 public:
  /// Begins the file with `header`, or goes on with one that begins so. Throws IoError when it
  /// can't be written or is something else.
  ResultsFile(std::filesystem::path path, const std::vector<std::string>& header);

  /// Whether a row begins with these fields.
  bool has(const std::vector<std::string>& first_fields) const;

  /// Appends rows and flushes. Throws IoError.
  void append(const std::vector<std::vector<std::string>>& rows);

 private:
  std::filesystem::path path_;
  std::vector<std::string> lines_;
};

/// A text fit for a field: commas, quotes and line breaks replaced.
std::string field(std::string text);

}  // namespace cadmorph::bench
