#include "core/edge_lengths.h"

#include <catch2/catch.hpp>

#include "../core/sample_meshes.h"

namespace cadmorph {

using namespace testing;

TEST_CASE("Shortest edges of a stretched grid are its spacing", "[volume][edges]") {
  for (const CellType type : {CellType::Hexahedron, CellType::Voxel, CellType::Polyhedron}) {
    Mesh mesh = cube(type, 4);
    mesh.points.col(1) *= 0.1;
    const Eigen::VectorXd lengths = incident_edges(mesh).shortest;
    CHECK((lengths.array() - 0.025).abs().maxCoeff() < 1e-15);
  }
}

TEST_CASE("Shortest edges agree with VTK's edges of every cell type", "[volume][edges]") {
  for (const CellType type : solid_types_without_polyhedron()) {
    const Mesh mesh = parametric_cell(type);
    Mesh moved = mesh;
    moved.points = shaken(mesh.points, 0.1, 5);
    // Sides of VTK's faces, corner to mid node to corner, are the edges.
    Eigen::VectorXd expected =
        Eigen::VectorXd::Constant(mesh.node_count(), std::numeric_limits<double>::infinity());
    Eigen::VectorXd longest = Eigen::VectorXd::Zero(mesh.node_count());
    for (const auto& face : cell_facets(moved, 0)) {
      const int corners = corner_count(face.type, static_cast<Index>(face.nodes.size()));
      const bool has_mid = static_cast<int>(face.nodes.size()) >= 2 * corners;
      const auto visit = [&](Index a, Index b) {
        const double length = (moved.points.row(a) - moved.points.row(b)).norm();
        for (const Index n : {a, b}) {
          expected[n] = std::min(expected[n], length);
          longest[n] = std::max(longest[n], length);
        }
      };
      for (int i = 0; i < corners; ++i) {
        const Index a = face.nodes[i], b = face.nodes[(i + 1) % corners];
        if (has_mid) {
          visit(a, face.nodes[corners + i]);
          visit(face.nodes[corners + i], b);
        } else if (face.type != CellType::QuadraticLinearQuad) {
          visit(a, b);
        }
      }
    }
    if (type == CellType::QuadraticLinearWedge) continue;  // its straight sides are in no face list
    const auto [found, found_longest] = incident_edges(moved);
    CHECK((found_longest - longest).cwiseAbs().maxCoeff() < 1e-15);
    INFO("type " << static_cast<int>(type));
    for (Index n = 0; n < mesh.node_count(); ++n) {
      if (std::isfinite(expected[n]))
        CHECK(found[n] == Approx(expected[n]));
      else
        CHECK(found[n] == 0);  // centres of faces and of the cell
    }
  }
}

TEST_CASE("A node that no cell uses has no edge", "[volume][edges]") {
  Mesh mesh = parametric_cell(CellType::Tetra);
  mesh.points.conservativeResize(5, 3);
  mesh.points.row(4).setConstant(9);
  CHECK(incident_edges(mesh).shortest[4] == 0);
}

}  // namespace cadmorph
