#include "models/median_dual.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <map>

#include "core/mesh_file.h"
#include "core/quality.h"

using namespace cadmorph;

namespace {

Eigen::Vector3d keep(std::span<const Index>, const Eigen::Vector3d& mean) { return mean; }

Mesh box_tets() { return MeshFile(CADMORPH_SOURCE_DIR "/models/shapes/box.vtu").mesh(); }

/// Volume by the divergence theorem, over triangles about each outward face's middle.
double volume(const Mesh& mesh, Index cell) {
  double sum = 0;
  for (const Facet& face : cell_facets(mesh, cell)) {
    const Eigen::Vector3d middle = mesh.points(face.nodes, Eigen::all).colwise().mean();
    for (std::size_t i = 0; i < face.nodes.size(); ++i) {
      const Eigen::Vector3d a = mesh.points.row(face.nodes[i]);
      const Eigen::Vector3d b = mesh.points.row(face.nodes[(i + 1) % face.nodes.size()]);
      sum += middle.dot(a.cross(b)) / 6;
    }
  }
  return sum;
}

double volume(const Mesh& mesh) {
  double sum = 0;
  for (Index c = 0; c < mesh.cell_count(); ++c) sum += volume(mesh, c);
  return sum;
}

}  // namespace

TEST_CASE("the dual has a cell a node and fills the tetrahedra's volume", "[models]") {
  const Mesh tets = box_tets();
  const Mesh dual = models::median_dual(tets, keep);
  REQUIRE_NOTHROW(check_mesh(dual));
  REQUIRE(dual.cell_count() == tets.node_count());
  CHECK(volume(dual) == Approx(volume(tets)).epsilon(1e-12));
  CHECK(measure_quality(dual, dual.points, detect_orientation(dual)).inverted == 0);
}

TEST_CASE("the dual's cells share each inner face with one other, turned round", "[models]") {
  const Mesh dual = models::median_dual(box_tets(), keep);
  std::map<std::vector<Index>, std::vector<std::vector<Index>>> uses;
  for (Index c = 0; c < dual.cell_count(); ++c) {
    for (const Facet& face : cell_facets(dual, c)) {
      std::vector<Index> sorted = face.nodes;
      std::ranges::sort(sorted);
      uses[sorted].push_back(face.nodes);
    }
  }
  for (auto& [nodes, faces] : uses) {
    REQUIRE(faces.size() <= 2);
    if (faces.size() < 2) continue;
    const std::vector<Index>& one = faces[0];
    std::vector<Index>& other = faces[1];
    std::ranges::reverse(other);
    std::ranges::rotate(other, std::ranges::find(other, one.front()));
    CHECK(one == other);
  }
}
