#include "apps/pipeline/loaded_libraries.h"

#include <elf.h>
#include <link.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <vector>

#include "core/content_hash.h"

namespace cadmorph {
namespace {

struct Library {
  std::filesystem::path path;
  std::string id;  ///< bytes; empty when it has none
};

std::string_view id_in_notes(const char* notes, std::size_t size) {
  const auto padded = [](std::size_t bytes) { return (bytes + 3) / 4 * 4; };
  for (std::size_t at = 0; at + sizeof(ElfW(Nhdr)) <= size;) {
    ElfW(Nhdr) note;
    std::memcpy(&note, notes + at, sizeof note);
    const char* name = notes + at + sizeof note;
    const char* value = name + padded(note.n_namesz);
    if (note.n_type == NT_GNU_BUILD_ID &&
        std::string_view(name, note.n_namesz) == std::string_view("GNU", 4))
      return {value, note.n_descsz};
    at += sizeof note + padded(note.n_namesz) + padded(note.n_descsz);
  }
  return {};
}

// The program itself and what the kernel maps into it have no path.
int take_library(dl_phdr_info* info, std::size_t, void* libraries) {
  if (!std::strchr(info->dlpi_name, '/')) return 0;
  Library library{.path = info->dlpi_name, .id = {}};
  for (int i = 0; i < info->dlpi_phnum && library.id.empty(); ++i) {
    const ElfW(Phdr)& part = info->dlpi_phdr[i];
    if (part.p_type == PT_NOTE)
      library.id =
          id_in_notes(reinterpret_cast<const char*>(info->dlpi_addr + part.p_vaddr), part.p_memsz);
  }
  static_cast<std::vector<Library>*>(libraries)->push_back(std::move(library));
  return 0;
}

}  // namespace

std::string loaded_libraries() {
  std::vector<Library> libraries;
  dl_iterate_phdr(take_library, &libraries);
  std::vector<std::string> texts;
  for (const Library& library : libraries)
    texts.push_back(library.path.filename().string() + " " +
                    (library.id.empty() ? file_hash(library.path) : content_hash(library.id)));
  std::ranges::sort(texts);
  std::string all;
  for (const std::string& text : texts) all += text + "\n";
  return content_hash(all);
}

}  // namespace cadmorph
