#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <numeric>
#include <thread>

#include "core/errors.h"
#include "core/formats/child_process.h"
#include "core/formats/hdf5_coordinates.h"
#include "tests/core/formats/format_checks.h"
#include "tests/core/formats/hdf5_writer.h"

namespace fs = std::filesystem;

namespace cadmorph::test {
namespace {

constexpr Index kNodes = 10;

std::vector<double> values(Index count) {
  std::vector<double> result(std::size_t(count), 0);
  for (Index i = 0; i < count; ++i) result[std::size_t(i)] = 0.1 * double(i) + 1 / 3.;
  return result;
}

/// Rows of three in the dataset "/points".
std::vector<Hdf5Run> rows(const std::string& dataset = "/points") {
  std::vector<Hdf5Run> runs;
  for (int c = 0; c < 3; ++c)
    runs.push_back({.dataset = dataset, .first = c, .step = 3, .count = kNodes, .component = c});
  return runs;
}

/// Copies a file with points of such storage, one node moved; requires that the copy holds it, and
/// returns the number of bytes that differ, -1 for files of different sizes.
Index changed_bytes(const FormatFolder& folder, const Storage& storage) {
  const auto path = folder / "points.h5";
  {
    Hdf5Writer writer(path);
    writer.numbers("/points", values(3 * kNodes), storage);
    writer.numbers("/field", values(5));
  }
  const Hdf5File file(path);
  Points points(kNodes, 3);
  const auto copier = read_hdf5_coordinates(file, rows(), points);
  copier->write(folder / "same.h5", points, points);
  CHECK(bytes_of(folder / "same.h5") == bytes_of(path));

  Points moved = points;
  moved(7, 1) = -1 / 7.;
  copier->write(folder / "copy.h5", points, moved);
  const Points readable = copier->readable(points, moved);
  const Hdf5File copy(folder / "copy.h5");
  const std::vector<double> found = copy.numbers("/points");
  const Points expected = readable.size() > 0 ? readable : moved;
  CHECK(Eigen::Map<const Points>(found.data(), kNodes, 3) == expected);
  CHECK(copy.numbers("/field") == values(5));
  // Not left marked as being written.
  CHECK_NOTHROW(Hdf5Library(folder / "copy.h5", Hdf5Library::Mode::Write));
  const std::string a = bytes_of(path), b = bytes_of(folder / "copy.h5");
  if (a.size() != b.size()) return -1;
  return std::inner_product(a.begin(), a.end(), b.begin(), Index{0}, std::plus<>(),
                            std::not_equal_to<>());
}

}  // namespace

TEST_CASE("An HDF5 file is read while another thread registers functions for the exit",
          "[core][formats]") {
  const FormatFolder folder;
  const auto path = folder / "points.h5";
  {  // In a copy: once it has begun, the library registers nothing more.
    const ChildProcess writer(60, [&](const Socket& socket) {
      Hdf5Writer(path).numbers("/points", values(5));
      constexpr char kDone = 1;
      socket.send(&kDone, 1);
    });
    char done = 0;
    REQUIRE(writer.socket().receive(&done, 1));
  }
  std::atomic<int> left = 20;
  const std::jthread other([&] {  // as static objects of OCCT do while a STEP file is read
    for (int i = 0; i < 2'000'000 && left > 0; ++i) std::atexit([] {});
  });
  for (; left > 0; --left) CHECK(Hdf5File(path).numbers("/points") == values(5));
}

TEST_CASE("A number in an HDF5 file is replaced in place", "[core][formats]") {
  const FormatFolder folder;
  const hsize_t rows = kNodes;
  const auto is_in_place = [](Index bytes) { return bytes > 0 && bytes <= 8; };
  CHECK(is_in_place(changed_bytes(folder, {.shape = {rows, 3}})));
  CHECK(is_in_place(changed_bytes(folder, {.shape = {rows, 3}, .type = H5T_IEEE_F64BE})));
  CHECK(is_in_place(changed_bytes(folder, {.shape = {rows, 3}, .type = H5T_IEEE_F32LE})));
  CHECK(is_in_place(changed_bytes(folder, {.shape = {rows, 3}, .chunk = {4, 3}})));
  // These HDF5 writes anew.
  changed_bytes(folder, {.shape = {rows, 3}, .chunk = {4, 2}});
  changed_bytes(folder, {.shape = {rows, 3}, .chunk = {4, 3}, .is_compressed = true});
  changed_bytes(
      folder, {.shape = {rows, 3}, .chunk = {4, 3}, .is_compressed = true, .type = H5T_IEEE_F32BE});
}

TEST_CASE("HDF5 datasets and attributes are read as what they are", "[core][formats]") {
  const FormatFolder folder;
  {
    Hdf5Writer writer(folder / "a.h5");
    writer.group("/z");
    writer.group("/a");
    writer.integers("/z/numbers", {1, -2, 3, 4, 5, 6}, {.shape = {2, 3}, .type = H5T_STD_I16BE});
    writer.bytes("/z/names", std::string("left \0\0right\0\0", 14), {.shape = {2, 7}});
    writer.attribute("/z", "count", std::vector<int>{7, 8});
    writer.attribute("/z", "title", "a mesh  ", 20);
  }
  const Hdf5File file(folder / "a.h5");
  CHECK(file.has("/z/numbers"));
  CHECK(file.is_dataset("/z/numbers"));
  CHECK(!file.is_dataset("/z"));
  CHECK(!file.has("/z/none/of/these"));
  CHECK(file.shape("/z/numbers") == std::vector<Index>{2, 3});
  CHECK(file.integers("/z/numbers") == std::vector<Index>{1, -2, 3, 4, 5, 6});
  CHECK(file.texts("/z/names") == std::vector<std::string>{"left", "right"});
  CHECK(file.children("/z") == std::vector<std::string>{"numbers", "names"});
  CHECK(file.integer_attribute("/z", "count") == std::vector<Index>{7, 8});
  CHECK(file.text_attribute("/z", "title") == "a mesh");
  CHECK(file.has_attribute("/z", "title"));
  CHECK(!file.has_attribute("/z", "name"));
}

TEST_CASE("The places of a dataset's numbers are told", "[core][formats]") {
  const FormatFolder folder;
  {
    Hdf5Writer writer(folder / "a.h5");
    const hsize_t rows = kNodes;
    writer.numbers("/whole", values(3 * kNodes), {.shape = {rows, 3}});
    writer.numbers("/chunks", values(3 * kNodes), {.shape = {rows, 3}, .chunk = {4, 3}});
    writer.numbers("/columns", values(3 * kNodes), {.shape = {rows, 3}, .chunk = {4, 2}});
    writer.numbers("/packed", values(3 * kNodes),
                   {.shape = {rows, 3}, .chunk = {4, 3}, .is_compressed = true});
  }
  const Hdf5File file(folder / "a.h5");
  const std::string bytes = bytes_of(folder / "a.h5");
  for (const auto& [name, count] : {std::pair("/whole", 1), {"/chunks", 3}}) {
    const std::vector<Hdf5Extent> extents = file.extents(name);
    CHECK(std::ssize(extents) == count);
    Index all = 0;
    for (const Hdf5Extent& extent : extents) {
      std::vector<double> found(std::size_t(extent.count), 0);
      REQUIRE(extent.place + 8 * found.size() <= bytes.size());
      std::memcpy(found.data(), bytes.data() + extent.place, 8 * found.size());
      for (Index i = 0; i < extent.count; ++i)
        CHECK(found[std::size_t(i)] == values(3 * kNodes)[std::size_t(extent.first + i)]);
      all += extent.count;
    }
    CHECK(all == 3 * kNodes);
  }
  CHECK(file.extents("/columns").empty());
  CHECK(file.extents("/packed").empty());
}

TEST_CASE("A dataset of many pieces is read whole", "[core][formats]") {
  const FormatFolder folder;
  constexpr Index kRows = 100'000;
  std::vector<int> numbers(3 * kRows);
  std::iota(numbers.begin(), numbers.end(), -5);
  const hsize_t rows = kRows;
  const std::vector<Storage> storages = {
      {.shape = {}},
      {.shape = {rows, 3}},
      {.shape = {3, rows}},
      {.shape = {rows, 3}, .chunk = {7'000, 2}, .is_compressed = true},
      {.shape = {3, rows}, .chunk = {2, 1'000}, .is_compressed = true},
      {.shape = {rows / 10, 5, 6}, .chunk = {400, 5, 4}}};
  for (const Storage& storage : storages) {
    {
      Hdf5Writer writer(folder / "a.h5");
      writer.integers("/numbers", numbers, storage);
    }
    const Hdf5File file(folder / "a.h5");
    CHECK(std::ranges::equal(file.integers("/numbers"), numbers));
    CHECK(std::ranges::equal(file.numbers("/numbers"), numbers));
    fs::remove(folder / "a.h5");
  }
}

TEST_CASE("Several HDF5 files are open at once", "[core][formats]") {
  const FormatFolder folder;
  for (const int i : {0, 1, 2})
    Hdf5Writer(folder / (std::to_string(i) + ".h5")).integers("/number", {i});
  auto first = std::make_unique<Hdf5File>(folder / "0.h5");
  const Hdf5File second(folder / "1.h5");
  first.reset();
  const Hdf5File third(folder / "2.h5");
  CHECK(second.integers("/number") == std::vector<Index>{1});
  CHECK(third.integers("/number") == std::vector<Index>{2});
}

TEST_CASE("What is wrong in an HDF5 file is named", "[core][formats]") {
  const FormatFolder folder;
  {
    Hdf5Writer writer(folder / "a.h5");
    writer.integers("/numbers", {1, 2, 3});
    writer.group("/group");
    REQUIRE(H5Lcreate_external("other.h5", "/points", writer.file(), "/linked", H5P_DEFAULT,
                               H5P_DEFAULT) >= 0);
  }
  const Hdf5File file(folder / "a.h5");
  Points points(kNodes, 3);
  const auto fails = [](const auto& action, std::initializer_list<std::string> parts) {
    std::string text = "nothing";
    try {
      action();
    } catch (const IoError& error) {
      text = error.what();
    }
    for (const std::string& part : parts) CHECK_THAT(text, Catch::Contains(part));
  };
  fails([&] { file.integers("/none"); }, {"a.h5", "/none", "missing"});
  fails([&] { file.integers("/group"); }, {"a.h5", "/group", "no dataset"});
  fails([&] { file.children("/numbers"); }, {"a.h5", "/numbers", "no group"});
  fails([&] { file.integer_attribute("/group", "size"); }, {"a.h5", "/group", "'size' is missing"});
  fails([&] { file.has("/linked"); }, {"a.h5", "/linked", "another file (other.h5)"});
  fails([&] { read_hdf5_coordinates(file, rows("/numbers"), points); },
        {"a.h5", "/numbers", "float32 or float64"});
  fails([&] { const Hdf5File text(folder.put("text.h5", "no such thing")); },
        {"text.h5", "no HDF5 file"});
  Hdf5Writer(folder / "few.h5").numbers("/points", values(29));
  fails([&] { read_hdf5_coordinates(Hdf5File(folder / "few.h5"), rows(), points); },
        {"29 numbers, too few", "10 nodes"});
}

}  // namespace cadmorph::test
