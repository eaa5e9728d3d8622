#include "core/formats/coordinate_places.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>

#include "core/errors.h"
#include "core/parallel.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr const char* kAxes[] = {"x", "y", "z"};

/// A coordinate that changes.
struct Edit {
  TextToken token;
  Index node = 0;
  int component = 0;
};

[[noreturn]] void refuse_change(Index node, int component, double before, double after) {
  throw InvalidInputError("the file has no " + std::string(kAxes[component]) +
                          " coordinates, but node " + std::to_string(node) + " would move from " +
                          std::to_string(before) + " to " + std::to_string(after) +
                          " there; a plane mesh needs CAD models in the same plane");
}

/// A plane of constant z, not in the file, is kept by a morph to rounding.
bool is_rounding(double before, double after, const Points& all) {
  constexpr double kRounding = 1e-9;  // of the mesh's size
  return std::abs(after - before) <= kRounding * all.cwiseAbs().maxCoeff();
}

Index node_of(const std::vector<Index>& nodes, Index row) {
  return nodes.empty() ? row : nodes[row];
}

/// The changed coordinates in the order of the file.
std::vector<Edit> edits_of(const TextPlaces& places, const Points& before, const Points& after) {
  std::vector<Edit> edits;
  edits.reserve(places.tokens.size());
  const Index rows = std::ssize(places.tokens) / places.components;
  for (Index row = 0; row < rows; ++row) {
    const Index node = node_of(places.nodes, row);
    for (int c = 0; c < 3; ++c) {
      const double old_value = before(node, c), new_value = after(node, c);
      if (old_value == new_value) continue;
      const TextToken token =
          c < places.components ? places.tokens[row * places.components + c] : TextToken{};
      if (token.length > 0)
        edits.push_back({token, node, c});
      else if (!is_rounding(old_value, new_value, before))
        refuse_change(node, c, old_value, new_value);
    }
  }
  const auto by_place = [](const Edit& a, const Edit& b) { return a.token.place < b.token.place; };
  if (!std::ranges::is_sorted(edits, by_place)) std::ranges::sort(edits, by_place);
  return edits;
}

/// The changed coordinates in the style of their file.
class ChangedNumbers : public ReplacedText {
 public:
  ChangedNumbers(const TextPlaces& places, const Points& before, const Points& after)
      : edits_(edits_of(places, before, after)), after_(after), write_number_(places.write) {}

  Index count() const override { return std::ssize(edits_); }
  TextToken place(Index part) const override { return edits_[std::size_t(part)].token; }
  void write(Index part, std::string_view old_text, std::string& text) const override {
    const Edit& edit = edits_[std::size_t(part)];
    write_number_(after_(edit.node, edit.component), old_text, text);
  }

 private:
  std::vector<Edit> edits_;
  const Points& after_;
  NumberWriter write_number_;
};

void write_text(const SourceFile& source, const ChangedNumbers& numbers, const fs::path& target) {
  if (numbers.count() == 0) return write_unchanged(source, target);  // gzip's bytes too
  write_replaced(source, numbers, target);
}

template <class Bits>
Bits swapped(Bits bits, bool is_big_endian) {
  if ((std::endian::native == std::endian::big) == is_big_endian) return bits;
  auto bytes = std::bit_cast<std::array<char, sizeof(Bits)>>(bits);
  std::ranges::reverse(bytes);
  return std::bit_cast<Bits>(bytes);
}

template <class Number, class Bits>
double load(const char* from, bool is_big_endian) {
  Bits bits;
  std::memcpy(&bits, from, sizeof bits);
  return double(std::bit_cast<Number>(swapped(bits, is_big_endian)));
}

template <class Number, class Bits>
void store(double value, char* to, bool is_big_endian) {
  const Bits bits = swapped(std::bit_cast<Bits>(Number(value)), is_big_endian);
  std::memcpy(to, &bits, sizeof bits);
}

bool is_single(const BinaryRun& run) { return run.type == BinaryRun::Type::Float32; }

Index node_of(const BinaryRun& run, Index i) {
  return run.nodes.empty() ? run.first_node + i : run.nodes[i];
}

double load(const BinaryRun& run, Index i, std::string_view bytes) {
  const char* from = bytes.data() + run.place + std::uint64_t(i) * run.stride;
  return run.scale * (is_single(run) ? load<float, std::uint32_t>(from, run.is_big_endian)
                                     : load<double, std::uint64_t>(from, run.is_big_endian));
}

void store(const BinaryRun& run, Index i, double value, std::string& bytes) {
  char* to = bytes.data() + run.place + std::uint64_t(i) * run.stride;
  const double number = value / run.scale;
  if (is_single(run))
    store<float, std::uint32_t>(number, to, run.is_big_endian);
  else
    store<double, std::uint64_t>(number, to, run.is_big_endian);
}

void write_binary(const SourceFile& source, const BinaryPlaces& places, const Points& before,
                  const Points& after, const fs::path& target) {
  check_components(places, before, after);
  std::string bytes = read_again(source);
  if (!replace_coordinates(bytes, places, before, after)) return write_unchanged(source, target);
  write_pieces(target, {bytes}, source.is_compressed);
}

Points readable_text(const TextPlaces& places, const Points& before, const Points& after) {
  if (!places.read_back) return {};
  Points result = after;
  const std::vector<Edit> edits = edits_of(places, before, after);
  // Only the width of the original counts here.
  parallel_for(std::ssize(edits), 1 << 14, [&](Index begin, Index end) {
    std::string text;
    for (Index i = begin; i < end; ++i) {
      const Edit& edit = edits[i];
      const std::string original(edit.token.length, ' ');
      text.clear();
      places.write(after(edit.node, edit.component), original, text);
      result(edit.node, edit.component) = places.read_back(text);
    }
  });
  return result;
}

Points readable_binary(const BinaryPlaces& places, const Points& before, const Points& after) {
  const auto is_exact = [](const BinaryRun& run) { return !is_single(run) && run.scale == 1; };
  if (std::ranges::all_of(places.runs, is_exact)) return {};
  Points result = after;
  for (const BinaryRun& run : places.runs)
    for (Index i = 0; i < run.count; ++i) {
      const Index node = node_of(run, i);
      double& value = result(node, run.component);
      if (value == before(node, run.component)) continue;
      value = run.scale * (is_single(run) ? double(float(value / run.scale)) : value / run.scale);
    }
  return result;
}

class PlacesCopier : public MeshCopier {
 public:
  PlacesCopier(SourceFile source, CoordinatePlaces places)
      : source_(std::move(source)), places_(std::move(places)) {}

  void write(const fs::path& target, const Points& before, const Points& after) const override {
    write_copy(source_, places_, before, after, target);
  }
  Points readable(const Points& before, const Points& after) const override {
    return readable_points(places_, before, after);
  }

 private:
  SourceFile source_;
  CoordinatePlaces places_;
};

}  // namespace

void write_shortest(double value, std::string_view /*original*/, std::string& text) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  text.append(buffer, end);
}

void read_runs(std::string_view bytes, const BinaryPlaces& places, const fs::path& path,
               Points& points) {
  for (const BinaryRun& run : places.runs) {
    if (run.count == 0) continue;
    const std::uint64_t size = is_single(run) ? sizeof(float) : sizeof(double);
    const std::uint64_t last = run.place + std::uint64_t(run.count - 1) * run.stride;
    if (last + size > bytes.size())
      fail_reading(path, "byte " + std::to_string(run.place) + ": coordinates of " +
                             std::to_string(run.count) + " nodes reach beyond the end of the file");
    for (Index i = 0; i < run.count; ++i)
      points(node_of(run, i), run.component) = load(run, i, bytes);
  }
}

bool replace_coordinates(std::string& bytes, const BinaryPlaces& places, const Points& before,
                         const Points& after) {
  bool has_changed = false;
  for (const BinaryRun& run : places.runs)
    for (Index i = 0; i < run.count; ++i) {
      const Index node = node_of(run, i);
      if (before(node, run.component) == after(node, run.component)) continue;
      store(run, i, after(node, run.component), bytes);
      has_changed = true;
    }
  return has_changed;
}

void check_components(const BinaryPlaces& places, const Points& before, const Points& after) {
  for (int c = 0; c < 3; ++c) {
    if (std::ranges::any_of(places.runs, [&](const BinaryRun& run) { return run.component == c; }))
      continue;
    for (Index n = 0; n < before.rows(); ++n)
      if (!is_rounding(before(n, c), after(n, c), before))
        refuse_change(n, c, before(n, c), after(n, c));
  }
}

void write_copy(const SourceFile& source, const CoordinatePlaces& places, const Points& before,
                const Points& after, const fs::path& target) {
  if (const auto* text = std::get_if<TextPlaces>(&places))
    write_text(source, ChangedNumbers(*text, before, after), target);
  else
    write_binary(source, std::get<BinaryPlaces>(places), before, after, target);
}

Points readable_points(const CoordinatePlaces& places, const Points& before, const Points& after) {
  if (const auto* text = std::get_if<TextPlaces>(&places))
    return readable_text(*text, before, after);
  return readable_binary(std::get<BinaryPlaces>(places), before, after);
}

std::unique_ptr<const MeshCopier> make_copier(SourceFile source, CoordinatePlaces places) {
  return std::make_unique<PlacesCopier>(std::move(source), std::move(places));
}

}  // namespace cadmorph
