#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/library/include/cadmorph/errors.h"

namespace cadmorph {

/// Refuses an output that can't be written or is one of the inputs, before any work is done: its
/// folder must exist and be writable, an existing file must be a regular one. Throws OutputError;
/// InvalidInputError when it is an input.
void check_output(const std::filesystem::path& output,
                  const std::vector<std::filesystem::path>& inputs);

/// The same for a mesh and the failed one that may be written in its place.
void check_mesh_output(const std::filesystem::path& output,
                       const std::vector<std::filesystem::path>& inputs);

/// Whether two paths, which need not exist, lead to one file.
bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// Where a morphed mesh goes when not told: `<stem>.morphed.<ext>` beside the mesh.
std::filesystem::path default_output(const std::filesystem::path& mesh);

/// `<stem>.failed.<ext>` beside `output`; `.vtu` for formats that can't mark cells.
std::filesystem::path failed_path(const std::filesystem::path& output);

/// `<stem><suffix>.vtu` beside `output`: for arrays that its format can't hold.
std::filesystem::path vtu_path(const std::filesystem::path& output, const std::string& suffix);

/// Returns the contents of a file. Throws IoError.
std::string read_bytes(const std::filesystem::path& path);

/// Calls what writes an output: its IoError becomes an OutputError.
template <class Write>
void as_output(Write&& write) {
  try {
    write();
  } catch (const IoError& error) {
    throw OutputError(error.what());
  }
}

/// Writes a small file whole or not at all: beside, then renamed. Throws OutputError.
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace cadmorph
