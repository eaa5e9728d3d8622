#include "core/edge_lengths.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "sample_meshes.h"

namespace cadmorph {

using namespace testing;

TEST_CASE("Shortest edges of a stretched grid are its spacing", "[core][edges]") {
  for (const CellType type : {CellType::Hexahedron, CellType::Voxel, CellType::Polyhedron}) {
    Mesh mesh = cube(type, 4);
    mesh.points.col(1) *= 0.1;
    const Eigen::VectorXd lengths = incident_edges(mesh).shortest;
    CHECK((lengths.array() - 0.025).abs().maxCoeff() < 1e-15);
  }
}

TEST_CASE("Edges of every cell type are VTK's", "[core][edges]") {
  std::vector<CellType> types = solid_types_without_polyhedron();
  types.insert(types.end(),
               {CellType::Triangle, CellType::Pixel, CellType::Quad, CellType::QuadraticTriangle,
                CellType::BiquadraticTriangle, CellType::QuadraticQuad, CellType::BiquadraticQuad,
                CellType::QuadraticLinearQuad});
  for (const CellType type : types) {
    Mesh mesh = parametric_cell(type);
    mesh.points = shaken(mesh.points, 0.1, 5);
    Eigen::VectorXd shortest =
        Eigen::VectorXd::Constant(mesh.node_count(), std::numeric_limits<double>::infinity());
    Eigen::VectorXd longest = Eigen::VectorXd::Zero(mesh.node_count());
    const auto visit = [&](Index a, Index b) {
      const double length = (mesh.points.row(a) - mesh.points.row(b)).norm();
      for (const Index n : {a, b}) {
        shortest[n] = std::min(shortest[n], length);
        longest[n] = std::max(longest[n], length);
      }
    };
    for (const auto& edge : vtk_edges(type)) {
      if (edge.size() == 2) visit(edge[0], edge[1]);
      if (edge.size() == 3) visit(edge[0], edge[2]), visit(edge[2], edge[1]);
    }
    const IncidentEdges found = incident_edges(mesh);
    INFO("type " << static_cast<int>(type));
    Index on_edges = 0;
    for (Index n = 0; n < mesh.node_count(); ++n) {
      if (longest[n] == 0) continue;  // centres of faces and of the cell
      ++on_edges;
      CHECK(found.shortest[n] == Approx(shortest[n]));
      CHECK(found.longest[n] == Approx(longest[n]));
    }
    CHECK(on_edges >= corner_count(type, mesh.node_count()));
  }
}

TEST_CASE("Centres of faces and cells are half an edge from the nodes around them",
          "[core][edges]") {
  using enum CellType;
  for (const CellType type : {TriquadraticHexahedron, BiquadraticQuadraticHexahedron,
                              BiquadraticQuadraticWedge, BiquadraticQuad}) {
    Mesh mesh = parametric_cell(type);
    mesh.points.col(0) *= 3;
    const IncidentEdges edges = incident_edges(mesh);
    INFO("type " << static_cast<int>(type));
    CHECK(edges.shortest.minCoeff() == Approx(0.5));
    CHECK(edges.shortest[mesh.node_count() - 1] == Approx(0.5));
  }
  // The sides' middles are a third of the medians away, the shortest of length 1 / sqrt 2.
  const IncidentEdges triangle = incident_edges(parametric_cell(BiquadraticTriangle));
  CHECK(triangle.shortest[6] == Approx(std::sqrt(0.5) / 3));
}

TEST_CASE("A polyline has an edge between each two of its nodes", "[core][edges]") {
  RowMatrix points(4, 3);
  points << 0, 0, 0, 1, 0, 0, 3, 0, 0, 6, 0, 0;
  const IncidentEdges edges = incident_edges(single_cell(CellType::PolyLine, points));
  CHECK(edges.shortest == Eigen::Vector4d(1, 1, 2, 3));
  CHECK(edges.longest == Eigen::Vector4d(1, 2, 3, 3));
}

TEST_CASE("A node that no cell uses has no edge", "[core][edges]") {
  Mesh mesh = parametric_cell(CellType::Tetra);
  mesh.points.conservativeResize(5, 3);
  mesh.points.row(4).setConstant(9);
  CHECK(incident_edges(mesh).shortest[4] == 0);
}

}  // namespace cadmorph
