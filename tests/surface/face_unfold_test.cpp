#include "surface/face_unfold.h"

#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "../core/sample_meshes.h"
#include "cad/projector.h"
#include "morph_case.h"

namespace cadmorph {
namespace {

using namespace testing;
using Eigen::Vector3d;

// The side z = 0 of the unit cube's mesh, moved by `map` onto a face of the model.
struct Side {
  Side(CellType type, CadModel given, const std::function<Vector3d(const Vector3d&)>& map)
      : model(std::move(given)) {
    Mesh mesh = cube(type, 5);
    const Points flat = mesh.points;
    mesh.points = images(flat, map);
    const Boundary boundary = extract_boundary(mesh);
    surface = make_surface_mesh(mesh, boundary, 1);
    const Points at = surface_points(boundary, flat);
    for (const FacetId f : surface.facets.ids())
      if (std::ranges::all_of(surface.facets[f], [&](RowId n) { return at.row(n)[2] == 0; }))
        facets.push_back(f);
    for (const RowId n : surface.between.ids())
      if (at.row(n)[2] == 0 && at.row(n).head<2>().minCoeff() > 0 &&
          at.row(n).head<2>().maxCoeff() < 1)
        rows.push_back(n);
    const Vector3d middle = map(Vector3d(0.5, 0.5, 0));
    for (const FaceId f : model.faces().ids())
      if (project_on_face(model, f, middle, Eigen::Vector2d(0, 0)).distance < 1e-9) face = f;
    REQUIRE(face >= 0);
    uv.resize(std::ssize(rows), 2);
    for (std::size_t i = 0; i < rows.size(); ++i)
      uv.row(i) =
          project_on_face(model, face, surface.points.row(rows[i]), Eigen::Vector2d(0, 0)).uv;
  }

  // The surface's points with the face's own nodes at other parameters.
  Points at(const Parameters& other) const {
    Points result = surface.points;
    for (std::size_t i = 0; i < rows.size(); ++i)
      result.row(rows[i]) = model.evaluate(face, other.row(i)).point;
    return result;
  }

  std::size_t folds_of(const FaceSide& after) const {
    const FaceFolds folds(surface, facets, rows, {model, face, uv, surface.points});
    return folds.find(surface, after).size();
  }

  std::size_t folds(const Parameters& other) const {
    return folds_of({model, face, other, at(other)});
  }

  CadModel model;
  SurfaceMesh surface;
  std::vector<FacetId> facets;
  std::vector<RowId> rows;
  FaceId face;
  Parameters uv;
};

}  // namespace

TEST_CASE("facets that lie over each other find back to their places", "[surface][fold]") {
  const auto stay = [](const Vector3d& x) { return x; };
  const auto bend = [](const Vector3d& x) -> Vector3d {
    const double radius = 1 - x.z() / 2;
    return {radius * std::cos(x.x()), radius * std::sin(x.x()), x.y()};
  };
  for (const CellType type : {CellType::Tetra, CellType::Hexahedron, CellType::QuadraticTetra,
                              CellType::QuadraticHexahedron}) {
    const Side plane(type, to_model(BRepPrimAPI_MakeBox(1, 1, 1).Shape()), stay);
    const Side bent(type, to_model(BRepPrimAPI_MakeCylinder(1, 1, 1).Shape()), bend);
    for (const Side* side : {&plane, &bent}) {
      INFO(static_cast<int>(type) << (side == &bent ? " on a cylinder" : " in a plane"));
      Points moved = Points::Zero(side->uv.rows(), 3);
      moved.leftCols<2>() = side->uv;
      Parameters folded = shaken(moved, 0.5, 2).leftCols<2>();
      REQUIRE(side->folds(folded) > side->facets.size() / 5);
      const Parameters found = unfold_face(side->surface, side->facets, side->rows,
                                           {side->model, side->face, folded, side->at(folded)});
      CHECK(side->folds(found) == 0);
      // The least distortion there is; chords are no arcs.
      const double allowed = side == &bent ? 5e-3 : 1e-3;
      CHECK((found - side->uv).cwiseAbs().maxCoeff() < allowed);
    }
  }
}

TEST_CASE("a facet that the wires hold folded leaves the others free to unfold",
          "[surface][fold]") {
  Side side(CellType::Tetra, to_model(BRepPrimAPI_MakeBox(1, 1, 1).Shape()),
            [](const Vector3d& x) { return x; });
  Points moved = Points::Zero(side.uv.rows(), 3);
  moved.leftCols<2>() = side.uv;
  const Parameters folded = shaken(moved, 0.5, 2).leftCols<2>();
  Points points = side.at(folded);
  const auto is_own = [&](RowId n) { return std::ranges::binary_search(side.rows, n); };
  int held = 0;
  for (const FacetId f : side.facets) {
    const std::vector<RowId>& nodes = side.surface.facets[f];
    if (std::ranges::any_of(nodes, is_own)) continue;
    // The corner of the face goes over the edge across.
    for (std::size_t i = 0; i < 3; ++i) {
      const RowId n = nodes[i], a = nodes[(i + 1) % 3], b = nodes[(i + 2) % 3];
      if ((points.row(a) - points.row(n)).dot(points.row(b) - points.row(n)) > 1e-12) continue;
      points.row(n) = 0.55 * (points.row(a) + points.row(b)) - 0.1 * points.row(n);
      ++held;
    }
  }
  REQUIRE(held > 0);
  const FaceSide mapped{side.model, side.face, folded, points};
  REQUIRE(side.folds_of(mapped) > side.facets.size() / 5);
  const Parameters found = unfold_face(side.surface, side.facets, side.rows, mapped);
  CHECK(side.folds(found) == 0);
}

TEST_CASE("Only nodes in the rings round folded facets move", "[surface][fold]") {
  for (const CellType type : {CellType::Tetra, CellType::QuadraticHexahedron}) {
    INFO(static_cast<int>(type));
    const Side side(type, to_model(BRepPrimAPI_MakeBox(1, 1, 1).Shape()),
                    [](const Vector3d& x) { return x; });
    // The corner node nearest to a corner of the face goes over its neighbours.
    Parameters folded = side.uv;
    Index moved = 0;
    for (Index i = 0; i < folded.rows(); ++i)
      if (side.surface.is_corner(side.rows[i]) && folded.row(i).norm() < folded.row(moved).norm())
        moved = i;
    folded.row(moved) += Eigen::RowVector2d(0.25, 0.22);
    const Points points = side.at(folded);
    const FaceSide mapped{side.model, side.face, folded, points};
    const FaceFolds folds(side.surface, side.facets, side.rows,
                          {side.model, side.face, side.uv, side.surface.points});
    const std::vector<FacetId> turned = folds.find(side.surface, mapped);
    REQUIRE(!turned.empty());
    const Parameters found = unfold_face(side.surface, side.facets, side.rows, mapped, turned, 1);
    CHECK(side.folds(found) == 0);
    int kept = 0, changed = 0;
    for (Index i = 0; i < found.rows(); ++i) {
      const bool is_far = folded.row(i).minCoeff() > 0.75;
      if (is_far) CHECK(found.row(i) == folded.row(i));
      kept += is_far;
      changed += found.row(i) != folded.row(i);
    }
    CHECK(kept == (type == CellType::Tetra ? 1 : 3));
    CHECK(changed > 0);
  }
}

}  // namespace cadmorph
