#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "core/byte_order_mark.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/formats.h"
#include "core/formats/number_input.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

using enum CellType;

// Bytes of an integer and of a record's length; nodes, triangles, quads and four kinds of solids.
constexpr int kIntSize = 4, kMarkerSize = 4;
constexpr std::size_t kCounts = 7;
constexpr std::size_t kHeaderSize = kCounts * kIntSize;

/// How the numbers of a binary file are stored, which its name tells.
struct Encoding {
  std::string_view prefix;  ///< of the extension ".ugrid"
  bool is_big_endian;
  int real_size;
  bool has_records;  ///< of Fortran: the length of each record before and after it
};

constexpr Encoding kEncodings[] = {
    {".b8", true, 8, false},   {".lb8", false, 8, false}, {".b4", true, 4, false},
    {".lb4", false, 4, false}, {".r8", true, 8, true},    {".lr8", false, 8, true},
    {".r4", true, 4, true},    {".lr4", false, 4, true},
};

struct FaceKind {
  CellType type;
  std::size_t nodes;
};
constexpr FaceKind kFaces[] = {{Triangle, 3}, {Quad, 4}};

struct SolidKind {
  CellType type;
  std::size_t nodes;
  std::array<std::uint8_t, 8> order;  ///< place in the file of each of VTK's nodes
};
constexpr SolidKind kSolids[] = {
    {Tetra, 4, {0, 1, 2, 3}},
    {Pyramid, 5, {0, 3, 4, 1, 2}},  // the tip is the third
    {Wedge, 6, {0, 1, 2, 3, 4, 5}},
    {Hexahedron, 8, {0, 1, 2, 3, 4, 5, 6, 7}},
};

/// Whether the file is text: in a binary one counts have bytes that are no characters.
bool is_text(std::string_view bytes) {
  return std::ranges::all_of(bytes.substr(0, kHeaderSize).substr(byte_order_mark_size(bytes)),
                             [](unsigned char c) { return std::isprint(c) || std::isspace(c); });
}

/// The numbers of nodes, triangles, quadrilaterals, tetrahedra, pyramids, prisms, hexahedra.
using Counts = std::array<Index, kCounts>;

/// Bytes of all that follows the counts, less the marks of records.
Index body_size(const Counts& counts, int real_size) {
  Index size = 3 * real_size * counts[0];
  for (std::size_t i = 0; i < 2; ++i)
    size += Index(kFaces[i].nodes + 1) * kIntSize * counts[1 + i];  // with the surface's number
  for (std::size_t i = 0; i < 4; ++i) size += Index(kSolids[i].nodes) * kIntSize * counts[3 + i];
  return size;
}

Index file_size(const Counts& counts, const Encoding& encoding) {
  return Index(kHeaderSize) + body_size(counts, encoding.real_size) +
         (encoding.has_records ? 4 * kMarkerSize : 0);
}

std::optional<Counts> binary_counts(std::string_view bytes, const fs::path& path,
                                    const Encoding& encoding) {
  ByteScanner in(bytes, path);
  in.set_big_endian(encoding.is_big_endian);
  if (bytes.size() < kHeaderSize + 2 * kMarkerSize) return {};
  if (encoding.has_records) in.int32("the length of a record");
  Counts counts;
  for (Index& count : counts) {
    count = in.int32("a count");
    if (count < 0) return {};
  }
  return counts;
}

/// Whether the counts of a binary file, so read, fill it exactly.
bool fits(std::string_view bytes, const fs::path& path, const Encoding& encoding) {
  const auto counts = binary_counts(bytes, path, encoding);
  return counts && file_size(*counts, encoding) == std::ssize(bytes);
}

std::string lower_extension(const fs::path& path) {
  std::string extension = mesh_extension(path);
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return char(std::tolower(c)); });
  if (extension.ends_with(".gz")) extension.resize(extension.size() - 3);
  return extension;
}

/// The encoding of a binary file: that of its name, or else the one that its size fits.
const Encoding& encoding_of(std::string_view bytes, const fs::path& path) {
  const auto fitting = std::ranges::find_if(
      kEncodings, [&](const Encoding& encoding) { return fits(bytes, path, encoding); });
  const bool has_fitting = fitting != std::end(kEncodings);
  const std::string extension = lower_extension(path);
  const auto named = std::ranges::find_if(kEncodings, [&](const Encoding& encoding) {
    return extension == std::string(encoding.prefix) + ".ugrid";
  });
  if (named == std::end(kEncodings)) {
    if (has_fitting) return *fitting;
    fail_reading(path,
                 "byte 0: its counts fit the file's size in no byte order: it is cut off, or of "
                 "64-bit integers, which are not read");
  }
  if (has_fitting && !fits(bytes, path, *named))
    fail_reading(path, "byte 0: its counts fit the file's size only if it is a " +
                           std::string(fitting->prefix) + ".ugrid file; rename it so");
  return *named;
}

class Reader {
 public:
  Reader(std::string_view bytes, const fs::path& path)
      : bytes_(bytes), path_(path), in_(bytes, path) {
    if (is_text(bytes)) return;
    encoding_ = &encoding_of(bytes, path);
    counts_ = binary_counts(bytes, path, *encoding_).value_or(Counts{});
    in_.set_binary();
    in_.bytes().set_big_endian(encoding_->is_big_endian);
  }

  ReadMesh run(SourceFile source) {
    read_counts();
    read_points();
    read_faces();
    read_solids();
    if (encoding_) end_record();
    if (encoding_ && in_.bytes().rest() > 0)
      result_.remarks.push_back("the " + std::to_string(in_.bytes().rest()) +
                                " bytes after the elements stay as they are");
    CoordinatePlaces places;
    if (encoding_)
      places = std::move(binary_places_);
    else
      places = std::move(text_places_);
    result_.copier = make_copier(std::move(source), std::move(places));
    return std::move(result_);
  }

 private:
  void read_counts() {
    constexpr const char* kNames[kCounts] = {
        "nodes", "triangles", "quadrilaterals", "tetrahedra", "pyramids", "prisms", "hexahedra"};
    begin_record(Index(kHeaderSize));
    for (std::size_t i = 0; i < kCounts; ++i)
      counts_[i] = in_.count("the number of " + std::string(kNames[i]), kIntSize, kIntSize, 6);
    if (!encoding_) return;
    end_record();
    const Index needed = file_size(counts_, *encoding_);
    if (needed > std::ssize(bytes_))
      fail_reading(path_, "byte 0: its counts need a file of " + std::to_string(needed) +
                              " bytes, but it has " + std::to_string(bytes_.size()) +
                              ": it is cut off, or its name tells the wrong byte order");
    begin_record(body_size(counts_, encoding_->real_size));
  }

  void begin_record(Index size) {
    if (encoding_ && encoding_->has_records) read_marker(size);
    record_size_ = size;
  }
  void end_record() {
    if (encoding_->has_records) read_marker(record_size_);
  }
  void read_marker(Index size) {
    const std::size_t place = in_.place();
    const Index found = in_.integer("the length of a record", kMarkerSize);
    // Some programs write wrong lengths; the file's size then tells.
    const bool is_whole = file_size(counts_, *encoding_) == std::ssize(bytes_);
    if (found != size && !is_whole)
      in_.fail_at(place,
                  "expected a record of " + std::to_string(size) + " bytes, found one of " +
                      std::to_string(found) +
                      "; records in several parts are not read: write the mesh as .b8.ugrid");
  }

  void read_points() {
    const Index count = counts_[0];
    Points& points = result_.mesh.points;
    points.resize(count, 3);
    if (encoding_) {
      const auto size = std::uint64_t(encoding_->real_size);
      for (int c = 0; c < 3; ++c)
        binary_places_.runs.push_back(
            {.place = in_.place() + std::size_t(c) * size,
             .stride = 3 * size,
             .count = count,
             .component = c,
             .type = size == 4 ? BinaryRun::Type::Float32 : BinaryRun::Type::Float64,
             .is_big_endian = encoding_->is_big_endian});
      read_runs(bytes_, binary_places_, path_, points);
      return in_.bytes().skip("coordinates", 3 * size * std::uint64_t(count));
    }
    text_places_.tokens.reserve(3 * std::size_t(count));
    for (Index node = 0; node < count; ++node)
      for (int c = 0; c < 3; ++c)
        text_places_.tokens.push_back(in_.text().number("a coordinate", points(node, c)));
  }

  void read_nodes(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      nodes_[i] = in_.index("node", kIntSize, 1, counts_[0] + 1) - 1;
  }

  /// Faces become groups by their surface; where there is nothing else, cells too.
  void read_faces() {
    const bool are_cells = counts_[3] + counts_[4] + counts_[5] + counts_[6] == 0;
    std::vector<Index> face_nodes;
    face_nodes.reserve(std::size_t(3 * counts_[1] + 4 * counts_[2]));
    for (std::size_t kind = 0; kind < 2; ++kind)
      for (Index i = 0; i < counts_[1 + kind]; ++i) {
        const auto face = std::span(nodes_).first(kFaces[kind].nodes);
        read_nodes(face.size());
        face_nodes.insert(face_nodes.end(), face.begin(), face.end());
        if (are_cells) add_cell(result_.mesh, kFaces[kind].type, face);
      }
    std::map<Index, std::size_t> group_of;
    auto node = face_nodes.begin();
    for (std::size_t kind = 0; kind < 2; ++kind)
      for (Index i = 0; i < counts_[1 + kind]; ++i) {
        const Index surface = in_.integer("the surface of a face", kIntSize);
        std::vector<NodeGroup>& groups = result_.mesh.groups;
        const auto [entry, is_new] = group_of.try_emplace(surface, groups.size());
        if (is_new)
          groups.push_back(
              {.name = "surface " + std::to_string(surface), .kind = "surface", .nodes = {}});
        std::vector<Index>& nodes = groups[entry->second].nodes;
        const auto end = node + std::ptrdiff_t(kFaces[kind].nodes);
        nodes.insert(nodes.end(), node, end);
        node = end;
      }
    tidy_groups(result_.mesh);
  }

  void read_solids() {
    std::array<Index, 8> ordered;
    for (std::size_t kind = 0; kind < 4; ++kind) {
      const SolidKind& solid = kSolids[kind];
      reserve_cells(result_.mesh, counts_[3 + kind], counts_[3 + kind] * Index(solid.nodes));
      for (Index i = 0; i < counts_[3 + kind]; ++i) {
        read_nodes(solid.nodes);
        for (std::size_t n = 0; n < solid.nodes; ++n) ordered[n] = nodes_[solid.order[n]];
        add_cell(result_.mesh, solid.type, std::span(ordered).first(solid.nodes));
      }
    }
  }

  std::string_view bytes_;
  const fs::path& path_;
  NumberInput in_;
  const Encoding* encoding_ = nullptr;  ///< null: text
  ReadMesh result_;
  Counts counts_{};
  Index record_size_ = 0;
  TextPlaces text_places_;
  BinaryPlaces binary_places_;
  std::array<Index, 8> nodes_{};  ///< of the element read last, in the file's order
};

/// The counts alone tell too little: the name decides.
Recognition recognise(const FileStart& start) {
  if (start.bytes.size() < 2 * kCounts) return Recognition::No;
  if (!is_text(start.bytes)) return Recognition::Possible;
  const std::size_t first = start.bytes.find_first_not_of(" \t\r\n");
  const bool is_number = first != std::string::npos &&
                         std::isdigit(static_cast<unsigned char>(start.bytes[first])) != 0;
  return is_number ? Recognition::Possible : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  SourceBytes file = read_source(path);
  return Reader(file.bytes, path).run(std::move(file.source));
}

}  // namespace

const MeshFormat& ugrid_format() {
  static const MeshFormat format{
      .name = "UGRID",
      .extensions = {".ugrid", ".b8.ugrid", ".lb8.ugrid", ".b4.ugrid", ".lb4.ugrid", ".r8.ugrid",
                     ".lr8.ugrid", ".r4.ugrid", ".lr4.ugrid"},
      .recognise = recognise,
      .read = read};
  return format;
}

}  // namespace cadmorph
