#include "core/checked_file.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>
#include <streambuf>
#include <vector>

#include "core/archive_types.h"
#include "core/errors.h"
#include "core/temporary_file.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBlock = 1 << 18;  // bytes at once: they stay in the cache

struct Header {
  std::uint32_t format = 0;
  std::uint64_t size = 0, checksum = 0;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(format, size, checksum);
  }
};

class Checksum {
 public:
  Checksum() : state_(XXH3_createState(), XXH3_freeState) { XXH3_64bits_reset(state_.get()); }
  void add(const char* data, std::size_t size) { XXH3_64bits_update(state_.get(), data, size); }
  std::uint64_t value() const { return XXH3_64bits_digest(state_.get()); }

 private:
  std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state_;
};

// Writes to a file from a place on, and sums up what it writes.
class SummedOutput : public std::streambuf {
 public:
  SummedOutput(TemporaryFile& file, std::size_t place) : file_(file), place_(place) {
    block_.reserve(kBlock);
  }

  // Writes what is left. Returns the figures of all.
  Header finish() {
    flush();
    return {.size = size_, .checksum = checksum_.value()};
  }

 protected:
  std::streamsize xsputn(const char* data, std::streamsize size) override {
    const auto count = static_cast<std::size_t>(size);
    if (block_.size() + count > kBlock) flush();
    if (count > kBlock)
      put(data, count);
    else
      block_.insert(block_.end(), data, data + count);
    return size;
  }

  int_type overflow(int_type character) override {
    const char byte = traits_type::to_char_type(character);
    xsputn(&byte, 1);
    return character;
  }

 private:
  void flush() {
    put(block_.data(), block_.size());
    block_.clear();
  }

  void put(const char* data, std::size_t size) {
    checksum_.add(data, size);
    file_.write(data, size, static_cast<off_t>(place_ + size_));
    size_ += size;
  }

  TemporaryFile& file_;
  std::size_t place_, size_ = 0;
  std::vector<char> block_;
  Checksum checksum_;
};

const cereal::PortableBinaryOutputArchive::Options kBytes =
    cereal::PortableBinaryOutputArchive::Options::LittleEndian();

std::string front(const FileKind& kind, Header header) {
  std::ostringstream stream;
  stream << kind.mark;
  header.format = kind.format;
  OutputArchive(stream, kBytes)(header);
  return stream.str();
}

/// Bounds what is read while it lives.
class Limit {
 public:
  explicit Limit(std::uint64_t bytes) { archive_bytes = bytes; }
  ~Limit() { archive_bytes = std::numeric_limits<std::uint64_t>::max(); }
  Limit(const Limit&) = delete;
  Limit& operator=(const Limit&) = delete;
};

[[noreturn]] void refuse(const fs::path& path, const std::string& why) {
  throw IoError("can't read " + path.string() + ": " + why);
}

std::ifstream open(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::error_code error;
  if (!file || fs::is_directory(path, error))
    refuse(path, fs::exists(path, error)
                     ? (fs::is_directory(path, error) ? "it is a folder" : std::strerror(errno))
                     : "there is no such file");
  return file;
}

void check_format(const fs::path& path, const FileKind& kind, unsigned format) {
  if (format == kind.format) return;
  refuse(path, "its format is " + std::to_string(format) + ", and this program reads format " +
                   std::to_string(kind.format) +
                   (format > kind.format ? ": a newer cadmorph wrote it; use that one, or "
                                         : ": an older cadmorph wrote it; ") +
                   kind.remedy);
}

// Leaves the file at the beginning of the contents.
Header read_header(const fs::path& path, const FileKind& kind, std::ifstream& file) {
  std::string mark(kind.mark.size(), '\0');
  file.read(mark.data(), static_cast<std::streamsize>(mark.size()));
  if (mark != kind.mark) refuse(path, "it is no " + kind.name + "; " + kind.remedy);
  Header header;
  try {
    InputArchive archive(file);
    archive(header.format);
    check_format(path, kind, header.format);
    archive(header.size, header.checksum);
  } catch (const cereal::Exception&) {
    refuse(path, "it ends within its header; " + kind.remedy);
  }
  return header;
}

void check_contents(const fs::path& path, const FileKind& kind, const Header& header,
                    std::ifstream& file) {
  Checksum checksum;
  std::uint64_t size = 0;
  std::vector<char> block(kBlock);
  while (file.read(block.data(), kBlock) || file.gcount() > 0) {
    checksum.add(block.data(), static_cast<std::size_t>(file.gcount()));
    size += static_cast<std::uint64_t>(file.gcount());
  }
  if (size != header.size)
    refuse(path, "it holds " + std::to_string(size) + " bytes in place of the " +
                     std::to_string(header.size) + " written; " + kind.remedy);
  if (checksum.value() != header.checksum)
    refuse(path, "its checksum does not fit: it is damaged; " + kind.remedy);
  file.clear();
}

}  // namespace

void write_checked_file(const fs::path& path, const FileKind& kind,
                        const std::function<void(OutputArchive&)>& contents) {
  TemporaryFile file(path);
  const std::size_t place = front(kind, {}).size();
  SummedOutput buffer(file, place);
  std::ostream stream(&buffer);
  {
    OutputArchive archive(stream, kBytes);
    contents(archive);
  }
  const std::string begin = front(kind, buffer.finish());
  file.write(begin.data(), begin.size(), 0);
  file.commit();
}

void read_checked_file(const fs::path& path, const FileKind& kind,
                       const std::function<void(InputArchive&)>& contents) {
  std::ifstream file = open(path);
  const Header header = read_header(path, kind, file);
  const std::streampos place = file.tellg();
  check_contents(path, kind, header, file);
  file.seekg(place);
  const Limit limit(header.size);
  try {
    InputArchive archive(file);
    contents(archive);
  } catch (const cereal::Exception& error) {
    refuse(path, std::string("its contents make no sense (") + error.what() + ")");
  }
}

}  // namespace cadmorph
