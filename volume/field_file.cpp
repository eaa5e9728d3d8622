#include "volume/field_file.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <array>
#include <cereal/archives/portable_binary.hpp>
#include <cereal/types/string.hpp>
#include <cereal/types/vector.hpp>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

#include "core/errors.h"
#include "core/temporary_file.h"

// How each type goes to and from an archive.
namespace cereal {

template <class Archive, int Rows, int Columns, int Options>
void save(Archive& archive, const Eigen::Matrix<double, Rows, Columns, Options>& matrix) {
  archive(static_cast<std::int64_t>(matrix.rows()), static_cast<std::int64_t>(matrix.cols()));
  archive(binary_data(matrix.data(), sizeof(double) * static_cast<std::size_t>(matrix.size())));
}

template <class Archive, int Rows, int Columns, int Options>
void load(Archive& archive, Eigen::Matrix<double, Rows, Columns, Options>& matrix) {
  std::int64_t rows = 0, columns = 0;
  archive(rows, columns);
  matrix.resize(rows, columns);
  archive(binary_data(matrix.data(), sizeof(double) * static_cast<std::size_t>(matrix.size())));
}

}  // namespace cereal

namespace cadmorph {

template <class Archive>
void serialize(Archive& archive, Kernel& kernel) {
  archive(kernel.kind, kernel.order, kernel.dimension, kernel.shape);
}

template <class Archive>
void serialize(Archive& archive, CorrectionLevel& level) {
  archive(level.support, level.points, level.coefficients);
}

template <class Archive>
void serialize(Archive& archive, SourceTree::Node& node) {
  archive(node.centre, node.radius, node.first_child, node.child_count, node.begin, node.end,
          node.skeleton_begin, node.skeleton_end);
}

template <class Archive>
void serialize(Archive& archive, SourceTree& tree) {
  archive(tree.nodes, tree.separation, tree.skeleton_points, tree.skeleton_weights);
}

template <class Archive>
void serialize(Archive& archive, FieldTerms& terms) {
  archive(terms.origin, terms.unit, terms.kernel, terms.centres, terms.weights, terms.linear,
          terms.tree, terms.correction);
}

template <class Archive>
void serialize(Archive& archive, DeformationTerms& terms) {
  archive(terms.base_cad, terms.variant_cad, terms.mesh_file, terms.mesh_unit_mm, terms.low,
          terms.high, terms.nodes, terms.new_nodes, terms.steps);
}

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "cadmorph deformation field\n";

struct Header {
  std::uint32_t format = kFieldFormat;
  std::uint64_t size = 0, checksum = 0;

  template <class Archive>
  void serialize(Archive& archive) {
    archive(format, size, checksum);
  }
};

[[noreturn]] void refuse(const fs::path& path, const std::string& why) {
  throw IoError("can't read " + path.string() + ": " + why);
}

std::string contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::error_code error;
  if (!file || fs::is_directory(path, error))
    refuse(path, fs::exists(path, error)
                     ? (fs::is_directory(path, error) ? "it is a folder" : std::strerror(errno))
                     : "there is no such file");
  return {std::istreambuf_iterator<char>(file), {}};
}

// The payload, checked against the header.
std::string payload(const fs::path& path) {
  const std::string all = contents(path);
  if (all.compare(0, kMagic.size(), kMagic) != 0)
    refuse(path, "it is no field file; cadmorph field writes them");
  std::istringstream stream(all);
  stream.seekg(kMagic.size());
  Header header;
  try {
    cereal::PortableBinaryInputArchive archive(stream);
    archive(header.format);
    if (header.format != kFieldFormat)
      refuse(path, "its format is " + std::to_string(header.format) +
                       ", and this program reads format " + std::to_string(kFieldFormat) +
                       (header.format > kFieldFormat
                            ? ": a newer cadmorph wrote it; use that one"
                            : ": an older cadmorph wrote it; make it anew with cadmorph field"));
    archive(header.size, header.checksum);
  } catch (const cereal::Exception&) {
    refuse(path, "it ends within its header; copy it anew, or make it anew with cadmorph field");
  }
  const std::string result = all.substr(static_cast<std::size_t>(stream.tellg()));
  if (result.size() != header.size)
    refuse(path, "it holds " + std::to_string(result.size()) + " bytes in place of the " +
                     std::to_string(header.size) +
                     " written; copy it anew, or make it anew with cadmorph field");
  if (XXH3_64bits(result.data(), result.size()) != header.checksum)
    refuse(path,
           "its checksum does not fit: it is damaged; copy it anew, or make it anew with cadmorph "
           "field");
  return result;
}

}  // namespace

void write_field(const fs::path& path, const DeformationTerms& terms) {
  std::ostringstream body, head;
  cereal::PortableBinaryOutputArchive(
      body, cereal::PortableBinaryOutputArchive::Options::LittleEndian())(terms);
  const std::string data = body.str();
  Header header;
  header.size = data.size();
  header.checksum = XXH3_64bits(data.data(), data.size());
  head << kMagic;
  cereal::PortableBinaryOutputArchive(
      head, cereal::PortableBinaryOutputArchive::Options::LittleEndian())(header);
  const std::string front = head.str();
  TemporaryFile file(path);
  file.write(front.data(), front.size(), 0);
  file.write(data.data(), data.size(), static_cast<off_t>(front.size()));
  file.commit();
}

DeformationTerms read_field(const fs::path& path) {
  std::istringstream stream(payload(path));
  DeformationTerms terms;
  try {
    cereal::PortableBinaryInputArchive archive(stream);
    archive(terms);
  } catch (const cereal::Exception& error) {
    refuse(path, std::string("its contents make no sense (") + error.what() + ")");
  }
  return terms;
}

}  // namespace cadmorph
