#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace cadmorph {

/// 128-bit hash (XXH3) of bytes, as 32 hexadecimal digits: tells whether contents are the same; no
/// protection against forgery.
std::string content_hash(std::string_view bytes);

/// The same of bytes that come piece after piece.
class ContentHasher {
 public:
  ContentHasher();
  ~ContentHasher();
  ContentHasher(const ContentHasher&) = delete;
  ContentHasher& operator=(const ContentHasher&) = delete;

  void add(std::string_view bytes);
  std::string hash() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The hash of a file's bytes. Throws IoError.
std::string file_hash(const std::filesystem::path& path);

/// The same, or for a folder (an OpenFOAM case) that of the names and bytes of the files in its
/// folders named polyMesh. Throws IoError.
std::string mesh_hash(const std::filesystem::path& path);

}  // namespace cadmorph
