#include "core/content_hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <system_error>
#include <vector>

#include "core/errors.h"

namespace cadmorph {
namespace {

constexpr std::size_t kBlock = 1 << 18;  // bytes read at once: they stay in the cache

std::string to_hex(const XXH128_hash_t& hash) {
  XXH128_canonical_t bytes;
  XXH128_canonicalFromHash(&bytes, hash);
  std::string text;
  for (const unsigned char byte : bytes.digest)
    for (const int digit : {byte >> 4, byte & 15}) text += "0123456789abcdef"[digit];
  return text;
}

[[noreturn]] void fail(const std::filesystem::path& path) {
  throw IoError(path.string() + ": can't be read (" + std::strerror(errno) + ")");
}

}  // namespace

std::string content_hash(std::string_view bytes) {
  return to_hex(XXH3_128bits(bytes.data(), bytes.size()));
}

struct ContentHasher::State {
  std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> xxh3{XXH3_createState(),
                                                                       XXH3_freeState};
};

ContentHasher::ContentHasher() : state_(std::make_unique<State>()) {
  XXH3_128bits_reset(state_->xxh3.get());
}

ContentHasher::~ContentHasher() = default;

void ContentHasher::add(std::string_view bytes) {
  XXH3_128bits_update(state_->xxh3.get(), bytes.data(), bytes.size());
}

std::string ContentHasher::hash() const { return to_hex(XXH3_128bits_digest(state_->xxh3.get())); }

std::string file_hash(const std::filesystem::path& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(
      std::fopen(path.c_str(), "rb"), [](std::FILE* f) { return std::fclose(f); });
  if (!file) fail(path);
  ContentHasher hasher;
  std::vector<char> block(kBlock);
  while (const std::size_t count = std::fread(block.data(), 1, kBlock, file.get()))
    hasher.add({block.data(), count});
  if (std::ferror(file.get())) fail(path);
  return hasher.hash();
}

std::string mesh_hash(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (!fs::is_directory(path, error)) return file_hash(path);
  std::map<std::string, fs::path> files;
  for (fs::recursive_directory_iterator entry(path, error), end; entry != end;
       entry.increment(error))
    if (entry->is_regular_file(error) &&
        fs::canonical(entry->path().parent_path(), error).filename() == "polyMesh")
      files.emplace(fs::relative(entry->path(), path, error).generic_string(), entry->path());
  if (error) throw IoError(path.string() + ": can't be read (" + error.message() + ")");
  ContentHasher hasher;
  for (const auto& [name, file] : files) hasher.add(name + "\n" + file_hash(file) + "\n");
  return hasher.hash();
}

}  // namespace cadmorph
