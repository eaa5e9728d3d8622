#include "volume/field_file.h"

#include "core/archive_types.h"
#include "core/checked_file.h"

namespace cadmorph {
namespace {

const FileKind kFieldFile{.mark = "cadmorph deformation field\n",
                          .format = kFieldFormat,
                          .name = "field file",
                          .remedy = "make the field anew"};

}  // namespace

void write_field(const std::filesystem::path& path, const DeformationTerms& terms) {
  write_checked_file(path, kFieldFile, [&](OutputArchive& archive) { archive(terms); });
}

DeformationTerms read_field(const std::filesystem::path& path) {
  DeformationTerms terms;
  read_checked_file(path, kFieldFile, [&](InputArchive& archive) { archive(terms); });
  return terms;
}

}  // namespace cadmorph
