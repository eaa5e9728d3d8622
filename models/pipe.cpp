#include "models/pipe.h"

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeSolid.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <BRep_Builder.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <cmath>
#include <gp_Ax2.hxx>
#include <gp_Circ.hxx>
#include <numbers>

#include "models/hex_builder.h"

namespace cadmorph::models {
namespace {

using std::numbers::pi;

/// Lengths in millimetres. The pipe starts at the origin along +z and bends towards +x.
struct PipeParameters {
  double first_length, second_length;
  double inner_radius, outer_radius;
  double bend_radius, bend_angle_deg;
};

PipeParameters pipe_parameters(double change) {
  const auto from_to = [change](double base, double full) { return std::lerp(base, full, change); };
  return {.first_length = from_to(60, 40),
          .second_length = from_to(45, 90),
          .inner_radius = from_to(12, 13),
          .outer_radius = from_to(18, 22),
          .bend_radius = from_to(40, 55),
          .bend_angle_deg = from_to(90, 60)};
}

TopoDS_Wire circle(double radius) {
  const gp_Circ curve(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1), gp_Dir(-1, 0, 0)), radius);
  return BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(curve));
}

/// Adds the faces of a swept part to `shell`, without the cross-sections it shares with others.
void add_faces(const TopoDS_Shape& part, const TopoDS_Shape& first, const TopoDS_Shape& last,
               TopoDS_Shell& shell) {
  for (TopExp_Explorer face(part, TopAbs_FACE); face.More(); face.Next()) {
    if (face.Current().IsSame(first) || face.Current().IsSame(last)) continue;
    BRep_Builder().Add(shell, face.Current());
  }
}

constexpr int around = 40, across = 4;                               // cells of the cross-section
constexpr int first_cells = 18, bend_cells = 20, second_cells = 14;  // along the pipe

/// Cross-section `station` of the pipe: its centre and the direction, in the plane of the bend,
/// towards the bend's outside.
struct Section {
  Eigen::Vector3d centre, outward;
};

Section section_at(const PipeParameters& pipe, int station) {
  const double angle = pipe.bend_angle_deg * pi / 180;
  const auto outward = [](double a) { return Eigen::Vector3d(-std::cos(a), 0, std::sin(a)); };
  const Eigen::Vector3d bend_centre(pipe.bend_radius, 0, pipe.first_length);
  if (station <= first_cells) {
    return {{0, 0, pipe.first_length * station / first_cells}, outward(0)};
  }
  if (station <= first_cells + bend_cells) {
    const Eigen::Vector3d direction = outward(angle * (station - first_cells) / bend_cells);
    return {bend_centre + pipe.bend_radius * direction, direction};
  }
  const double beyond = pipe.second_length * (station - first_cells - bend_cells) / second_cells;
  const Eigen::Vector3d axis(std::sin(angle), 0, std::cos(angle));
  return {bend_centre + pipe.bend_radius * outward(angle) + beyond * axis, outward(angle)};
}

Eigen::Vector3d pipe_point(const PipeParameters& pipe, int station, int layer, int column) {
  const Section section = section_at(pipe, station);
  const double radius =
      pipe.inner_radius + (pipe.outer_radius - pipe.inner_radius) * layer / across;
  const double angle = 2 * pi * (column % around) / around;
  return section.centre +
         radius * (std::cos(angle) * section.outward + std::sin(angle) * Eigen::Vector3d::UnitY());
}

}  // namespace

TopoDS_Shape make_pipe(double change) {
  const PipeParameters pipe = pipe_parameters(change);
  BRepBuilderAPI_MakeFace section(circle(pipe.outer_radius), true);
  section.Add(TopoDS::Wire(circle(pipe.inner_radius).Reversed()));

  const double angle = pipe.bend_angle_deg * pi / 180;
  const gp_Ax1 bend_axis(gp_Pnt(pipe.bend_radius, 0, pipe.first_length), gp_Dir(0, 1, 0));
  BRepPrimAPI_MakePrism first(section.Face(), gp_Vec(0, 0, pipe.first_length));
  BRepPrimAPI_MakeRevol bend(first.LastShape(), bend_axis, angle);
  BRepPrimAPI_MakePrism second(bend.LastShape(),
                               pipe.second_length * gp_Vec(std::sin(angle), 0, std::cos(angle)));

  TopoDS_Shell shell;
  BRep_Builder().MakeShell(shell);
  add_faces(first.Shape(), first.LastShape(), {}, shell);
  add_faces(bend.Shape(), bend.FirstShape(), bend.LastShape(), shell);
  add_faces(second.Shape(), second.FirstShape(), {}, shell);
  shell.Closed(true);
  return BRepBuilderAPI_MakeSolid(shell).Solid();
}

Mesh make_pipe_hex(double change) {
  const PipeParameters pipe = pipe_parameters(change);
  HexBuilder builder;
  for (int s = 0; s < first_cells + bend_cells + second_cells; ++s) {
    for (int layer = 0; layer < across; ++layer) {
      for (int column = 0; column < around; ++column) {
        const auto corner = [&](int ds, int dl, int dc) {
          return pipe_point(pipe, s + ds, layer + dl, column + dc);
        };
        // Outwards, round towards +y and along +z from -x is left-handed: column before layer.
        builder.add({corner(0, 0, 0), corner(0, 0, 1), corner(0, 1, 1), corner(0, 1, 0),
                     corner(1, 0, 0), corner(1, 0, 1), corner(1, 1, 1), corner(1, 1, 0)});
      }
    }
  }
  return builder.mesh();
}

}  // namespace cadmorph::models
