#pragma once

#include <vtkDataWriter.h>
#include <vtkXMLWriter.h>

#include <filesystem>
#include <string>

namespace cadmorph {

/// What a copy of the file must share with it.
struct Layout {
  bool is_xml = true;
  int data_mode = vtkXMLWriter::Appended;
  int compressor = vtkXMLWriter::NONE;
  bool has_long_headers = true;  ///< 64-bit block headers
  bool is_appended_base64 = false;
  int legacy_version = vtkDataWriter::VTK_LEGACY_READER_VERSION_5_1;
};

/// The layout of a .vtu file, from its first tags. Throws IoError when it holds another data set.
Layout xml_layout(const std::filesystem::path& path);

}  // namespace cadmorph
