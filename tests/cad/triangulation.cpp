#include "triangulation.h"

#include <BRepMesh_IncrementalMesh.hxx>
#include <BRep_Tool.hxx>
#include <Poly_Triangulation.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>

namespace cadmorph::testing {
namespace {

using Eigen::Vector3d;

class ShellBuilder {
 public:
  Index node(const Vector3d& x) {
    constexpr double kCell = 1e-5;  // millimetres; edges have the same nodes in both faces
    const std::array<Index, 3> key{std::llround(x.x() / kCell), std::llround(x.y() / kCell),
                                   std::llround(x.z() / kCell)};
    const auto [it, is_new] = ids_.try_emplace(key, static_cast<Index>(points_.size()));
    if (is_new) points_.push_back(x);
    return it->second;
  }

  Index midpoint(Index a, Index b) {
    const auto [it, is_new] =
        middles_.try_emplace(std::minmax(a, b), static_cast<Index>(points_.size()));
    if (is_new) points_.push_back(0.5 * (points_[a] + points_[b]));
    return it->second;
  }

  void add_points(const Points& points) {
    for (Index n = 0; n < points.rows(); ++n) points_.push_back(points.row(n));
  }

  void add_cell(CellType type, const std::vector<Index>& nodes, int region = 0) {
    if (std::set<Index>(nodes.begin(), nodes.end()).size() != nodes.size()) return;
    mesh_.regions.push_back(region);
    mesh_.types.push_back(type);
    mesh_.connectivity.insert(mesh_.connectivity.end(), nodes.begin(), nodes.end());
    mesh_.offsets.push_back(static_cast<Index>(mesh_.connectivity.size()));
  }

  Mesh finish() {
    mesh_.points.resize(static_cast<Index>(points_.size()), 3);
    for (std::size_t n = 0; n < points_.size(); ++n)
      mesh_.points.row(static_cast<Index>(n)) = points_[n];
    return std::move(mesh_);
  }

 private:
  Mesh mesh_ = [] {
    Mesh m;
    m.offsets = {0};
    return m;
  }();
  std::vector<Vector3d> points_;
  std::map<std::array<Index, 3>, Index> ids_;
  std::map<std::pair<Index, Index>, Index> middles_;
};

}  // namespace

Mesh triangulate(const TopoDS_Shape& shape, double deflection, double angle) {
  BRepMesh_IncrementalMesh mesher(shape, deflection, false, angle);
  ShellBuilder shell;
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  for (int f = 1; f <= faces.Extent(); ++f) {
    const TopoDS_Face face = TopoDS::Face(faces(f));
    TopLoc_Location location;
    const auto facets = BRep_Tool::Triangulation(face, location);
    if (facets.IsNull()) continue;
    const auto id = [&](int n) {
      const gp_Pnt p = facets->Node(n).Transformed(location.Transformation());
      return shell.node({p.X(), p.Y(), p.Z()});
    };
    for (int t = 1; t <= facets->NbTriangles(); ++t) {
      int a, b, c;
      facets->Triangle(t).Get(a, b, c);
      if (face.Orientation() == TopAbs_REVERSED) std::swap(b, c);
      shell.add_cell(CellType::Triangle, {id(a), id(b), id(c)}, f - 1);
    }
  }
  return shell.finish();
}

Mesh split_triangles(const Mesh& mesh) {
  ShellBuilder shell;
  shell.add_points(mesh.points);
  for (Index t = 0; t < mesh.cell_count(); ++t) {
    const auto n = mesh.cell(t);
    const Index a = shell.midpoint(n[0], n[1]), b = shell.midpoint(n[1], n[2]),
                c = shell.midpoint(n[2], n[0]);
    shell.add_cell(CellType::Triangle, {n[0], a, c}, mesh.region(t));
    shell.add_cell(CellType::Triangle, {a, n[1], b}, mesh.region(t));
    shell.add_cell(CellType::Triangle, {c, b, n[2]}, mesh.region(t));
    shell.add_cell(CellType::Triangle, {a, b, c}, mesh.region(t));
  }
  return shell.finish();
}

Mesh hex_grid(const std::array<int, 3>& n, const std::function<Vector3d(const Vector3d&)>& map,
              bool is_closed) {
  const int rows = is_closed ? n[1] : n[1] + 1;
  const auto id = [&](int i, int j, int k) -> Index {
    return (static_cast<Index>(i) * rows + j % rows) * (n[2] + 1) + k;
  };
  ShellBuilder grid;
  Points points((n[0] + 1) * rows * (n[2] + 1), 3);
  for (int i = 0; i <= n[0]; ++i)
    for (int j = 0; j < rows; ++j)
      for (int k = 0; k <= n[2]; ++k)
        points.row(id(i, j, k)) = map({double(i) / n[0], double(j) / n[1], double(k) / n[2]});
  grid.add_points(points);
  for (int i = 0; i < n[0]; ++i)
    for (int j = 0; j < n[1]; ++j)
      for (int k = 0; k < n[2]; ++k)
        grid.add_cell(CellType::Hexahedron, {id(i, j, k), id(i + 1, j, k), id(i + 1, j + 1, k),
                                             id(i, j + 1, k), id(i, j, k + 1), id(i + 1, j, k + 1),
                                             id(i + 1, j + 1, k + 1), id(i, j + 1, k + 1)});
  return grid.finish();
}

}  // namespace cadmorph::testing
