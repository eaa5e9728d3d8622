#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cadmorph {

/// One variant of a batch.
struct Variant {
  std::string id;
  std::filesystem::path step;
  std::filesystem::path out;         ///< in the batch's folder
  std::vector<std::string> carried;  ///< values of VariantList::carried_columns
};

struct VariantList {
  std::vector<std::string> carried_columns;
  std::vector<Variant> variants;
};

/// The variants of STEP files: the id is the file's stem, the mesh `<id><extension>`. Throws
/// UsageError when two have the same id.
VariantList list_variants(const std::vector<std::filesystem::path>& steps,
                          const std::string& mesh_extension);

/// Reads a manifest: a CSV file whose first line names the columns: id, step, optional out, and any
/// others, which are carried. Relative STEP files are sought beside the manifest. Throws IoError,
/// and InvalidInputError for missing or doubled columns, short lines, ids that can't be file names,
/// outputs elsewhere, and ids or outputs that stand twice; each with the line.
VariantList read_manifest(const std::filesystem::path& manifest, const std::string& mesh_extension);

}  // namespace cadmorph
