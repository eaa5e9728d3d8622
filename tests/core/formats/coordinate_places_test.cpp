#include "core/formats/coordinate_places.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <string>

#include "tests/core/formats/format_checks.h"

namespace cadmorph::test {
namespace {

/// Nodes with three runs each, as those that a file has one by one, and between them blocks with
/// their components side by side: all in another order than that of the file.
BinaryPlaces many_runs(Index nodes, std::size_t& size) {
  BinaryPlaces places;
  std::uint64_t place = 5;
  for (Index node = 0; node < nodes;) {
    const Index count = node % 10 == 0 ? std::min<Index>(4, nodes - node) : 1;
    const auto type = node % 3 ? BinaryRun::Type::Float64 : BinaryRun::Type::Float32;
    const std::uint64_t width = node % 3 ? 8 : 4;
    for (int c = 0; c < 3; ++c)
      places.runs.push_back({.place = place + std::uint64_t(c) * width,
                             .stride = 3 * width,
                             .count = count,
                             .component = c,
                             .type = type,
                             .is_big_endian = node % 2 == 0,
                             .first_node = node});
    place += 3 * width * std::uint64_t(count) + std::uint64_t(node % 7);
    node += count;
  }
  size = place + 3;
  std::ranges::shuffle(places.runs, std::mt19937(1));
  return places;
}

}  // namespace

TEST_CASE("A copy has the numbers of very many runs, over the borders of its pieces",
          "[core][formats]") {
  constexpr Index kNodes = 150'000;  // some MB
  std::size_t size = 0;
  const BinaryPlaces places = many_runs(kNodes, size);
  REQUIRE(size > std::size_t{5} << 19);
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < size; ++i) bytes[i] = char(i * i + i / 251);
  Points before = Points::Zero(kNodes, 3), after = before;
  for (Index node = 0; node < kNodes; ++node)
    if (node % 5) after.row(node) << double(node), -0.1 * double(node), 1e-3;
  const FormatFolder folder;
  const SourceBytes source = read_source(folder.put("bytes", bytes));
  write_places(source.source, places, before, after, folder / "copy");
  std::string expected = bytes;
  replace_coordinates(expected, places, before, after);
  CHECK(bytes_of(folder / "copy") == expected);
  CHECK(expected != bytes);
}

TEST_CASE("Runs are found by their place, without a look at the others", "[core][formats]") {
  constexpr Index kNodes = 10'000;
  std::size_t size = 0;
  const BinaryPlaces places = many_runs(kNodes, size);
  const RunsByPlace runs(places);
  const auto end_of = [](const BinaryRun& run) {
    return run.place + std::uint64_t(run.count - 1) * run.stride +
           (run.type == BinaryRun::Type::Float32 ? 4 : 8);
  };
  for (std::uint64_t begin = 0; begin < size; begin += 977) {
    const std::uint64_t end = std::min<std::uint64_t>(begin + 100, size);
    std::vector<const BinaryRun*> expected;
    for (const BinaryRun& run : places.runs)
      if (run.place < end && end_of(run) > begin) expected.push_back(&run);
    const auto found = runs.over(begin, end);
    for (const BinaryRun* run : expected) CHECK(std::ranges::count(found, run) == 1);
    // Those of a block, whose components lie inside of each other's reach, may be more.
    CHECK(std::ssize(found) <= std::ssize(expected) + 2);
    CHECK(runs.over(begin, begin).size() <= 3);
  }
  CHECK(runs.over(0, 5).empty());
  CHECK(runs.over(size, size + 100).empty());
}

}  // namespace cadmorph::test
