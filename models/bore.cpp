#include "models/bore.h"

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakePolygon.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakePrism.hxx>
#include <cmath>
#include <functional>
#include <gp_Ax2.hxx>
#include <numbers>
#include <vector>

#include "models/hex_builder.h"

namespace cadmorph::models {
namespace {

using std::numbers::pi;
using Point2 = Eigen::Vector2d;

// The fixed part, in millimetres. The origin is a corner of the block.
constexpr double length = 120, width = 80, height = 60;
constexpr double shoulder_x = 84, shoulder_height = 42;
constexpr double bolt_x = 102, bolt_y = 40, bolt_radius = 6;
constexpr double bore_x = 42, bore_y = 40;

// The bore before the change; the keyway points to +y.
constexpr double bore_radius = 15, key_half_width = 4, key_reach = 20;

// The full change.
constexpr double full_scale = 1.3, full_turn_deg = 25, full_tilt_deg = 8;

TopoDS_Shape make_block() {
  BRepBuilderAPI_MakePolygon profile;
  for (const auto& [x, z] : {std::pair{0., 0.},
                             {length, 0.},
                             {length, shoulder_height},
                             {shoulder_x, shoulder_height},
                             {shoulder_x, height},
                             {0., height}}) {
    profile.Add(gp_Pnt(x, 0, z));
  }
  profile.Close();
  return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(profile.Wire()), gp_Vec(0, width, 0));
}

/// Frame of the bore: origin in the block's middle height, main axis along the bore, X direction
/// along the keyway.
gp_Ax2 bore_frame(double change) {
  const gp_Pnt centre(bore_x, bore_y, height / 2);
  gp_Ax2 frame(centre, gp_Dir(0, 0, 1), gp_Dir(0, 1, 0));
  frame.Rotate(gp_Ax1(centre, gp_Dir(0, 0, 1)), change * full_turn_deg * pi / 180);
  frame.Rotate(gp_Ax1(centre, gp_Dir(-1, -2, 0)), change * full_tilt_deg * pi / 180);
  return frame;
}

constexpr int side_cells = 16;                  // of either O-grid block's side of 80 mm
constexpr int bolt_side_cells = 8;              // of the square around the bolt hole
constexpr int key_cells = 6;                    // across the keyway
constexpr int key_layers = 2, ring_layers = 7;  // along the keyway's depth; from bore to outside
constexpr int beside_key = (side_cells - key_cells) / 2;
constexpr int first_key_column = side_cells + beside_key;
constexpr int bolt_layers = 4;
constexpr int lower_layers = 14, upper_layers = 6;  // below and above the shoulder

/// Receives one quad of the cross-section, corners counter-clockwise.
using QuadSink = std::function<void(const std::array<Point2, 4>&)>;

Point2 polar(const Point2& centre, double radius, double angle) {
  return centre + radius * Point2(std::cos(angle), std::sin(angle));
}

/// Emits the quads of a grid of (ni + 1) x (nj + 1) points, counter-clockwise when i, j are
/// right-handed.
void emit_grid(int ni, int nj, const std::function<Point2(int, int)>& point, const QuadSink& sink) {
  for (int i = 0; i < ni; ++i) {
    for (int j = 0; j < nj; ++j) {
      sink({point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)});
    }
  }
}

/// Point `j` of `4 * cells` around a rectangle, counter-clockwise from its lower right corner.
Point2 on_rectangle(const Point2& low, const Point2& high, int cells, int j) {
  const double t = static_cast<double>(j % cells) / cells;
  switch (j / cells % 4) {
    case 0:
      return {high[0], std::lerp(low[1], high[1], t)};
    case 1:
      return {std::lerp(high[0], low[0], t), high[1]};
    case 2:
      return {low[0], std::lerp(high[1], low[1], t)};
    default:
      return {std::lerp(low[0], high[0], t), low[1]};
  }
}

bool is_key_column(int j) { return j >= first_key_column && j <= first_key_column + key_cells; }

/// Angle of column `j` around the bore, outside the keyway: even, but for the quarter with the
/// keyway, where the columns share the room on either side of it.
double bore_angle(int j) {
  const double key_angle = std::asin(key_half_width / bore_radius);
  const int in_quarter = j - side_cells;
  if (in_quarter < 0 || in_quarter > side_cells) return -pi / 4 + j * (pi / 2) / side_cells;
  if (in_quarter < beside_key) {
    return std::lerp(pi / 4, pi / 2 - key_angle, double(in_quarter) / beside_key);
  }
  const int beyond_key = in_quarter - beside_key - key_cells;
  return std::lerp(pi / 2 + key_angle, 3 * pi / 4, double(beyond_key) / beside_key);
}

/// Where column `j` meets the bore's wall, as if there were no keyway.
Point2 on_bore(int j) {
  if (!is_key_column(j)) return polar({bore_x, bore_y}, bore_radius, bore_angle(j));
  const double across = key_half_width * (1 - 2. * (j - first_key_column) / key_cells);
  return {bore_x + across, bore_y + std::sqrt(bore_radius * bore_radius - across * across)};
}

/// Where column `j` meets the keyway's ground, or the circle through its corners.
Point2 on_key_reach(int j) {
  if (!is_key_column(j)) {
    return polar({bore_x, bore_y}, std::hypot(key_reach, key_half_width), bore_angle(j));
  }
  return {on_bore(j)[0], bore_y + key_reach};
}

Point2 bore_grid_point(int layer, int j) {
  const Point2 inner = on_bore(j), middle = on_key_reach(j);
  const Point2 outer = on_rectangle({0, 0}, {shoulder_x, width}, side_cells, j);
  if (layer <= key_layers) return inner + (middle - inner) * layer / key_layers;
  return middle + (outer - middle) * (layer - key_layers) / (ring_layers - key_layers);
}

/// The O-grid from the bore to the block's outline, without the keyway.
void emit_bore_ring(const QuadSink& sink) {
  for (int j = 0; j < 4 * side_cells; ++j) {
    const bool is_in_key = is_key_column(j) && is_key_column(j + 1);
    for (int layer = is_in_key ? key_layers : 0; layer < ring_layers; ++layer) {
      const int next = (j + 1) % (4 * side_cells);
      sink({bore_grid_point(layer, j), bore_grid_point(layer + 1, j),
            bore_grid_point(layer + 1, next), bore_grid_point(layer, next)});
    }
  }
}

/// The shoulder's cross-section: an O-grid in the middle square, plain grids on either side.
void emit_shoulder(const QuadSink& sink) {
  constexpr int beside = (side_cells - bolt_side_cells) / 2;
  const double cell = width / side_cells;
  const Point2 low(shoulder_x, beside * cell), high(length, width - beside * cell);
  const Point2 centre(bolt_x, bolt_y);
  const double step = (high[0] - low[0]) / bolt_side_cells;
  for (const double y : {0., high[1]}) {
    emit_grid(
        bolt_side_cells, beside,
        [&](int i, int j) { return Point2(low[0] + i * step, y + j * cell); }, sink);
  }
  emit_grid(
      bolt_layers, 4 * bolt_side_cells,
      [&](int layer, int j) {
        const int column = j % (4 * bolt_side_cells);
        const Point2 inner =
            polar(centre, bolt_radius, -pi / 4 + column * (pi / 2) / bolt_side_cells);
        const Point2 outer = on_rectangle(low, high, bolt_side_cells, column);
        return Point2(inner + (outer - inner) * layer / bolt_layers);
      },
      sink);
}

/// Stacks a quad of the cross-section over the heights from `bottom` to `top`.
void extrude(const std::array<Point2, 4>& quad, double bottom, double top, int layers,
             HexBuilder& builder) {
  for (int layer = 0; layer < layers; ++layer) {
    std::array<Eigen::Vector3d, 8> corners;
    for (int side = 0; side < 2; ++side) {
      const double z = std::lerp(bottom, top, double(layer + side) / layers);
      for (int i = 0; i < 4; ++i) corners[4 * side + i] = {quad[i][0], quad[i][1], z};
    }
    builder.add(corners);
  }
}

}  // namespace

TopoDS_Shape make_bore(double change) {
  const double scale = std::lerp(1., full_scale, change);
  const double reach = height;  // of the tools beyond the bore's middle: outside the block
  gp_Ax2 frame = bore_frame(change);
  frame.Translate(gp_Vec(frame.Direction()) * -reach);
  const TopoDS_Shape bore = BRepPrimAPI_MakeCylinder(frame, bore_radius * scale, 2 * reach);
  frame.Translate(gp_Vec(frame.YDirection()) * (-key_half_width * scale));
  const TopoDS_Shape key =
      BRepPrimAPI_MakeBox(frame, key_reach * scale, 2 * key_half_width * scale, 2 * reach);
  const TopoDS_Shape bolt_hole = BRepPrimAPI_MakeCylinder(
      gp_Ax2(gp_Pnt(bolt_x, bolt_y, -1), gp_Dir(0, 0, 1)), bolt_radius, height);

  const TopoDS_Shape bored = BRepAlgoAPI_Cut(make_block(), bore).Shape();
  const TopoDS_Shape keyed = BRepAlgoAPI_Cut(bored, key).Shape();
  return BRepAlgoAPI_Cut(keyed, bolt_hole).Shape();
}

Mesh make_bore_hex() {
  HexBuilder builder;
  emit_bore_ring([&](const std::array<Point2, 4>& quad) {
    extrude(quad, 0, shoulder_height, lower_layers, builder);
    extrude(quad, shoulder_height, height, upper_layers, builder);
  });
  emit_shoulder([&](const std::array<Point2, 4>& quad) {
    extrude(quad, 0, shoulder_height, lower_layers, builder);
  });
  return builder.mesh();
}

}  // namespace cadmorph::models
