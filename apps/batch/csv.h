#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace cadmorph {

struct CsvRecord {
  std::vector<std::string> fields;
  int line = 0;  ///< that it ends on, from 1
};

/// Reads a comma-separated file (RFC 4180). Blank lines are left out, a byte order mark too; blanks
/// round an unquoted field don't count. Throws IoError when the file can't be read,
/// InvalidInputError where its quotes don't fit.
std::vector<CsvRecord> read_csv(const std::filesystem::path& path);

/// One record as a line with its end; fields are quoted where they must be.
std::string csv_line(const std::vector<std::string>& fields);

}  // namespace cadmorph
