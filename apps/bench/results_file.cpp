#include "apps/bench/results_file.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include "core/errors.h"

namespace cadmorph::bench {
namespace {

std::string line_of(const std::vector<std::string>& fields) {
  std::string line;
  for (std::size_t i = 0; i < fields.size(); ++i) line += (i ? "," : "") + fields[i];
  return line;
}

}  // namespace

ResultsFile::ResultsFile(std::filesystem::path path, const std::vector<std::string>& header)
    : path_(std::move(path)) {
  std::ifstream existing(path_);
  for (std::string line; std::getline(existing, line);) lines_.push_back(line);
  if (lines_.empty())
    append({header});
  else if (lines_.front() != line_of(header))
    throw IoError(path_.string() + " holds something else; name another file");
}

bool ResultsFile::has(const std::vector<std::string>& first_fields) const {
  const std::string start = line_of(first_fields) + ",";
  return std::ranges::any_of(lines_, [&](const auto& line) { return line.starts_with(start); });
}

void ResultsFile::append(const std::vector<std::vector<std::string>>& rows) {
  std::ofstream file(path_, std::ios::app);
  for (const auto& row : rows) {
    lines_.push_back(line_of(row));
    file << lines_.back() << '\n';
  }
  file.close();
  if (!file) throw IoError("can't write " + path_.string());
}

std::string field(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return c == '\n' || c == '\r'; }, ' ');
  std::ranges::replace(text, ',', ';');
  std::ranges::replace(text, '"', '\'');
  return text;
}

}  // namespace cadmorph::bench
