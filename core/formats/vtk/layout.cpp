#include "core/formats/vtk/layout.h"

#include <cctype>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

#include "core/formats/mesh_format.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

/// Finds XML start tags in a file that may hold gigabytes of data between them.
class TagScanner {
 public:
  explicit TagScanner(const fs::path& path) : stream_(path, std::ios::binary) {}

  /// Returns the next start tag that begins with `opening` ("<Points"), or nothing at the end.
  std::optional<std::string> next(std::string_view opening) {
    std::size_t begin;
    while ((begin = window_.find(opening)) == std::string::npos) {
      if (window_.size() > opening.size()) window_.erase(0, window_.size() - opening.size());
      if (!read_more()) return std::nullopt;
    }
    window_.erase(0, begin);
    std::size_t end;
    while ((end = window_.find('>')) == std::string::npos)
      if (!read_more()) return std::nullopt;
    std::string tag = window_.substr(0, end);
    window_.erase(0, end);
    return tag;
  }

 private:
  bool read_more() {
    constexpr std::streamsize kBytes = 1 << 20;  // a read: the window is a part of the file
    const auto size = window_.size();
    window_.resize(size + kBytes);
    stream_.read(window_.data() + size, kBytes);
    window_.resize(size + static_cast<std::size_t>(stream_.gcount()));
    return window_.size() > size;
  }

  std::ifstream stream_;
  std::string window_;
};

/// Value of an attribute in the text of a start tag; empty when it has none.
std::string attribute(const std::string& tag, const std::string& name) {
  for (std::size_t at = tag.find(name); at != std::string::npos; at = tag.find(name, at + 1)) {
    if (at == 0 || !std::isspace(static_cast<unsigned char>(tag[at - 1]))) continue;
    const auto equals = tag.find_first_not_of(" \t\r\n", at + name.size());
    if (equals == std::string::npos || tag[equals] != '=') continue;
    const auto open = tag.find_first_of("\"'", equals);
    if (open == std::string::npos) continue;
    const auto close = tag.find(tag[open], open + 1);
    if (close == std::string::npos) continue;
    return tag.substr(open + 1, close - open - 1);
  }
  return {};
}

int compressor_of(const std::string& name) {
  if (name == "vtkZLibDataCompressor") return vtkXMLWriter::ZLIB;
  if (name == "vtkLZ4DataCompressor") return vtkXMLWriter::LZ4;
  if (name == "vtkLZMADataCompressor") return vtkXMLWriter::LZMA;
  return vtkXMLWriter::NONE;
}

}  // namespace

Layout xml_layout(const fs::path& path) {
  TagScanner scanner(path);
  const std::string file = scanner.next("<VTKFile").value_or("");
  if (const std::string type = attribute(file, "type"); type != "UnstructuredGrid")
    fail_reading(path, "it holds a VTK " + (type.empty() ? "data set of no type" : type) +
                           ", not an UnstructuredGrid; convert it to an unstructured grid");
  Layout layout;
  layout.compressor = compressor_of(attribute(file, "compressor"));
  layout.has_long_headers = attribute(file, "header_type") == "UInt64";
  std::string format;
  if (scanner.next("<Points"))
    format = attribute(scanner.next("<DataArray").value_or(""), "format");
  if (format == "ascii") layout.data_mode = vtkXMLWriter::Ascii;
  if (format == "binary") layout.data_mode = vtkXMLWriter::Binary;
  if (format == "appended")
    layout.is_appended_base64 =
        attribute(scanner.next("<AppendedData").value_or(""), "encoding") == "base64";
  return layout;
}

}  // namespace cadmorph
