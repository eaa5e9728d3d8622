// cadmorph-picture: a picture of a mesh before and after morphing.

#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkCellData.h>
#include <vtkDataSetMapper.h>
#include <vtkDataSetSurfaceFilter.h>
#include <vtkDoubleArray.h>
#include <vtkExtractCells.h>
#include <vtkFeatureEdges.h>
#include <vtkIdList.h>
#include <vtkImageShrink3D.h>
#include <vtkLightKit.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkObject.h>
#include <vtkPNGWriter.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkScalarBarActor.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>
#include <vtkUnstructuredGrid.h>
#include <vtkWindowToImageFilter.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <system_error>

#include "apps/picture_display.h"
#include "core/errors.h"
#include "core/mesh_file.h"
#include "core/quality.h"

namespace cadmorph {
namespace {

constexpr int width = 1600, height = 1200;
constexpr int oversampling = 2;  // rendered larger and shrunk: smooth edges with any driver
constexpr float line_width = 0.6F, outline_width = 1.5F;  // in pixels
constexpr double worst_fraction = 0.05;
constexpr double column_width = 0.45;  // of the window; the rest is the scalar bar's

enum class Field { Displacement, Quality };

struct PictureOptions {
  std::filesystem::path before, after, output;
  Field field = Field::Displacement;
  int cut_axis = 1;         // axis the cutting plane is normal to
  std::string unit = "mm";  // of the coordinates
};

/// One mesh ready to draw.
struct View {
  std::string title;
  vtkNew<vtkUnstructuredGrid> grid;
  QualityReport quality;
};

void insert_polyhedron(const Mesh& mesh, Index c, vtkUnstructuredGrid* grid) {
  std::vector<vtkIdType> faces(mesh.polyhedron_faces.begin() + mesh.polyhedron_offsets[c],
                               mesh.polyhedron_faces.begin() + mesh.polyhedron_offsets[c + 1]);
  vtkIdType face_count = 0;
  for (std::size_t i = 0; i < faces.size(); i += faces[i] + 1) ++face_count;
  grid->InsertNextCell(VTK_POLYHEDRON, face_count, faces.data());
}

void fill_grid(const Mesh& mesh, vtkUnstructuredGrid* grid) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  points->SetNumberOfPoints(mesh.node_count());
  for (Index i = 0; i < mesh.node_count(); ++i) points->SetPoint(i, mesh.points.row(i).data());
  grid->SetPoints(points);
  grid->Allocate(mesh.cell_count());
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    if (mesh.types[c] == CellType::Polyhedron) {
      insert_polyhedron(mesh, c, grid);
      continue;
    }
    const std::vector<vtkIdType> nodes(mesh.cell(c).begin(), mesh.cell(c).end());
    grid->InsertNextCell(static_cast<int>(mesh.types[c]), static_cast<vtkIdType>(nodes.size()),
                         nodes.data());
  }
}

vtkNew<vtkDoubleArray> make_array(const char* name, const std::vector<double>& values) {
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  array->SetNumberOfTuples(static_cast<vtkIdType>(values.size()));
  std::copy(values.begin(), values.end(), array->GetPointer(0));
  return array;
}

/// 1 for each of the worst cells of those measured, else 0.
std::vector<double> mark_worst(const std::vector<double>& quality) {
  std::vector<std::size_t> measured;
  for (std::size_t c = 0; c < quality.size(); ++c) {
    if (!std::isnan(quality[c])) measured.push_back(c);
  }
  const auto worst_end =
      measured.begin() + static_cast<std::ptrdiff_t>(std::ceil(worst_fraction * measured.size()));
  std::partial_sort(measured.begin(), worst_end, measured.end(), [&](auto a, auto b) {
    return std::pair(quality[a], a) < std::pair(quality[b], b);
  });
  std::vector<double> marks(quality.size(), 0);
  std::for_each(measured.begin(), worst_end, [&](auto c) { marks[c] = 1; });
  return marks;
}

void fill_view(View& view, const std::string& title, const Mesh& mesh,
               const Orientation& orientation, const Points& before) {
  view.title = title;
  view.quality = measure_quality(mesh, mesh.points, orientation);
  fill_grid(mesh, view.grid);
  std::vector<double> displacement(mesh.node_count());
  for (Index i = 0; i < mesh.node_count(); ++i) {
    displacement[i] = (mesh.points.row(i) - before.row(i)).norm();
  }
  view.grid->GetPointData()->AddArray(make_array("displacement", displacement));
  view.grid->GetCellData()->AddArray(make_array("quality", view.quality.values));
  view.grid->GetCellData()->AddArray(make_array("worst", mark_worst(view.quality.values)));
}

/// The cells behind the middle of the mesh along `axis`, as seen from its negative side.
vtkNew<vtkIdList> cells_behind_cut(vtkUnstructuredGrid* grid, int axis) {
  double bounds[6];
  grid->GetBounds(bounds);
  const double middle = (bounds[2 * axis] + bounds[2 * axis + 1]) / 2;
  vtkNew<vtkIdList> cells;
  for (vtkIdType c = 0; c < grid->GetNumberOfCells(); ++c) {
    double cell[6];
    grid->GetCellBounds(c, cell);
    if ((cell[2 * axis] + cell[2 * axis + 1]) / 2 > middle) cells->InsertNextId(c);
  }
  return cells;
}

void add_surface(vtkRenderer* renderer, vtkUnstructuredGrid* grid, const char* cell_array,
                 const char* point_array, vtkLookupTable* colours, float sharp_edge_width) {
  vtkNew<vtkDataSetSurfaceFilter> surface;
  surface->SetInputData(grid);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(surface->GetOutputPort());
  if (colours == nullptr) {
    mapper->ScalarVisibilityOff();
  } else {
    mapper->SetLookupTable(colours);
    mapper->UseLookupTableScalarRangeOn();
    mapper->InterpolateScalarsBeforeMappingOn();
    if (cell_array != nullptr) {
      mapper->SetScalarModeToUseCellFieldData();
      mapper->SelectColorArray(cell_array);
    } else {
      mapper->SetScalarModeToUsePointFieldData();
      mapper->SelectColorArray(point_array);
    }
  }
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  vtkProperty* look = actor->GetProperty();
  look->SetColor(0.84, 0.87, 0.91);
  look->SetInterpolationToFlat();
  look->SetAmbient(0.25);
  look->SetDiffuse(0.75);
  look->EdgeVisibilityOn();
  look->SetEdgeColor(0.25, 0.28, 0.33);
  look->SetLineWidth(oversampling * line_width);
  renderer->AddActor(actor);

  vtkNew<vtkFeatureEdges> outline;
  outline->SetInputConnection(surface->GetOutputPort());
  outline->SetFeatureAngle(35);
  outline->ManifoldEdgesOff();
  outline->NonManifoldEdgesOff();
  outline->ColoringOff();
  vtkNew<vtkPolyDataMapper> outline_mapper;
  outline_mapper->SetInputConnection(outline->GetOutputPort());
  outline_mapper->ScalarVisibilityOff();
  outline_mapper->SetResolveCoincidentTopologyToPolygonOffset();
  vtkNew<vtkActor> outline_actor;
  outline_actor->SetMapper(outline_mapper);
  outline_actor->GetProperty()->SetColor(0.05, 0.06, 0.08);
  outline_actor->GetProperty()->SetLineWidth(oversampling * sharp_edge_width);
  outline_actor->GetProperty()->LightingOff();
  renderer->AddActor(outline_actor);
}

void add_text(vtkRenderer* renderer, const std::string& text, double x, double y, int size,
              bool is_bold) {
  vtkNew<vtkTextActor> actor;
  actor->SetInput(text.c_str());
  vtkTextProperty* look = actor->GetTextProperty();
  look->SetFontFamilyToArial();
  look->SetFontSize(size * oversampling);
  look->SetBold(is_bold);
  look->SetColor(0.1, 0.11, 0.14);
  look->SetVerticalJustificationToTop();
  actor->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  actor->SetPosition(x, y);
  renderer->AddViewProp(actor);
}

void add_scalar_bar(vtkRenderer* renderer, vtkLookupTable* colours, const std::string& title) {
  vtkNew<vtkScalarBarActor> bar;
  bar->SetLookupTable(colours);
  bar->SetTitle(title.c_str());
  bar->SetNumberOfLabels(5);
  bar->SetLabelFormat("%.3g");
  bar->UnconstrainedFontSizeOn();
  bar->SetBarRatio(0.22);
  bar->SetTitleRatio(0.5);
  bar->SetVerticalTitleSeparation(10 * oversampling);
  for (vtkTextProperty* look : {bar->GetTitleTextProperty(), bar->GetLabelTextProperty()}) {
    look->SetFontFamilyToArial();
    look->SetColor(0.1, 0.11, 0.14);
    look->ItalicOff();
    look->ShadowOff();
    look->SetBold(false);
    look->SetFontSize(17 * oversampling);
  }
  bar->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  bar->SetPosition(0.05, 0.57);
  bar->SetWidth(0.85);
  bar->SetHeight(0.38);
  renderer->AddViewProp(bar);
}

/// Aims a parallel camera at all of `grids`, from the negative side of the cut axis and a little
/// from the side and above; fits them into the renderer's viewport of the given aspect.
void aim_camera(vtkCamera* camera, int cut_axis, double aspect,
                const std::array<vtkUnstructuredGrid*, 2>& grids) {
  const Eigen::Vector3d up = cut_axis == 2 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d ahead = Eigen::Vector3d::Unit(cut_axis);
  const Eigen::Vector3d aside = ahead.cross(up);
  // Seen from in front of the cut: from its negative side.
  const Eigen::Vector3d from = (-ahead - 0.55 * aside + 0.55 * up).normalized();
  const Eigen::Vector3d right = up.cross(from).normalized();
  const Eigen::Vector3d top = from.cross(right);

  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (vtkUnstructuredGrid* grid : grids) {
    for (vtkIdType i = 0; i < grid->GetNumberOfPoints(); ++i) {
      const Eigen::Vector3d p(grid->GetPoint(i));
      const Eigen::Vector3d seen(p.dot(right), p.dot(top), p.dot(from));
      low = low.cwiseMin(seen);
      high = high.cwiseMax(seen);
    }
  }
  const Eigen::Vector3d middle = (low + high) / 2, size = high - low;
  const Eigen::Vector3d focus = middle[0] * right + middle[1] * top + middle[2] * from;
  const double distance = 2 * size.norm();
  const Eigen::Vector3d eye = focus + distance * from;
  camera->ParallelProjectionOn();
  camera->SetFocalPoint(focus.data());
  camera->SetPosition(eye.data());
  camera->SetViewUp(up.data());
  constexpr double margin = 1.1, margin_for_texts = 1.32;
  camera->SetWindowCenter(0, 0.12);
  camera->SetParallelScale(std::max(margin_for_texts * size[1], margin * size[0] / aspect) / 2);
  camera->SetClippingRange(distance - size.norm(), distance + size.norm());
}

vtkNew<vtkLookupTable> make_colours(double low, double high, bool is_reversed) {
  // Light where nothing moves, or cells are good, so that mesh lines show.
  constexpr std::array<std::array<double, 3>, 6> knots{{{0.96, 0.96, 0.90},
                                                        {0.80, 0.91, 0.71},
                                                        {0.50, 0.80, 0.73},
                                                        {0.25, 0.67, 0.77},
                                                        {0.14, 0.48, 0.71},
                                                        {0.16, 0.30, 0.60}}};
  constexpr int size = 256;
  vtkNew<vtkLookupTable> table;
  table->SetNumberOfTableValues(size);
  for (int i = 0; i < size; ++i) {
    const double position = i * (knots.size() - 1.0) / (size - 1);
    const auto k = std::min<std::size_t>(static_cast<std::size_t>(position), knots.size() - 2);
    const double t = position - static_cast<double>(k);
    std::array<double, 3> colour;
    for (int j = 0; j < 3; ++j) colour[j] = knots[k][j] + t * (knots[k + 1][j] - knots[k][j]);
    table->SetTableValue(is_reversed ? size - 1 - i : i, colour[0], colour[1], colour[2]);
  }
  table->SetRange(low, high > low ? high : low + 1);
  return table;
}

vtkNew<vtkLookupTable> worst_colours() {
  vtkNew<vtkLookupTable> table;
  table->SetNumberOfTableValues(2);
  table->SetTableValue(0, 0.92, 0.93, 0.95);
  table->SetTableValue(1, 0.86, 0.08, 0.12);
  table->SetRange(0, 1);
  return table;
}

std::string size_text(vtkUnstructuredGrid* grid) {
  return std::to_string(grid->GetNumberOfPoints()) + " nodes, " +
         std::to_string(grid->GetNumberOfCells()) + " elements";
}

std::string quality_text(const QualityReport& quality) {
  char text[160];
  std::snprintf(text, sizeof text, "scaled Jacobian: min %.3f, mean %.3f; inverted: %lld",
                quality.min, quality.mean, static_cast<long long>(quality.inverted));
  return text;
}

/// The picture: above both surfaces, below both cut open, all seen by the same camera; the scalar
/// bar to the right.
class Picture {
 public:
  Picture(const View& before, const View& after, const PictureOptions& options);
  void write(const std::filesystem::path& path);

 private:
  vtkNew<vtkRenderer> add_renderer(double left, double bottom, double right, double top);
  vtkNew<vtkRenderer> add_view(int column, int row);
  void add_surfaces(const View& before, const View& after, const PictureOptions& options);
  void add_cut(const View& view, int column, vtkIdList* cells);

  vtkNew<vtkRenderWindow> window_;
  vtkNew<vtkCamera> camera_;
};

Picture::Picture(const View& before, const View& after, const PictureOptions& options) {
  window_->SetOffScreenRendering(1);
  window_->SetMultiSamples(0);
  window_->SetSize(width * oversampling, height * oversampling);
  aim_camera(camera_, options.cut_axis, 2 * column_width * width / height,
             {before.grid.Get(), after.grid.Get()});
  add_surfaces(before, after, options);
  const vtkNew<vtkIdList> cells = cells_behind_cut(before.grid, options.cut_axis);
  add_cut(before, 0, cells);
  add_cut(after, 1, cells);
}

vtkNew<vtkRenderer> Picture::add_renderer(double left, double bottom, double right, double top) {
  vtkNew<vtkRenderer> renderer;
  renderer->SetViewport(left, bottom, right, top);
  renderer->SetBackground(1, 1, 1);
  window_->AddRenderer(renderer);
  return renderer;
}

vtkNew<vtkRenderer> Picture::add_view(int column, int row) {
  vtkNew<vtkRenderer> renderer = add_renderer(column * column_width, 0.5 - row * 0.5,
                                              (column + 1) * column_width, 1 - row * 0.5);
  renderer->SetActiveCamera(camera_);
  vtkNew<vtkLightKit> lights;
  lights->SetKeyLightIntensity(0.85);
  lights->SetKeyToFillRatio(1.8);
  lights->SetKeyLightWarmth(0.5);
  lights->SetFillLightWarmth(0.5);
  lights->SetHeadLightWarmth(0.5);
  lights->SetBackLightWarmth(0.5);
  lights->AddLightsToRenderer(renderer);
  return renderer;
}

void Picture::add_surfaces(const View& before, const View& after, const PictureOptions& options) {
  const vtkNew<vtkRenderer> left = add_view(0, 0), right = add_view(1, 0);
  const bool is_quality = options.field == Field::Quality;
  double range[2] = {0, 1};
  if (is_quality) {
    range[0] = std::min({0.0, before.quality.min, after.quality.min});
  } else {
    after.grid->GetPointData()->GetArray("displacement")->GetRange(range);
    range[0] = 0;
  }
  const vtkNew<vtkLookupTable> colours = make_colours(range[0], range[1], is_quality);
  const char* cell_array = is_quality ? "quality" : nullptr;
  add_surface(left, before.grid, cell_array, nullptr, is_quality ? colours.Get() : nullptr,
              outline_width);
  add_surface(right, after.grid, cell_array, "displacement", colours, outline_width);
  add_scalar_bar(add_renderer(2 * column_width, 0, 1, 1), colours,
                 is_quality ? "Scaled\nJacobian" : "Displacement\n[" + options.unit + "]");
  add_text(left, before.title, 0.03, 0.97, 28, true);
  add_text(right, after.title, 0.03, 0.97, 28, true);
  add_text(left, size_text(before.grid), 0.03, 0.9, 19, false);
  add_text(right, size_text(after.grid), 0.03, 0.9, 19, false);
}

void Picture::add_cut(const View& view, int column, vtkIdList* cells) {
  const vtkNew<vtkRenderer> renderer = add_view(column, 1);
  vtkNew<vtkExtractCells> part;
  part->SetInputData(view.grid);
  part->SetCellList(cells);
  part->Update();
  add_surface(renderer, part->GetOutput(), "worst", nullptr, worst_colours(), line_width);
  add_text(renderer, view.title + ", cut open: worst 5 % of the elements in red", 0.03, 0.97, 21,
           true);
  add_text(renderer, quality_text(view.quality), 0.03, 0.91, 19, false);
}

void Picture::write(const std::filesystem::path& path) {
  window_->Render();
  vtkNew<vtkWindowToImageFilter> image;
  image->SetInput(window_);
  image->ReadFrontBufferOff();
  vtkNew<vtkImageShrink3D> shrink;
  shrink->SetInputConnection(image->GetOutputPort());
  shrink->SetShrinkFactors(oversampling, oversampling, 1);
  shrink->AveragingOn();
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputConnection(shrink->GetOutputPort());
  writer->SetFileName(path.c_str());
  writer->Write();
  if (writer->GetErrorCode() != 0 || !std::filesystem::exists(path)) {
    throw IoError("can't write " + path.string());
  }
}

void draw(const PictureOptions& options) {
  const MeshFile before_file(options.before), after_file(options.after);
  const Mesh &before = before_file.mesh(), &after = after_file.mesh();
  if (before.types != after.types || before.connectivity != after.connectivity) {
    throw InvalidInputError(options.after.string() + " does not have the cells of " +
                            options.before.string() + ": give a mesh and its morph");
  }
  const Orientation orientation = detect_orientation(before);
  View before_view, after_view;
  fill_view(before_view, "Before", before, orientation, before.points);
  fill_view(after_view, "After", after, orientation, before.points);
  const PrivateDisplay display;
  Picture(before_view, after_view, options).write(options.output);
}

PictureOptions parse(CLI::App& app, int argc, char** argv) {
  PictureOptions options;
  app.add_option("before", options.before, "Mesh before morphing (.vtu, .vtk)")->required();
  app.add_option("after", options.after, "The same mesh after morphing")->required();
  app.add_option("output", options.output, "Picture to write (.png)")->required();
  const std::map<std::string, Field> fields{{"displacement", Field::Displacement},
                                            {"quality", Field::Quality}};
  app.add_option("--field", options.field, "What colours show: displacement or quality")
      ->transform(CLI::CheckedTransformer(fields))
      ->option_text("FIELD [displacement]");
  const std::map<std::string, int> axes{{"x", 0}, {"y", 1}, {"z", 2}};
  app.add_option("--cut", options.cut_axis, "Axis normal to the cut: x, y or z")
      ->transform(CLI::CheckedTransformer(axes))
      ->option_text("AXIS [y]");
  app.add_option("--unit", options.unit, "Unit of the coordinates, for the labels")
      ->capture_default_str();
  app.parse(argc, argv);
  return options;
}

}  // namespace
}  // namespace cadmorph

int main(int argc, char** argv) {
  CLI::App app{
      "Draws a mesh before and after morphing: both surfaces, and both cut open with the "
      "worst elements in red."};
  vtkObject::GlobalWarningDisplayOff();  // failures are told once, by us
  try {
    cadmorph::draw(cadmorph::parse(app, argc, argv));
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 1;
  } catch (const cadmorph::SolverError& error) {
    std::fprintf(stderr, "cadmorph-picture: %s\n", error.what());
    return 6;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cadmorph-picture: %s\n", error.what());
    return 2;
  }
}
