#include "tests/core/formats/foam_case.h"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cstring>
#include <map>

#include "core/formats/coordinate_places.h"

namespace cadmorph::test {
namespace {

std::string counted(Index count) {
  return std::string("\n").append(std::to_string(count)).append("\n");
}

/// Writes lists in a style.
class ListWriter {
 public:
  explicit ListWriter(const FoamStyle& style) : style_(style) {}

  std::string labels(const std::vector<Index>& values) const {
    std::string text = counted(std::ssize(values));
    if (style_.is_binary && values.empty()) return text;
    text += '(';
    for (const Index value : values)
      if (!style_.is_binary)
        text.append("\n").append(std::to_string(value));
      else if (style_.label_bits == 32)
        put(std::int32_t(value), text);
      else
        put(std::int64_t(value), text);
    return text + (style_.is_binary ? ")" : "\n)\n");
  }

  std::string points(const Points& values) const {
    std::string text = counted(values.rows()) + "(";
    for (Index i = 0; i < values.rows(); ++i) {
      if (!style_.is_binary) text += "\n(";
      for (int c = 0; c < 3; ++c)
        if (!style_.is_binary) {
          if (c > 0) text += ' ';
          write_shortest(values(i, c), {}, text);
        } else if (style_.scalar_bits == 32) {
          put(std::bit_cast<std::int32_t>(float(values(i, c))), text);
        } else {
          put(std::bit_cast<std::int64_t>(values(i, c)), text);
        }
      if (!style_.is_binary) text += ")";
    }
    return text + (style_.is_binary ? ")" : "\n)\n");
  }

  std::string faces(const std::vector<std::vector<Index>>& values) const {
    if (style_.is_binary) {
      std::vector<Index> offsets = {0}, nodes;
      for (const auto& face : values) {
        nodes.insert(nodes.end(), face.begin(), face.end());
        offsets.push_back(std::ssize(nodes));
      }
      return labels(offsets) + labels(nodes);
    }
    std::string text = counted(std::ssize(values)) + "(";
    for (const auto& face : values) {
      text.append("\n").append(std::to_string(face.size())).append("(");
      for (std::size_t i = 0; i < face.size(); ++i)
        text.append(i > 0 ? " " : "").append(std::to_string(face[i]));
      text += ")";
    }
    return text + "\n)\n";
  }

 private:
  template <class Bits>
  void put(Bits bits, std::string& text) const {
    char bytes[sizeof bits];
    std::memcpy(bytes, &bits, sizeof bits);
    if (style_.is_big_endian != (std::endian::native == std::endian::big))
      std::reverse(bytes, bytes + sizeof bits);
    text.append(bytes, sizeof bits);
  }

  const FoamStyle& style_;
};

std::string header(const std::string& foam_class, const std::string& object,
                   const FoamStyle& style) {
  const std::string arch = std::string(style.is_big_endian ? "MSB" : "LSB") +
                           ";label=" + std::to_string(style.label_bits) +
                           ";scalar=" + std::to_string(style.scalar_bits);
  return "/*--- C++ ---*\\\n  \\\\/  M anipulation { ; \n\\*---*/\nFoamFile\n{\n    version 2.0;\n"
         "    format " +
         std::string(style.is_binary ? "binary" : "ascii") + ";\n    class " + foam_class +
         ";\n    arch \"" + arch + "\";\n    location \"constant/polyMesh\";\n    object " +
         object + ";\n}\n// * * * * * //\n\n";
}

std::string boundary_text(const FoamMesh& mesh) {
  std::string text = std::to_string(mesh.patches.size()) + "\n(\n";
  for (const FoamMesh::Patch& patch : mesh.patches)
    text += patch.name + "\n{\n  type " + patch.type +
            ";\n  inGroups List<word> 1(wall);\n  coordinateSystem { origin (0 0 0); }\n" +
            patch.more + "  nFaces " + std::to_string(patch.count) + ";\n  startFace " +
            std::to_string(patch.start) + ";\n}\n";
  return text + ")\n";
}

std::string zones_text(const FoamMesh& mesh, const FoamStyle& style) {
  std::string text = std::to_string(mesh.cell_zones.size()) + "\n(\n";
  for (std::size_t i = 0; i < mesh.cell_zones.size(); ++i)
    text += "zone" + std::to_string(i) + "\n{\n  type cellZone;\ncellLabels List<label>" +
            ListWriter(style).labels(mesh.cell_zones[i]) + ";\n}\n";
  return text + ")\n";
}

bool is_left(const Mesh& mesh, const std::vector<Index>& face) {
  return std::ranges::all_of(face, [&](Index node) { return mesh.points(node, 0) == 0; });
}

}  // namespace

FoamMesh foam_mesh(const Mesh& mesh) {
  struct Side {
    std::vector<Index> face;
    Index owner, neighbour = -1;
  };
  std::map<std::vector<Index>, Side> sides;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    for (const Facet& facet : cell_facets(mesh, c)) {
      std::vector<Index> key = facet.nodes;
      std::ranges::sort(key);
      const auto [at, is_new] = sides.try_emplace(key, Side{facet.nodes, c});
      if (!is_new) at->second.neighbour = c;
    }
  FoamMesh result;
  result.points = mesh.points;
  const auto add = [&](auto&& is_wanted) {
    const Index start = std::ssize(result.faces);
    for (const auto& [key, side] : sides) {
      if (!is_wanted(side)) continue;
      result.faces.push_back(side.face);
      result.owner.push_back(side.owner);
      if (side.neighbour >= 0) result.neighbour.push_back(side.neighbour);
    }
    return std::pair(start, std::ssize(result.faces) - start);
  };
  add([](const Side& side) { return side.neighbour >= 0; });
  const auto left =
      add([&](const Side& side) { return side.neighbour < 0 && is_left(mesh, side.face); });
  const auto rest =
      add([&](const Side& side) { return side.neighbour < 0 && !is_left(mesh, side.face); });
  result.patches = {{.name = "left", .type = "wall", .start = left.first, .count = left.second},
                    {.name = "rest", .type = "patch", .start = rest.first, .count = rest.second}};
  return result;
}

std::vector<FoamMesh> decomposed(const FoamMesh& mesh, const std::vector<int>& processors) {
  const int count = 1 + *std::ranges::max_element(processors);
  std::vector<FoamMesh> pieces(static_cast<std::size_t>(count));
  for (int p = 0; p < count; ++p) {
    FoamMesh& piece = pieces[std::size_t(p)];
    std::map<Index, Index> cells, nodes;
    for (Index c = 0; c < std::ssize(processors); ++c)
      if (processors[c] == p) {
        cells.emplace(c, std::ssize(cells));
        piece.cell_addressing.push_back(c);
      }
    const auto neighbour = [&](Index f) {
      return f < std::ssize(mesh.neighbour) ? mesh.neighbour[f] : Index{-1};
    };
    const auto add_face = [&](Index f, bool is_turned) {
      std::vector<Index> face = mesh.faces[f];
      if (is_turned) std::reverse(face.begin() + 1, face.end());
      for (Index& node : face) {
        const auto [at, is_new] = nodes.emplace(node, std::ssize(nodes));
        if (is_new) piece.point_addressing.push_back(node);
        node = at->second;
      }
      piece.faces.push_back(face);
      piece.owner.push_back(cells.at(is_turned ? neighbour(f) : mesh.owner[f]));
      piece.face_addressing.push_back(is_turned ? -f - 1 : f + 1);
    };
    for (Index f = 0; f < std::ssize(mesh.neighbour); ++f)
      if (cells.contains(mesh.owner[f]) && cells.contains(neighbour(f))) {
        add_face(f, false);
        piece.neighbour.push_back(cells.at(neighbour(f)));
      }
    for (const FoamMesh::Patch& patch : mesh.patches) {
      const Index start = std::ssize(piece.faces);
      for (Index f = patch.start; f < patch.start + patch.count; ++f)
        if (cells.contains(mesh.owner[f])) add_face(f, false);
      piece.patches.push_back({.name = patch.name,
                               .type = patch.type,
                               .start = start,
                               .count = std::ssize(piece.faces) - start});
    }
    for (int other = 0; other < count; ++other) {
      const Index start = std::ssize(piece.faces);
      for (Index f = 0; f < std::ssize(mesh.neighbour); ++f) {
        const bool is_owner = cells.contains(mesh.owner[f]);
        if (is_owner == cells.contains(neighbour(f))) continue;
        if (processors[is_owner ? neighbour(f) : mesh.owner[f]] == other && other != p)
          add_face(f, !is_owner);
      }
      if (std::ssize(piece.faces) == start) continue;
      const std::string own = std::to_string(p), its = std::to_string(other);
      piece.patches.push_back({.name = "procBoundary" + own + "to" + its,
                               .type = "processor",
                               .start = start,
                               .count = std::ssize(piece.faces) - start,
                               .more = "  myProcNo " + own + ";\n  neighbProcNo " + its + ";\n"});
    }
    for (const std::vector<Index>& zone : mesh.cell_zones) {
      piece.cell_zones.emplace_back();
      for (const Index cell : zone)
        if (cells.contains(cell)) piece.cell_zones.back().push_back(cells.at(cell));
    }
    piece.points.resize(std::ssize(nodes), 3);
    for (const auto& [node, row] : nodes) piece.points.row(row) = mesh.points.row(node);
  }
  return pieces;
}

void put_foam_mesh(const FormatFolder& folder, const std::string& poly_mesh, const FoamMesh& mesh,
                   const FoamStyle& style) {
  const ListWriter list(style);
  const auto put = [&](const std::string& name, const std::string& foam_class,
                       const std::string& text) {
    const auto path = folder.put(poly_mesh + "/" + name, header(foam_class, name, style) + text);
    if (style.is_compressed && name != "boundary")
      REQUIRE(std::system(("gzip " + path.string()).c_str()) == 0);
  };
  put("points", "vectorField", list.points(mesh.points));
  put("faces", style.is_binary ? "faceCompactList" : "faceList", list.faces(mesh.faces));
  put("owner", "labelList", list.labels(mesh.owner));
  put("neighbour", "labelList", list.labels(mesh.neighbour));
  put("boundary", "polyBoundaryMesh", boundary_text(mesh));
  if (!mesh.cell_zones.empty()) put("cellZones", "regIOobject", zones_text(mesh, style));
  if (mesh.point_addressing.empty()) return;
  put("pointProcAddressing", "labelList", list.labels(mesh.point_addressing));
  put("faceProcAddressing", "labelList", list.labels(mesh.face_addressing));
  put("cellProcAddressing", "labelList", list.labels(mesh.cell_addressing));
}

}  // namespace cadmorph::test
