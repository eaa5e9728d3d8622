#include <algorithm>
#include <array>
#include <map>

#include "core/formats/byte_scanner.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/fluent/fluent_mesh.h"
#include "core/formats/formats.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr Index kMost = Index{1} << 40;  // keeps sums from overflowing
constexpr std::string_view kBinaryEnd = "End of Binary Section";

/// The numbers at the beginning of a section of nodes, faces or cells.
struct Header {
  Index zone = 0;
  Index first = 0, last = 0;  ///< counted from 1
  Index type = 0;
  Index form = 0;  ///< of nodes: the dimension; of faces: the number of nodes of each, or mixed

  Index count() const { return last - first + 1; }
};

/// Reads section after section: "(13 (...)(...))" in text, "(3013 (...)(...)End of Binary Section
/// 3013)" of bytes.
class Reader {
 public:
  Reader(std::string_view text, const fs::path& path)
      : text_(text), path_(path), in_(text, path, 0, "()"), bytes_(text, path) {}

  ReadMesh run(SourceFile source) {
    while (in_.skip_space()) read_section();
    name_zones(mesh_.face_zones);
    name_zones(mesh_.cell_zones);
    read_points();
    ReadMesh result;
    if (skipped_faces_ > 0)
      result.remarks.push_back(std::to_string(skipped_faces_) +
                               " faces where non-conformal interfaces overlap were left out");
    result.mesh = to_mesh(std::move(mesh_), path_);
    CoordinatePlaces places;
    if (binary_.runs.empty())
      places = std::move(texts_);
    else
      places = std::move(binary_);
    result.copier = make_copier(std::move(source), std::move(places));
    return result;
  }

 private:
  void read_section() {
    const std::size_t start = in_.place();
    in_.expect('(', "the section before");
    const Index number = in_.integer("the number of a section");
    precision_ = number >= 2000 && number < 4000 ? number / 1000 : 0;
    const Index kind = precision_ > 0 ? number % 1000 : number;
    if (kind == 2)
      read_dimension();
    else if (kind == 10)
      read_nodes();
    else if (kind == 12)
      read_cells(start);
    else if (kind == 13)
      read_faces();
    else if (kind == 18)
      read_periodic(start);
    else if (kind == 39 || kind == 45)
      read_zone(start);
    else if (kind == 61)
      read_interface(start);
    else
      skip_section(start);
  }

  void read_dimension() {
    mesh_.dimension = int(in_.index("the dimension", 2, 4));
    in_.expect(')', "the dimension");
  }

  Header read_header() {
    in_.expect('(', "the number of a section");
    std::array<Index, 5> values{};
    const std::size_t place = in_.place();
    for (std::size_t i = 0; !in_.take(')'); ++i) {
      const Index value = in_.hexadecimal("a number of the section's header, or ')'");
      if (i < values.size()) values[i] = value;
    }
    const Header header{values[0], values[1], values[2], values[3], values[4]};
    const auto is_wrong = [](Index value) { return value < 0 || value > kMost; };
    if (std::ranges::any_of(values, is_wrong) || header.count() < 0 ||
        (header.zone > 0 && header.count() > 0 && header.first < 1))
      in_.fail_at(place, "a section's first and last item, " + std::to_string(header.first) +
                             " and " + std::to_string(header.last) + ", make no range");
    return header;
  }

  /// The beginning of the items; false for a section that declares their number only.
  bool begin_items(const Header& header, Index least_bytes) {
    if (!in_.take('(')) {
      in_.expect(')', "the header of a section");
      return false;
    }
    const auto rest = Index(text_.size() - in_.place());
    if (header.count() > (rest + 1) / least_bytes)
      in_.fail(std::to_string(header.count()) + " items are announced, but only " +
               std::to_string(rest) + " bytes follow: the file is cut off or the numbers wrong");
    bytes_.go_to(in_.place());
    return true;
  }

  void end_items() {
    if (precision_ > 0) {
      in_.go_to(bytes_.place());
      in_.expect(')', "the bytes of a section");
      skip_binary_end();
    } else {
      in_.expect(')', "the last item of a section");
      in_.expect(')', "the items of a section");
    }
  }

  void skip_binary_end() {
    const std::size_t end = text_.find(kBinaryEnd, in_.place());
    const std::size_t close = text_.find(')', end);
    if (end == std::string_view::npos || close == std::string_view::npos)
      in_.fail_expected("'End of Binary Section'");
    in_.go_to(close + 1);
  }

  void read_nodes() {
    const Header header = read_header();
    const Index components = header.form > 0 ? header.form : mesh_.dimension;
    if (components != 2 && components != 3)
      in_.fail("nodes of dimension " + std::to_string(components) + ", which must be 2 or 3");
    const Index bytes = precision_ == 0 ? 2 : precision_ == 2 ? 4 : 8;
    if (!begin_items(header, components * bytes)) return;
    if (components_ > 0 && components != components_) in_.fail("nodes of two dimensions");
    components_ = components;
    if (precision_ == 0)
      read_text_nodes(header);
    else
      place_binary_nodes(header, bytes);
    end_items();
  }

  void read_text_nodes(const Header& header) {
    for (Index node = header.first - 1; node < header.last; ++node) {
      texts_.nodes.push_back(node);
      for (Index c = 0; c < components_; ++c)
        texts_.tokens.push_back(in_.number("a coordinate", values_.emplace_back()));
    }
  }

  void place_binary_nodes(const Header& header, Index bytes) {
    for (Index c = 0; c < components_; ++c)
      binary_.runs.push_back(
          {.place = in_.place() + std::size_t(c * bytes),
           .stride = std::uint64_t(components_ * bytes),
           .count = header.count(),
           .component = int(c),
           .type = precision_ == 2 ? BinaryRun::Type::Float32 : BinaryRun::Type::Float64,
           .first_node = header.first - 1});
    bytes_.skip("coordinates", std::uint64_t(header.count() * components_ * bytes));
  }

  void read_cells(std::size_t start) {
    const Header header = read_header();
    if (header.zone > 0)
      mesh_.cell_zones.push_back(
          {.id = header.zone, .first = header.first - 1, .end = header.last, .type = header.type});
    skip_section(start);
  }

  void read_faces() {
    const Header header = read_header();
    if (!begin_items(header, precision_ > 0 ? 16 : 8)) return;
    const bool is_mixed = header.form == 0 || header.form == 5;
    if (!is_mixed && header.form > 4)
      in_.fail("faces of type " + std::to_string(header.form) + ", which is none of Fluent's");
    if (precision_ > 0 && header.count() > 0) find_byte_order();
    mesh_.face_zones.push_back({.id = header.zone,
                                .first = mesh_.faces.count(),
                                .end = mesh_.faces.count() + header.count(),
                                .type = header.type});
    first_faces_.push_back(header.first);
    for (Index f = 0; f < header.count(); ++f) read_face(is_mixed ? 0 : header.form);
    end_items();
  }

  /// Reads a face of `size` nodes; 0: the number stands before.
  void read_face(Index size) {
    const auto next = [&](std::string_view what) {
      return precision_ > 0 ? bytes_.int32(what) : in_.hexadecimal(what);
    };
    if (size == 0) size = next("the number of nodes of a face");
    const Index least = mesh_.dimension;
    if (size < least || size > Index(text_.size()))
      fail_here("a face of " + std::to_string(size) + " nodes");
    face_.clear();
    for (Index i = 0; i < size; ++i) face_.push_back(next("a node of a face") - 1);
    const Index c0 = next("a cell of a face"), c1 = next("a cell of a face");
    if (c0 < 0 || c1 < 0) fail_here("cell " + std::to_string(std::min(c0, c1)));
    mesh_.add_face(face_, c0, c1);
  }

  [[noreturn]] void fail_here(const std::string& why) {
    if (precision_ > 0) bytes_.fail(why);
    in_.fail(why);
  }

  /// A file does not say the order of its bytes: small numbers do.
  void find_byte_order() {
    if (has_order_) return;
    has_order_ = true;
    // Of 1 to 255, such as a face's number of nodes, in reverse order.
    constexpr Index kSmallest = 1 << 24;
    const std::size_t place = bytes_.place();
    const Index little = bytes_.int32("a face");
    bytes_.go_to(place);
    bytes_.set_big_endian(true);
    const Index big = bytes_.int32("a face");
    bytes_.go_to(place);
    bytes_.set_big_endian(big > 0 && (little <= 0 || (little > big && little >= kSmallest)));
  }

  /// "(18 (first last periodic-zone shadow-zone)(...))"
  void read_periodic(std::size_t start) {
    in_.expect('(', "the number of a section");
    std::array<Index, 4> numbers{};
    for (Index& number : numbers)
      number = in_.hexadecimal("a number of the header of periodic faces");
    mesh_.periodic_zones.emplace_back(numbers[2], numbers[3]);
    skip_section(start);
  }

  /// "(45 (3 wall hull)(...))"
  void read_zone(std::size_t start) {
    in_.expect('(', "the number of a section");
    const Index id = in_.integer("the number of a zone");
    FluentZone& zone = zones_[id];
    zone.word = in_.word("the type of a zone");
    zone.name = in_.skip_space() && in_.text()[in_.place()] == ')' ? "" : in_.word("a name");
    skip_section(start);
  }

  /// Faces that result from cutting the faces of two zones with each other: those are there too.
  void read_interface(std::size_t start) {
    in_.expect('(', "the number of a section");
    const Index first = in_.hexadecimal("a face"), last = in_.hexadecimal("a face");
    interfaces_.emplace_back(first, last);
    skip_section(start);
  }

  /// Goes to the end of the section that begins at `start`.
  void skip_section(std::size_t start) {
    if (precision_ > 0) return skip_binary_end();
    Index depth = 0;
    for (std::size_t at = start; at < text_.size(); ++at) {
      const char c = text_[at];
      if (c == '"') {
        for (++at; at < text_.size() && text_[at] != '"'; ++at)
          if (text_[at] == '\\') ++at;
      } else if (c == '(') {
        ++depth;
      } else if (c == ')' && --depth == 0) {
        return in_.go_to(at + 1);
      }
    }
    in_.fail_at(start, "the section that begins here has no end: the file is cut off");
  }

  void name_zones(std::vector<FluentZone>& zones) const {
    for (FluentZone& zone : zones)
      if (const auto found = zones_.find(zone.id); found != zones_.end()) {
        zone.name = found->second.name;
        zone.word = found->second.word;
      }
  }

  void drop_interfaces() {
    for (const auto& [first, last] : interfaces_)
      for (std::size_t z = 0; z < mesh_.face_zones.size(); ++z) {
        const FluentZone& zone = mesh_.face_zones[z];
        const Index shift = zone.first - first_faces_[z];
        for (Index f = std::max(first + shift, zone.first);
             f < std::min(last + 1 + shift, zone.end); ++f) {
          mesh_.faces.owner[f] = mesh_.faces.neighbour[f] = -1;
          ++skipped_faces_;
        }
      }
  }

  void read_points() {
    drop_interfaces();
    if (components_ == 0) in_.fail("there are no nodes, section (10 ...)");
    if (!binary_.runs.empty() && !texts_.tokens.empty())
      in_.fail("nodes in text and in binary sections of one file");
    Index count = 0, listed = 0;
    for (const Index node : texts_.nodes) count = std::max(count, node + 1);
    listed = std::ssize(texts_.nodes);
    for (BinaryRun& run : binary_.runs) {
      run.is_big_endian = bytes_.is_big_endian();
      count = std::max(count, run.first_node + run.count);
      if (run.component == 0) listed += run.count;
    }
    if (listed != count)
      in_.fail("nodes 1 to " + std::to_string(count) + " are wanted, but " +
               std::to_string(listed) + " are listed");
    mesh_.points = Points::Zero(count, 3);
    read_runs(text_, binary_, path_, mesh_.points);
    texts_.components = int(components_);
    for (Index row = 0; row < std::ssize(texts_.nodes); ++row)
      for (Index c = 0; c < components_; ++c)
        mesh_.points(texts_.nodes[row], c) = values_[row * components_ + c];
  }

  std::string_view text_;
  const fs::path& path_;
  TextScanner in_;
  ByteScanner bytes_;
  FluentMesh mesh_;
  Index precision_ = 0;  ///< of the section: 0 text, 2 single, 3 double
  Index components_ = 0;
  TextPlaces texts_;
  BinaryPlaces binary_;
  std::vector<double> values_;  ///< of texts_
  std::vector<Index> face_;
  std::vector<Index> first_faces_;  ///< number of the first face of each face zone
  std::map<Index, FluentZone> zones_;
  std::vector<std::pair<Index, Index>> interfaces_;
  Index skipped_faces_ = 0;
  bool has_order_ = false;
};

Recognition recognise(const FileStart& start) {
  TextScanner in(start.bytes, start.path);
  if (!in.skip_space()) return Recognition::No;
  const std::string_view line = in.line();
  for (const std::string_view section : {"(0 \"", "(1 \"", "(2 2", "(2 3", "(4 (", "(10 ("})
    if (line.starts_with(section)) return Recognition::Sure;
  return line.starts_with('(') ? Recognition::Possible : Recognition::No;
}

ReadMesh read(const fs::path& path) {
  SourceBytes file = read_source(path);
  return Reader(file.bytes, path).run(std::move(file.source));
}

}  // namespace

const MeshFormat& fluent_format() {
  static const MeshFormat format{.name = "Fluent",
                                 .extensions = {".msh", ".cas"},
                                 .recognise = recognise,
                                 .read = read,
                                 .is_of_finite_volumes = true};
  return format;
}

}  // namespace cadmorph
