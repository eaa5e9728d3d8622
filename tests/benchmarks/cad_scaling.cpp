// Prints how matching, association and projection scale: cad_scaling [SURFACE_NODES]

#include <sys/resource.h>

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <TopTools_ListOfShape.hxx>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include "cad/face_sampler.h"
#include "cad/projector.h"
#include "cad/topology_match.h"
#include "cad_variants.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "surface/association.h"

using namespace cadmorph;
using namespace cadmorph::testing;
using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr double kPitch = 20, kHeight = 12, kDepth = 7, kBore = 4, kHead = 7;  // millimetres

double peak_gib() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1048576;
}

/// A plate with counterbored holes, three faces each.
TopoDS_Shape counterbored_plate(int columns, int rows) {
  TopTools_ListOfShape plates, tools;
  plates.Append(BRepPrimAPI_MakeBox(columns * kPitch, rows * kPitch, kHeight).Solid());
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      const double x = (i + 0.5) * kPitch, y = (j + 0.5) * kPitch;
      BRepBuilderAPI_MakePolygon outline;
      for (const Vector2d& p :
           {Vector2d(0, -1), Vector2d(kBore, -1), Vector2d(kBore, kDepth), Vector2d(kHead, kDepth),
            Vector2d(kHead, kHeight + 1), Vector2d(0, kHeight + 1)})
        outline.Add(gp_Pnt(x + p.x(), y, p.y()));
      outline.Close();
      tools.Append(BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(outline.Wire()),
                                         gp_Ax1(gp_Pnt(x, y, 0), gp_Dir(0, 0, 1)))
                       .Shape());
    }
  BRepAlgoAPI_Cut cut;
  cut.SetArguments(plates);
  cut.SetTools(tools);
  cut.SetRunParallel(true);
  cut.Build();
  return cut.Shape();
}

/// Radius and height at s in [0, 5] along a hole's section; radius 0 stands for the cell's square.
Vector2d section(double s) {
  const double t = s - std::floor(s);
  if (s < 1) return {-t, kHeight};  // square to head: blended below
  if (s < 2) return {kHead, kHeight + t * (kDepth - kHeight)};
  if (s < 3) return {kHead + t * (kBore - kHead), kDepth};
  if (s < 4) return {kBore, kDepth * (1 - t)};
  return {-(s - 4), 0};
}

Vector3d cell_point(double s, double angle) {
  const Vector2d along(std::cos(angle), std::sin(angle));
  const Vector2d square = 0.5 * kPitch / along.cwiseAbs().maxCoeff() * along;
  const Vector2d at = section(s);
  if (s < 1) {
    const Vector2d p = (1 + at.x()) * square - at.x() * kHead * along;
    return {p.x(), p.y(), kHeight};
  }
  if (s >= 4) {
    const Vector2d p = (1 + at.x()) * kBore * along - at.x() * square;
    return {p.x(), p.y(), 0};
  }
  return {at.x() * along.x(), at.x() * along.y(), at.y()};
}

/// Quads on the top, bottom and holes of counterbored_plate, about `nodes` nodes.
Mesh plate_mesh(int columns, int rows, Index nodes) {
  const double per_cell = static_cast<double>(nodes) / (columns * rows);
  const int rings = 5 * std::max(1, static_cast<int>(std::sqrt(per_cell / 2) / 5));
  const int turn = 8 * std::max(1, static_cast<int>(per_cell / (rings + 1) / 8));
  Mesh mesh;
  mesh.points.resize(static_cast<Index>(columns) * rows * (rings + 1) * turn, 3);
  mesh.offsets = {0};
  Index n = 0;
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      const Index first = n;
      for (int r = 0; r <= rings; ++r)
        for (int a = 0; a < turn; ++a)
          mesh.points.row(n++) = cell_point(5.0 * r / rings, 2 * pi * a / turn) +
                                 Vector3d((i + 0.5) * kPitch, (j + 0.5) * kPitch, 0);
      for (int r = 0; r < rings; ++r)
        for (int a = 0; a < turn; ++a) {
          const Index b = (a + 1) % turn, at = first + static_cast<Index>(r) * turn;
          mesh.connectivity.insert(mesh.connectivity.end(),
                                   {at + a, at + turn + a, at + turn + b, at + b});
          mesh.types.push_back(CellType::Quad);
          mesh.offsets.push_back(static_cast<Index>(mesh.connectivity.size()));
        }
    }
  return mesh;
}

void time_association(Index nodes) {
  constexpr int kColumns = 15, kRows = 11;
  const CadModel model = to_model(counterbored_plate(kColumns, kRows));
  const Mesh mesh = plate_mesh(kColumns, kRows, nodes);
  const Boundary boundary = extract_boundary(mesh);
  const double before = peak_gib();
  const Stopwatch clock;
  const Association a = associate(model, mesh, boundary);
  const double seconds = clock.seconds();
  std::printf(
      "association: %lld surface nodes on %zu faces, %d threads: %.1f s (at most 20), %.1f "
      "us a node\n",
      static_cast<long long>(mesh.node_count()), model.faces().size(), thread_count(), seconds,
      1e6 * seconds / static_cast<double>(mesh.node_count()));
  std::printf(
      "  peak memory %.2f GiB (at most 4), %.2f before; vertex %lld, edge %lld, face %lld, "
      "unmatched %lld, farthest %.1e mm\n",
      peak_gib(), before, static_cast<long long>(a.vertex_nodes),
      static_cast<long long>(a.edge_nodes), static_cast<long long>(a.face_nodes),
      static_cast<long long>(a.unmatched_nodes), a.max_distance);
}

void time_projection(const char* name, const TopoDS_Shape& shape, Index count) {
  constexpr Index kProbes = 100'000;
  const CadModel model = to_model(shape);
  Stopwatch sampling;
  const FaceSamples samples = sample_faces(model, count);
  const KdTree tree(samples.points);
  const double set_up = sampling.seconds();
  const Index stride = std::max<Index>(1, samples.points.rows() / kProbes);
  const Stopwatch clock;
  Index probes = 0;
  double farthest = 0;
  for (Index i = 0; i < samples.points.rows(); i += stride, ++probes) {
    // Off the samples by a part of their spacing, along and across the face.
    const Vector3d x = samples.points.row(i).transpose() +
                       0.4 * samples.spacing * Vector3d(std::sin(i), std::cos(i), std::sin(2 * i));
    const Index near = tree.nearest(x.data(), 1)[0].index;
    farthest = std::max(farthest,
                        project_on_face(model, samples.face[near], x, samples.uv[near]).distance);
  }
  std::printf(
      "projection: %-20s %8lld samples (set up %.1f s): %.2f us a node and thread (at most "
      "15), farthest %.2f spacings\n",
      name, static_cast<long long>(samples.points.rows()), set_up,
      1e6 * clock.seconds() / static_cast<double>(probes), farthest / samples.spacing);
}

void time_matching(int columns, int rows) {
  const TopoDS_Shape part = counterbored_plate(columns, rows);
  const Shuffled shuffled = shuffle(part, {.seed = 1, .has_reversed_planes = true});
  const CadModel base = to_model(part), variant = to_model(shuffled.shape);
  const Stopwatch clock;
  const TopologyMatch match = match_topology(base, variant);
  std::printf(
      "matching: %zu faces, %zu edges, shuffled and reversed: %.2f s (2,000 faces: at most "
      "2), %s\n",
      base.faces().size(), base.edges().size(), clock.seconds(),
      match.faces == shuffled.faces ? "all right" : "WRONG");
}

}  // namespace

int main(int argc, char** argv) {
  const Index nodes = argc > 1 ? std::atoll(argv[1]) : 1'000'000;
  time_association(nodes);
  time_projection("plate, analytic", counterbored_plate(15, 11), nodes);
  const TopoDS_Shape blade = read_shape(model_file("shapes/blade.step"));
  time_projection("blade, B-spline", blade, nodes);
  time_projection("torus as NURBS", to_nurbs(read_shape(model_file("shapes/torus.step"))), nodes);
  time_matching(15, 11);
  time_matching(30, 22);
  return 0;
}
