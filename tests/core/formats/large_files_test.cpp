#include <array>
#include <catch2/catch.hpp>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/formats/text_scanner.h"
#include "tests/core/formats/binary_text.h"
#include "tests/core/formats/format_checks.h"

// Large files are read and copied in blocks, on all threads: these tests have records on both sides
// of every border that a block can have.

namespace cadmorph::test {
namespace {

/// A row of hexahedra along x.
struct Bar {
  Index cells = 20000;

  Index node_count() const { return 4 * (cells + 1); }
  /// Coordinates of many lengths as text.
  Eigen::RowVector3d point(Index node) const {
    const double turn = std::sin(double(node / 4));
    constexpr std::array<std::array<double, 2>, 4> kCorners{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
    const auto& corner = kCorners[std::size_t(node % 4)];
    return {double(node / 4) + (node % 8 < 4 ? 0 : 0.1 * turn), corner[0],
            -corner[1] * turn * 1e-3};
  }
  std::array<Index, 8> cell(Index c) const {
    std::array<Index, 8> nodes;
    for (Index i = 0; i < 4; ++i) {
      nodes[std::size_t(i)] = 4 * c + i;
      nodes[std::size_t(4 + i)] = 4 * (c + 1) + i;
    }
    return nodes;
  }

  void require_read_from(const std::filesystem::path& path) const {
    const MeshFile file(path);
    const Mesh& mesh = file.mesh();
    REQUIRE(mesh.node_count() == node_count());
    REQUIRE(mesh.cell_count() == cells);
    Index wrong_points = 0, wrong_cells = 0;
    for (Index node = 0; node < node_count(); ++node)
      wrong_points += mesh.points.row(node) != point(node) ? 1 : 0;
    for (Index c = 0; c < cells; ++c) {
      const auto expected = cell(c);
      wrong_cells += std::ranges::equal(mesh.cell(c), expected) ? 0 : 1;
    }
    CHECK(wrong_points == 0);
    CHECK(wrong_cells == 0);
  }
};

std::string shortest(double value) {
  std::array<char, 32> buffer;
  return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
}

std::string coordinates(const Eigen::RowVector3d& point, std::string_view separator) {
  std::string text = shortest(point(0));
  for (int c = 1; c < 3; ++c) text += std::string(separator) + shortest(point(c));
  return text;
}

std::string su2_of(const Bar& bar) {
  std::string text = "NDIME= 3\nNELEM= " + std::to_string(bar.cells) + "\n";
  for (Index c = 0; c < bar.cells; ++c) {
    text += "12";
    for (const Index node : bar.cell(c)) text += (node % 3 ? "\t" : " ") + std::to_string(node);
    text += c % 5 ? " " + std::to_string(c) + "\n" : "\n";
    if (c % 97 == 0) text += "% 12 a comment with numbers 1 2 3\n\n";
  }
  text += "NPOIN= " + std::to_string(bar.node_count()) + "\n";
  for (Index node = 0; node < bar.node_count(); ++node) {
    const Eigen::RowVector3d point = bar.point(node);
    // A plus sign, and a point over two lines, as no program writes it.
    text += (node % 11 == 0 ? "+" : "") + coordinates(point, node % 1013 == 0 ? "\n" : " ") + " " +
            std::to_string(node) + "\n";
  }
  return text + "NMARK= 0\n";
}

std::string gmsh_of(const Bar& bar) {
  std::string text =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" + std::to_string(bar.node_count()) + "\n";
  for (Index node = 0; node < bar.node_count(); ++node)
    text += std::to_string(node + 1) + " " + coordinates(bar.point(node), " ") + "\n";
  text += "$EndNodes\n$Elements\n" + std::to_string(bar.cells) + "\n";
  for (Index c = 0; c < bar.cells; ++c) {
    text += std::to_string(c + 1) + " 5 2 0 1";
    for (const Index node : bar.cell(c)) text += " " + std::to_string(node + 1);
    text += "\n";
  }
  return text + "$EndElements\n";
}

std::string binary_gmsh_of(const Bar& bar, bool is_big_endian) {
  BinaryText text(is_big_endian);
  text.text("$MeshFormat\n2.2 1 8\n").int32({1}).text("\n$EndMeshFormat\n$Nodes\n");
  text.text(std::to_string(bar.node_count()) + "\n");
  for (Index node = 0; node < bar.node_count(); ++node) {
    const Eigen::RowVector3d point = bar.point(node);
    text.int32({std::int32_t(node + 1)}).float64({point(0), point(1), point(2)});
  }
  text.text("\n$EndNodes\n$Elements\n" + std::to_string(bar.cells) + "\n");
  text.int32({5, std::int32_t(bar.cells), 2});
  for (Index c = 0; c < bar.cells; ++c) {
    text.int32({std::int32_t(c + 1), 0, 1});
    for (const Index node : bar.cell(c)) text.int32({std::int32_t(node + 1)});
  }
  return text.text("\n$EndElements\n").bytes();
}

/// Numbers and coordinates of the nodes between `separator`s, with a comment now and then.
std::string node_lines(const Bar& bar, const std::string& separator, const std::string& comment) {
  std::string text;
  for (Index node = 0; node < bar.node_count(); ++node) {
    text += std::to_string(node + 1) + separator + coordinates(bar.point(node), separator) + "\n";
    if (node % 501 == 0) text += comment + " 1, 2, 3, 4\n\n";
  }
  return text;
}

/// Elements in one line, or in two of which the first ends with a comma or, every 1000th, without.
std::string abaqus_of(const Bar& bar) {
  std::string text = "*NODE, NSET=all\n" + node_lines(bar, ", ", "**");
  text += "*ELEMENT, TYPE=C3D8, ELSET=bar\n";
  for (Index c = 0; c < bar.cells; ++c) {
    text += std::to_string(c + 1);
    const auto nodes = bar.cell(c);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      text += i == 4 && c % 1000 == 999 ? "\n" : i == 4 && c % 2 ? ",\n" : ",";
      text += std::to_string(nodes[i] + 1);
    }
    text += "\n";
  }
  return text;
}

std::string nastran_of(const Bar& bar) {
  std::string text = "BEGIN BULK\n";
  for (Index node = 0; node < bar.node_count(); ++node) {
    text += "GRID," + std::to_string(node + 1) + ",," + coordinates(bar.point(node), ",") + "\n";
    if (node % 501 == 0) text += "$ GRID,1,,2.,3.,4.\n\n";
  }
  for (Index c = 0; c < bar.cells; ++c) {
    text += "CHEXA," + std::to_string(c + 1) + ",7";
    const auto nodes = bar.cell(c);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (i == 6) text += c % 3 == 0 ? "\n$ between\n+" : "\n+";
      text += "," + std::to_string(nodes[i] + 1);
    }
    text += "\n";
  }
  return text + "ENDDATA\nGRID,1,,nothing,is,read\n";
}

std::string columns_of(std::initializer_list<Index> numbers, int width) {
  std::string text;
  for (const Index number : numbers) {
    const std::string digits = std::to_string(number);
    text += std::string(std::size_t(width) - digits.size(), ' ') + digits;
  }
  return text;
}

/// Elements over two lines: 15 numbers, and the last four nodes.
std::string ansys_of(const Bar& bar) {
  std::string text = "/PREP7\nET,1,185\nNBLOCK,6,SOLID\n(3i9,6e25.17e3)\n";
  for (Index node = 0; node < bar.node_count(); ++node) {
    text += columns_of({node + 1, 0, 0}, 9);
    for (const double value : bar.point(node)) {
      const std::string number = shortest(value);
      text += std::string(25 - number.size(), ' ') + number;
    }
    text += "\n";
  }
  text += "N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID\n(15i9)\n";
  for (Index c = 0; c < bar.cells; ++c) {
    const auto n = bar.cell(c);
    text += columns_of({1, 1, 1, 1, 0, 0, 0, 0, 8, 0, c + 1}, 9);
    text += columns_of({n[0] + 1, n[1] + 1, n[2] + 1, n[3] + 1}, 9) + "\n";
    text += columns_of({n[4] + 1, n[5] + 1, n[6] + 1, n[7] + 1}, 9) + "\n";
  }
  return text + "       -1\nFINISH\n";
}

/// Elements in one line, every third in two.
std::string ls_dyna_of(const Bar& bar) {
  std::string text = "*KEYWORD\n*NODE\n" + node_lines(bar, ",", "$");
  text += "*ELEMENT_SOLID\n";
  for (Index c = 0; c < bar.cells; ++c) {
    const auto n = bar.cell(c);
    text += columns_of({c + 1, 7}, 8);
    if (c % 3 == 0) text += "\n";
    for (const Index node : n) text += columns_of({node + 1}, 8);
    text += "\n";
  }
  return text + "*END\n";
}

/// The text with what stands at `place` overwritten, and the number of its line.
std::pair<std::string, std::string> damaged(std::string text, std::size_t place) {
  text[place] = 'x';
  const auto line = 1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(place), '\n');
  return {std::move(text), "line " + std::to_string(line) + ":"};
}

}  // namespace

TEST_CASE("Large meshes are read and copied as small ones are", "[core][formats]") {
  const Bar bar;
  const FormatFolder folder;
  const auto require_all = [&](const std::string& name, const std::string& bytes) {
    INFO(name);
    REQUIRE(bytes.size() > 1 << 21);
    const auto path = folder.put(name, bytes);
    bar.require_read_from(path);
    require_promise(path, folder, "out" + path.extension().string(), 1e-12);
  };
  require_all("bar.su2", su2_of(bar));
  require_all("bar.msh", gmsh_of(bar));
  require_all("little.msh", binary_gmsh_of(bar, false));
  require_all("big.msh", binary_gmsh_of(bar, true));
  require_all("bar.inp", abaqus_of(bar));
  require_all("bar.bdf", nastran_of(bar));
  require_all("bar.cdb", ansys_of(bar));
  require_all("bar.k", ls_dyna_of(bar));
}

TEST_CASE("What is wrong late in a large mesh is told by its line", "[core][formats]") {
  const Bar bar;
  const FormatFolder folder;
  const auto require_told = [&](const std::string& name, const std::string& text,
                                std::size_t place) {
    INFO(name);
    REQUIRE(place != std::string::npos);
    const auto [bad, line] = damaged(text, place);
    require_refused(folder.put(name, bad), {name, line, "expected"});
  };
  const std::string su2 = su2_of(bar), gmsh = gmsh_of(bar), abaqus = abaqus_of(bar);
  const std::string nastran = nastran_of(bar);
  require_told("bar.su2", su2, su2.find("NPOIN=") - 200);
  require_told("bar.msh", gmsh, gmsh.rfind("$EndElements") - 3);
  require_told("bar.inp", abaqus, abaqus.size() - 3);
  require_told("nodes.inp", abaqus, abaqus.find("*ELEMENT") - 3);
  require_told("bar.bdf", nastran, nastran.find("CHEXA,19000,") + 8);
  const std::string ansys = ansys_of(bar), ls_dyna = ls_dyna_of(bar);
  require_told("bar.cdb", ansys, ansys.rfind("FINISH") - 20);
  require_told("nodes.cdb", ansys, ansys.find("N,R5.3") - 30);
  require_told("bar.k", ls_dyna, ls_dyna.rfind("*END") - 3);
  require_told("nodes.k", ls_dyna, ls_dyna.find("*ELEMENT") - 3);
}

TEST_CASE("Lines that look like the first of an element are none where one goes on",
          "[core][formats]") {
  // The number behind eight others of the second line could be that of the nodes.
  const std::array<Index, 20> nodes{17, 2,  3,  4,  5,  6,  7, 8,  9,  10,
                                    11, 12, 13, 14, 15, 16, 1, 18, 19, 20};
  std::string text = "/PREP7\nET,1,186\nNBLOCK,6,SOLID\n(3i9,6e21.13e3)\n";
  for (Index node = 1; node <= 20; ++node)
    text += columns_of({node, 0, 0}, 9) + columns_of({node, node % 3, node % 7}, 21) + "\n";
  text += "N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID\n(19i9)\n";
  constexpr Index kElements = 5000;
  for (Index e = 1; e <= kElements; ++e) {
    text += columns_of({1, 1, 1, 1, 0, 0, 0, 0, 20, 0, e}, 9);
    for (std::size_t i = 0; i < nodes.size(); ++i)
      text += (i == 8 ? "\n" : "") + columns_of({nodes[i]}, 9);
    text += "\n";
  }
  const FormatFolder folder;
  const MeshFile file(folder.put("solid186.cdb", text + "       -1\n"));
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.cell_count() == kElements);
  Index wrong = 0;
  for (Index c = 0; c < kElements; ++c) {
    wrong += mesh.types[std::size_t(c)] == CellType::QuadraticHexahedron ? 0 : 1;
    for (const std::size_t i : {0, 1, 2, 3, 4, 5, 6, 7})
      wrong += mesh.cell(c)[i] == nodes[i] - 1 ? 0 : 1;
  }
  CHECK(wrong == 0);
}

TEST_CASE("Lines that follow elements are no elements where a block begins with them",
          "[core][formats]") {
  constexpr Index kElements = 20000;
  std::string text = "*KEYWORD\n*NODE\n";
  for (Index node = 1; node <= 2 * kElements + 2; ++node)
    text += columns_of({node}, 8) + columns_of({node / 2, node % 2, 0}, 16) + "\n";
  text += "*ELEMENT_SHELL_THICKNESS\n";
  for (Index e = 1; e <= kElements; ++e) {
    text += columns_of({e, 1, 2 * e - 1, 2 * e, 2 * e + 2, 2 * e + 1}, 8) + "\n";
    text += columns_of({1, 1, 2, 3, 4, 5}, 8) + "\n";
  }
  const FormatFolder folder;
  const MeshFile file(folder.put("shells.k", text + "*END\n"));
  const Mesh& mesh = file.mesh();
  REQUIRE(mesh.cell_count() == kElements);
  Index wrong = 0;
  for (Index c = 0; c < kElements; ++c) {
    const std::array<Index, 4> expected{2 * c, 2 * c + 1, 2 * c + 3, 2 * c + 2};
    wrong += std::ranges::equal(mesh.cell(c), expected) ? 0 : 1;
  }
  CHECK(wrong == 0);
}

TEST_CASE("Words and numbers read ahead are those of the text", "[core][formats]") {
  constexpr std::array<std::string_view, 13> kWords{
      "0",      "-0",  "+7", "-12", "1e3", "-2.5", "42", ".5", "123456789012345678901234567890",
      "1e-320", "0.1", "8",  "-9"};
  constexpr Index kCount = 400'000;  // several times what is read ahead at once
  const auto word_at = [&](Index i) {
    return i % 1000 == 999 ? "name" : kWords[std::size_t(i * i + i / 7) % kWords.size()];
  };
  const std::string blanks(20, ' ');
  std::string text;
  std::vector<std::size_t> places;
  for (Index i = 0; i < kCount; ++i) {
    places.push_back(text.size());
    text += word_at(i);
    text += i % 50 == 49 ? " # 5 6\n" : i % 7 == 0 ? "\n" : i % 3 ? blanks : "(";
  }
  TextScanner in(text, "numbers", '#', "(");
  const auto is_read = [&](Index i) {
    in.take('(');
    const std::string word(word_at(i));
    if (word == "name") {
      CHECK_THROWS(in.number("a number"));
      return in.word("a word") == word;
    }
    const bool is_integer = word.find_first_not_of("+-0123456789") == word.npos && word.size() < 20;
    if (is_integer && i % 2) return in.integer("an integer") == std::stoll(word);
    if (!is_integer && i % 1000 == 0) CHECK_THROWS(in.integer("an integer"));
    double real = 0;
    const TextToken token = in.number("a number", real);
    return token.place == places[std::size_t(i)] && token.length == word.size() &&
           real == std::strtod(word.c_str(), nullptr) &&
           std::signbit(real) == (word.front() == '-');
  };
  Index wrong = 0;
  for (Index i = 0; i < kCount; ++i) {
    // Now and then a part is skipped, or read again.
    if (i % 90'001 == 90'000) {
      in.go_to(places[std::size_t(i - 60'000)]);
      for (Index j = i - 60'000; j < i - 59'000; ++j) wrong += is_read(j) ? 0 : 1;
      in.go_to(places[std::size_t(i)]);
    }
    wrong += is_read(i) ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK_FALSE(in.skip_space());
}

}  // namespace cadmorph::test
