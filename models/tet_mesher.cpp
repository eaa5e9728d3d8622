#include "models/tet_mesher.h"

#include <unordered_map>

#include "models/gmsh_scope.h"
#include "models/hex_builder.h"

namespace cadmorph::models {
namespace {

using DimTags = gmsh::vectorpair;

void surround_with_cube(DimTags& solids, double width) {
  double x0, y0, z0, x1, y1, z1;
  gmsh::model::occ::getBoundingBox(3, solids.front().second, x0, y0, z0, x1, y1, z1);
  const int cube = gmsh::model::occ::addBox((x0 + x1 - width) / 2, (y0 + y1 - width) / 2,
                                            (z0 + z1 - width) / 2, width, width, width);
  DimTags around;
  std::vector<DimTags> history;
  gmsh::model::occ::cut({{3, cube}}, solids, around, history);
  solids = around;
}

void join_touching(DimTags& solids) {
  DimTags joined;
  std::vector<DimTags> history;
  gmsh::model::occ::fragment({solids.front()}, {solids.begin() + 1, solids.end()}, joined, history);
  solids = joined;
}

/// Nodes of the mesh in gmsh, numbered from 0 in the order of their first use.
class NodeTable {
 public:
  NodeTable() {
    std::vector<std::size_t> tags;
    std::vector<double> positions, parameters;
    gmsh::model::mesh::getNodes(tags, positions, parameters);
    for (std::size_t i = 0; i < tags.size(); ++i) {
      position_[tags[i]] = Eigen::Vector3d(&positions[3 * i]);
    }
  }
  Index id(std::size_t tag) {
    const auto [entry, is_new] = ids_.try_emplace(tag, static_cast<Index>(points_.size()));
    if (is_new) points_.push_back(position_.at(tag));
    return entry->second;
  }
  const std::vector<Eigen::Vector3d>& points() const { return points_; }

 private:
  std::unordered_map<std::size_t, Eigen::Vector3d> position_;
  std::unordered_map<std::size_t, Index> ids_;
  std::vector<Eigen::Vector3d> points_;
};

Mesh collect(const DimTags& solids, int order) {
  constexpr int linear_tet = 4, quadratic_tet = 11;  // gmsh's element types
  const int nodes_per_cell = order == 1 ? 4 : 10;
  NodeTable table;
  std::vector<Index> connectivity;
  std::vector<int> regions;
  for (std::size_t s = 0; s < solids.size(); ++s) {
    std::vector<std::size_t> elements, nodes;
    gmsh::model::mesh::getElementsByType(order == 1 ? linear_tet : quadratic_tet, elements, nodes,
                                         solids[s].second);
    for (std::size_t first = 0; first < nodes.size(); first += nodes_per_cell) {
      // gmsh's last two mid-side nodes are the other way round in VTK.
      if (order > 1) std::swap(nodes[first + 8], nodes[first + 9]);
      for (int i = 0; i < nodes_per_cell; ++i) connectivity.push_back(table.id(nodes[first + i]));
    }
    regions.insert(regions.end(), elements.size(), static_cast<int>(s) + 1);
  }
  const CellType type = order == 1 ? CellType::Tetra : CellType::QuadraticTetra;
  Mesh mesh = make_mesh(table.points(), type, nodes_per_cell, connectivity);
  if (solids.size() > 1) {
    mesh.regions = regions;
    mesh.region_array = "region";
  }
  return mesh;
}

}  // namespace

void set_tet_options(const TetOptions& options) {
  gmsh::option::setNumber("Mesh.MeshSizeMax", options.size);
  gmsh::option::setNumber("Mesh.MeshSizeMin", options.minimum_size);
  gmsh::option::setNumber("Mesh.MeshSizeFromCurvature", options.elements_per_turn > 0 ? 1 : 0);
  gmsh::option::setNumber("Mesh.MinimumElementsPerTwoPi", options.elements_per_turn);
  gmsh::option::setNumber("Mesh.ElementOrder", options.order);
  gmsh::option::setNumber("Mesh.HighOrderOptimize", options.order > 1 ? 1 : 0);
}

Mesh mesh_with_tets(const std::filesystem::path& step, const TetOptions& options) {
  return with_gmsh(step.string(), [&] {
    DimTags solids;
    gmsh::model::occ::importShapes(step.string(), solids);
    if (options.far_field_width > 0) surround_with_cube(solids, options.far_field_width);
    if (solids.size() > 1) join_touching(solids);
    gmsh::model::occ::synchronize();
    set_tet_options(options);
    gmsh::model::mesh::generate(3);
    return collect(solids, options.order);
  });
}

}  // namespace cadmorph::models
