#include "core/formats/coordinate_places.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <span>

#include "core/errors.h"
#include "core/parallel.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr const char* kAxes[] = {"x", "y", "z"};

[[noreturn]] void refuse_change(Index node, int component, double before, double after) {
  throw InvalidInputError("the file has no " + std::string(kAxes[component]) +
                          " coordinates, but node " + std::to_string(node) + " would move from " +
                          std::to_string(before) + " to " + std::to_string(after) +
                          " there; a plane mesh needs CAD models in the same plane");
}

/// What a plane of constant z, not in the file, may move by: a morph keeps it to rounding.
double largest_rounding(const Points& points) {
  constexpr double kRounding = 1e-9;  // of the mesh's size
  return points.size() ? kRounding * points.cwiseAbs().maxCoeff() : 0;
}

Index node_of(const std::vector<Index>& nodes, Index row) {
  return nodes.empty() ? row : nodes[row];
}

/// Whether a coordinate changes. Throws where it does and the file does not have it.
bool has_change(const TextPlaces& places, const Points& before, const Points& after) {
  const double rounding = largest_rounding(before);
  bool result = false;
  const Index rows = std::ssize(places.tokens) / places.components;
  for (Index row = 0; row < rows; ++row) {
    const Index node = node_of(places.nodes, row);
    for (int c = 0; c < 3; ++c) {
      const double old_value = before(node, c), new_value = after(node, c);
      if (old_value == new_value) continue;
      const bool is_there =
          c < places.components && places.tokens[row * places.components + c].length > 0;
      if (!is_there && !(std::abs(new_value - old_value) <= rounding))
        refuse_change(node, c, old_value, new_value);
      result = result || is_there;
    }
  }
  return result;
}

/// The coordinates of a text, in the style of the file.
class NewNumbers : public ReplacedText {
 public:
  NewNumbers(const TextPlaces& places, const Points& before, const Points& after)
      : places_(places), before_(before), after_(after) {
    const auto is_before = [](TextToken a, TextToken b) { return a.place < b.place; };
    const auto is_there = [](TextToken token) { return token.length > 0; };
    if (std::ranges::all_of(places.tokens, is_there) &&
        std::ranges::is_sorted(places.tokens, is_before))
      return;
    is_in_order_ = false;
    for (Index i = 0; i < std::ssize(places.tokens); ++i)
      if (is_there(places.tokens[i])) order_.push_back(i);
    std::ranges::sort(order_, is_before, [&](Index i) { return places.tokens[i]; });
  }

  Index count() const override {
    return is_in_order_ ? std::ssize(places_.tokens) : std::ssize(order_);
  }
  TextToken place(Index part) const override { return places_.tokens[number(part)]; }
  void write(Index part, std::string_view old_text, std::string& text) const override {
    const Index i = number(part);
    const Index node = node_of(places_.nodes, i / places_.components);
    const auto component = int(i % places_.components);
    const double value = after_(node, component);
    if (value == before_(node, component))
      text += old_text;
    else
      places_.write(value, old_text, text);
  }

 private:
  /// The place in `tokens` of a part.
  Index number(Index part) const { return is_in_order_ ? part : order_[part]; }

  const TextPlaces& places_;
  const Points &before_, &after_;
  bool is_in_order_ = true;
  std::vector<Index> order_;  ///< places in `tokens`, by their places in the file
};

void write_text(const SourceFile& source, const TextPlaces& places, const Points& before,
                const Points& after, const fs::path& target) {
  if (!has_change(places, before, after))
    return write_unchanged(source, target);  // gzip's bytes too
  write_replaced(source, NewNumbers(places, before, after), target);
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

std::uint64_t number_size(const BinaryRun& run) {
  return is_single(run) ? sizeof(float) : sizeof(double);
}

/// The first number of a run that begins at `place` or behind.
Index first_from(const BinaryRun& run, std::uint64_t place) {
  if (place <= run.place) return 0;
  const std::uint64_t stride = std::max<std::uint64_t>(run.stride, 1);  // of a single number
  return std::min(run.count, Index((place - run.place + stride - 1) / stride));
}

std::uint64_t end_of(const BinaryRun& run) {
  return run.count == 0 ? run.place
                        : run.place + std::uint64_t(run.count - 1) * run.stride + number_size(run);
}

/// Replaces the numbers of a run that differ in `bytes`, which stand at `place` in the file and cut
/// none.
void replace_numbers(const BinaryRun& run, const Points& before, const Points& after,
                     std::uint64_t place, std::span<char> bytes) {
  const Index end = first_from(run, place + bytes.size());
  for (Index i = first_from(run, place); i < end; ++i) {
    const Index node = node_of(run, i);
    const double value = after(node, run.component);
    if (before(node, run.component) == value) continue;
    char* to = bytes.data() + (run.place + std::uint64_t(i) * run.stride - place);
    if (is_single(run))
      store<float, std::uint32_t>(value / run.scale, to, run.is_big_endian);
    else
      store<double, std::uint64_t>(value / run.scale, to, run.is_big_endian);
  }
}

/// The numbers of a binary file.
class NewBinaryNumbers : public Replacement {
 public:
  NewBinaryNumbers(const BinaryPlaces& places, const Points& before, const Points& after)
      : runs_(places), before_(before), after_(after) {}

  std::uint64_t last_cut(std::uint64_t begin, std::uint64_t end) const override {
    // Numbers of several runs may lie beside each other.
    for (std::uint64_t cut = end;; end = cut) {
      for (const BinaryRun* run : runs_.over(cut, cut)) {
        const Index next = first_from(*run, cut);
        if (next == 0) continue;
        const std::uint64_t last = run->place + std::uint64_t(next - 1) * run->stride;
        if (last + number_size(*run) > cut) cut = std::max(last, begin);
      }
      if (cut == end) return cut;
    }
  }
  void append(std::uint64_t place, std::string_view bytes, std::string& copy) const override {
    const std::size_t begin = copy.size();
    copy += bytes;
    for (const BinaryRun* run : runs_.over(place, place + bytes.size()))
      replace_numbers(*run, before_, after_, place, std::span(copy).subspan(begin));
  }

 private:
  RunsByPlace runs_;
  const Points &before_, &after_;
};

bool has_change(const BinaryPlaces& places, const Points& before, const Points& after) {
  return std::ranges::any_of(places.runs, [&](const BinaryRun& run) {
    for (Index i = 0; i < run.count; ++i) {
      const Index node = node_of(run, i);
      if (before(node, run.component) != after(node, run.component)) return true;
    }
    return false;
  });
}

Points readable_text(const TextPlaces& places, const Points& before, const Points& after) {
  if (!places.read_back) return {};
  has_change(places, before, after);
  Points result = after;
  // Only the width of the original counts here.
  const Index rows = std::ssize(places.tokens) / places.components;
  parallel_for(rows, 1 << 14, [&](Index begin, Index end) {
    std::string text;
    for (Index row = begin; row < end; ++row)
      for (int c = 0; c < places.components; ++c) {
        const Index node = node_of(places.nodes, row);
        const TextToken token = places.tokens[row * places.components + c];
        if (token.length == 0 || before(node, c) == after(node, c)) continue;
        text.clear();
        places.write(after(node, c), std::string(token.length, ' '), text);
        result(node, c) = places.read_back(text);
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

RunsByPlace::RunsByPlace(const BinaryPlaces& places) {
  for (const BinaryRun& run : places.runs)
    if (run.count > 0) runs_.push_back(&run);
  std::ranges::stable_sort(runs_, {}, &BinaryRun::place);
  std::uint64_t end = 0;
  for (const BinaryRun* run : runs_) ends_.push_back(end = std::max(end, end_of(*run)));
}

std::span<const BinaryRun* const> RunsByPlace::over(std::uint64_t begin, std::uint64_t end) const {
  const auto first = std::ranges::upper_bound(ends_, begin) - ends_.begin();
  const auto last = std::ranges::lower_bound(runs_, end, {}, &BinaryRun::place) - runs_.begin();
  return std::span(runs_).subspan(std::size_t(first), std::size_t(std::max(last - first, {})));
}

void write_shortest(double value, std::string_view /*original*/, std::string& text) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  text.append(buffer, end);
}

void read_runs(std::string_view bytes, const BinaryPlaces& places, const fs::path& path,
               Points& points) {
  for (const BinaryRun& run : places.runs) {
    if (run.count == 0) continue;
    const std::uint64_t last = run.place + std::uint64_t(run.count - 1) * run.stride;
    if (last + number_size(run) > bytes.size())
      fail_reading(path, "byte " + std::to_string(run.place) + ": coordinates of " +
                             std::to_string(run.count) + " nodes reach beyond the end of the file");
    for (Index i = 0; i < run.count; ++i)
      points(node_of(run, i), run.component) = load(run, i, bytes);
  }
}

void replace_coordinates(std::span<char> bytes, const BinaryPlaces& places, const Points& before,
                         const Points& after) {
  for (const BinaryRun& run : places.runs) replace_numbers(run, before, after, 0, bytes);
}

void write_places(const SourceFile& source, const BinaryPlaces& places, const Points& before,
                  const Points& after, const fs::path& target) {
  if (!has_change(places, before, after)) return write_unchanged(source, target);
  write_replaced(source, NewBinaryNumbers(places, before, after), target);
}

void check_components(const BinaryPlaces& places, const Points& before, const Points& after) {
  const double rounding = largest_rounding(before);
  for (int c = 0; c < 3; ++c) {
    if (std::ranges::any_of(places.runs, [&](const BinaryRun& run) { return run.component == c; }))
      continue;
    for (Index n = 0; n < before.rows(); ++n)
      if (!(std::abs(after(n, c) - before(n, c)) <= rounding))
        refuse_change(n, c, before(n, c), after(n, c));
  }
}

void write_copy(const SourceFile& source, const CoordinatePlaces& places, const Points& before,
                const Points& after, const fs::path& target) {
  if (const auto* text = std::get_if<TextPlaces>(&places))
    return write_text(source, *text, before, after, target);
  const auto& binary = std::get<BinaryPlaces>(places);
  check_components(binary, before, after);
  write_places(source, binary, before, after, target);
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
