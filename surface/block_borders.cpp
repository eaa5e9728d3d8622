#include "surface/block_borders.h"

#include <algorithm>
#include <map>
#include <span>
#include <utility>

#include "core/cell_topology.h"
#include "surface/surface_mesh.h"

namespace cadmorph {
namespace {

// What lies between two regions: how much of it, and how much on the CAD.
struct Border {
  Index parts = 0, on_cad = 0;
};
using Borders = std::map<std::pair<int, int>, Border>;

class Blocks {
 public:
  Blocks(const Mesh& mesh, const Boundary& boundary, const Association& association)
      : mesh_(mesh), boundary_(boundary), association_(association) {
    for (const auto& [region, zone] : mesh.zone_of_block) first_[region] = region;
  }

  JoinedBlocks join() {
    const Borders borders = dimension(mesh_) < 3 ? borders_of_shells() : borders_of_solids();
    bool has_joined = false;
    for (const auto& [pair, border] : borders) {
      if (2 * border.on_cad > border.parts) continue;
      const int a = first_of(pair.first), b = first_of(pair.second);
      first_[std::max(a, b)] = std::min(a, b);
      has_joined = true;
    }
    if (!has_joined) return {};
    JoinedBlocks result;
    for (const int region : mesh_.regions)
      result.regions.push_back(first_.contains(region) ? first_of(region) : region);
    result.boundary = boundary_without([&](FacetId f) {
      const int a = mesh_.region(boundary_.cell[f]), b = region_beyond(f);
      return are_of_a_zone(a, b) && first_of(a) == first_of(b) && !is_on_cad(f);
    });
    return result;
  }

 private:
  int first_of(int region) const {
    while (first_.at(region) != region) region = first_.at(region);
    return region;
  }

  bool are_of_a_zone(int a, int b) const {
    const std::map<int, int>& zones = mesh_.zone_of_block;
    return a != b && zones.contains(a) && zones.contains(b) && zones.at(a) == zones.at(b);
  }

  int region_beyond(FacetId f) const {
    const Index cell = boundary_.neighbour[f];
    return mesh_.region(cell < 0 ? boundary_.cell[f] : cell);
  }

  CadDimension dimension_at(Index node) const {
    return association_.dimension[row_of(boundary_, node)];
  }

  bool is_on_cad(FacetId f) const {
    if (association_.facet_face[f] >= 0) return true;
    // Facets on what is held have no face.
    return !association_.held_faces.empty() &&
           std::ranges::all_of(boundary_.facet(f), [&](Index node) {
             return dimension_at(node) != CadDimension::None;
           });
  }

  Borders borders_of_solids() const {
    Borders result;
    for (const FacetId f : association_.facet_face.ids()) {
      const int a = mesh_.region(boundary_.cell[f]), b = region_beyond(f);
      if (!are_of_a_zone(a, b)) continue;
      Border& border = result[std::minmax({a, b})];
      ++border.parts;
      border.on_cad += is_on_cad(f);
    }
    return result;
  }

  Borders borders_of_shells() const {
    struct Side {
      Index low, high;  // nodes of the edge
      int region;
    };
    std::vector<Side> sides;
    for (Index f = 0; f < boundary_.facet_count(); ++f) {
      const auto nodes = boundary_.facet(f);
      const Index corners = corner_count(boundary_.types[f], std::ssize(nodes));
      for (Index i = 0; i < corners; ++i) {
        const auto [low, high] = std::minmax({nodes[i], nodes[(i + 1) % corners]});
        sides.push_back({low, high, mesh_.region(boundary_.cell[f])});
      }
    }
    const auto edge = [](const Side& side) { return std::pair(side.low, side.high); };
    std::ranges::sort(sides, {}, edge);
    const auto is_on_edge = [&](Index node) {
      const CadDimension on = dimension_at(node);
      return on == CadDimension::Vertex || on == CadDimension::Edge;
    };
    Borders result;
    for (std::size_t i = 1; i < sides.size(); ++i) {
      const Side &a = sides[i - 1], &b = sides[i];
      if (edge(a) != edge(b) || !are_of_a_zone(a.region, b.region)) continue;
      Border& border = result[std::minmax({a.region, b.region})];
      ++border.parts;
      border.on_cad += is_on_edge(a.low) && is_on_edge(a.high);
    }
    return result;
  }

  template <class IsLeftOut>
  Boundary boundary_without(IsLeftOut is_left_out) const {
    Boundary result;
    result.offsets = {0};
    for (const FacetId f : association_.facet_face.ids()) {
      if (is_left_out(f)) continue;
      const auto nodes = boundary_.facet(f);
      result.types.push_back(boundary_.types[f]);
      result.cell.push_back(boundary_.cell[f]);
      result.neighbour.push_back(boundary_.neighbour[f]);
      result.connectivity.insert(result.connectivity.end(), nodes.begin(), nodes.end());
      result.offsets.push_back(std::ssize(result.connectivity));
    }
    result.nodes = result.connectivity;
    std::ranges::sort(result.nodes);
    result.nodes.erase(std::ranges::unique(result.nodes).begin(), result.nodes.end());
    return result;
  }

  const Mesh& mesh_;
  const Boundary& boundary_;
  const Association& association_;
  std::map<int, int> first_;  // of each block: one it is joined to, itself where it comes first
};

}  // namespace

JoinedBlocks join_blocks(const Mesh& mesh, const Boundary& boundary,
                         const Association& association) {
  if (mesh.zone_of_block.size() < 2) return {};
  return Blocks(mesh, boundary, association).join();
}

}  // namespace cadmorph
