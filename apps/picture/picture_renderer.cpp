#include "apps/picture/picture_renderer.h"

#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkCellData.h>
#include <vtkDataSetSurfaceFilter.h>
#include <vtkFeatureEdges.h>
#include <vtkImageShrink3D.h>
#include <vtkLight.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkScalarBarActor.h>
#include <vtkSmartPointer.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>
#include <vtkUnstructuredGrid.h>
#include <vtkWarpVector.h>
#include <vtkWindowToImageFilter.h>
#include <vtkXMLUnstructuredGridReader.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>

#include "core/errors.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

constexpr int kOversampling = 2;  // rendered larger and shrunk: smooth edges with any driver
constexpr float kLineWidth = 0.6F, kOutlineWidth = 1.5F;  // in pixels
constexpr int kCompression = 3;       // half the time of VTK's 5, a tenth more bytes
constexpr double kBarWidth = 0.1;     // of the picture
constexpr double kFeatureAngle = 35;  // degrees: facets of a circle of 12 turn by less
constexpr const char* kDisplacement = "displacement";

/// A surface as triangles and quads, with its sharp edges.
struct Drawable {
  vtkNew<vtkPolyData> surface, outline;
};

/// The surfaces of a scene, each read and prepared once.
class Drawables {
 public:
  explicit Drawables(fs::path folder) : folder_(std::move(folder)) {}

  const Drawable& at(const std::string& file, bool is_moved) {
    const auto [entry, is_new] = drawables_.try_emplace({file, is_moved});
    if (is_new) fill(entry->second, folder_ / file, is_moved);
    return entry->second;
  }

 private:
  static void fill(Drawable& drawable, const fs::path& path, bool is_moved) {
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    reader->SetFileName(path.c_str());
    reader->Update();
    if (reader->GetErrorCode() != 0) throw IoError("can't read " + path.string());
    vtkNew<vtkDataSetSurfaceFilter> surface;
    surface->SetInputConnection(reader->GetOutputPort());
    vtkNew<vtkWarpVector> warp;
    warp->SetInputConnection(surface->GetOutputPort());
    warp->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, kDisplacement);
    warp->SetScaleFactor(is_moved ? 1 : 0);
    surface->Update();
    const bool can_move = surface->GetOutput()->GetPointData()->HasArray(kDisplacement) != 0;
    vtkAlgorithm* last = can_move ? static_cast<vtkAlgorithm*>(warp) : surface;
    last->Update();
    drawable.surface->ShallowCopy(last->GetOutputDataObject(0));
    vtkNew<vtkFeatureEdges> outline;
    outline->SetInputData(drawable.surface);
    outline->SetFeatureAngle(kFeatureAngle);
    outline->ManifoldEdgesOff();
    outline->NonManifoldEdgesOff();
    outline->ColoringOff();
    outline->Update();
    drawable.outline->ShallowCopy(outline->GetOutput());
  }

  fs::path folder_;
  std::map<std::pair<std::string, bool>, Drawable> drawables_;
};

vtkNew<vtkLookupTable> scale_colours(const Picture& picture, bool is_reversed) {
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
  table->SetRange(picture.low, picture.high > picture.low ? picture.high : picture.low + 1);
  return table;
}

vtkNew<vtkLookupTable> mark_colours() {
  vtkNew<vtkLookupTable> table;
  table->SetNumberOfTableValues(2);
  table->SetTableValue(0, 0.92, 0.93, 0.95);
  table->SetTableValue(1, 0.86, 0.08, 0.12);
  table->SetRange(0, 1);
  return table;
}

void colour_by(vtkPolyDataMapper* mapper, const Panel& panel, const Picture& picture) {
  if (panel.colouring == Colouring::Plain) {
    mapper->ScalarVisibilityOff();
    return;
  }
  if (panel.colouring == Colouring::Marks)
    mapper->SetLookupTable(mark_colours());
  else
    mapper->SetLookupTable(scale_colours(picture, panel.colouring == Colouring::ReversedScale));
  mapper->UseLookupTableScalarRangeOn();
  mapper->InterpolateScalarsBeforeMappingOn();
  if (panel.array == kDisplacement) {
    mapper->SetScalarModeToUsePointFieldData();
    auto* table = vtkLookupTable::SafeDownCast(mapper->GetLookupTable());
    table->SetVectorModeToMagnitude();
  } else {
    mapper->SetScalarModeToUseCellFieldData();
  }
  mapper->SelectColorArray(panel.array.c_str());
}

void add_surface(vtkRenderer* renderer, const Drawable& drawable, const Panel& panel,
                 const Picture& picture) {
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputData(drawable.surface);
  colour_by(mapper, panel, picture);
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  vtkProperty* look = actor->GetProperty();
  look->SetColor(0.84, 0.87, 0.91);
  look->SetInterpolationToFlat();
  look->SetAmbient(0.3);
  look->SetDiffuse(0.8);
  look->EdgeVisibilityOn();
  look->SetEdgeColor(0.25, 0.28, 0.33);
  look->SetLineWidth(kOversampling * kLineWidth);
  renderer->AddActor(actor);

  vtkNew<vtkPolyDataMapper> outline_mapper;
  outline_mapper->SetInputData(drawable.outline);
  outline_mapper->ScalarVisibilityOff();
  outline_mapper->SetResolveCoincidentTopologyToPolygonOffset();
  vtkNew<vtkActor> outline_actor;
  outline_actor->SetMapper(outline_mapper);
  outline_actor->GetProperty()->SetColor(0.05, 0.06, 0.08);
  outline_actor->GetProperty()->SetLineWidth(kOversampling *
                                             (panel.is_cut ? kLineWidth : kOutlineWidth));
  outline_actor->GetProperty()->LightingOff();
  renderer->AddActor(outline_actor);
}

// A light that goes with the camera, from the given direction (right, up, to the eye). Two suffice:
// each costs time at every pixel.
void add_light(vtkRenderer* renderer, std::array<double, 3> from, double intensity) {
  vtkNew<vtkLight> light;
  light->SetLightTypeToCameraLight();
  light->SetPosition(from.data());
  light->SetIntensity(intensity);
  renderer->AddLight(light);
}

void add_text(vtkRenderer* renderer, const std::string& text, double y, int size, bool is_bold) {
  if (text.empty()) return;
  vtkNew<vtkTextActor> actor;
  actor->SetInput(text.c_str());
  vtkTextProperty* look = actor->GetTextProperty();
  look->SetFontFamilyToArial();
  look->SetFontSize(size * kOversampling);
  look->SetBold(is_bold);
  look->SetColor(0.1, 0.11, 0.14);
  look->SetVerticalJustificationToTop();
  actor->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  actor->SetPosition(0.03, y);
  renderer->AddViewProp(actor);
}

void add_scalar_bar(vtkRenderer* renderer, const Picture& picture) {
  const bool is_reversed = std::ranges::any_of(
      picture.panels, [](const Panel& p) { return p.colouring == Colouring::ReversedScale; });
  vtkNew<vtkScalarBarActor> bar;
  bar->SetLookupTable(scale_colours(picture, is_reversed));
  bar->SetTitle(picture.bar_title.c_str());
  bar->SetNumberOfLabels(5);
  bar->SetLabelFormat("%.3g");
  bar->UnconstrainedFontSizeOn();
  bar->SetBarRatio(0.22);
  bar->SetTitleRatio(0.5);
  bar->SetVerticalTitleSeparation(10 * kOversampling);
  for (vtkTextProperty* look : {bar->GetTitleTextProperty(), bar->GetLabelTextProperty()}) {
    look->SetFontFamilyToArial();
    look->SetColor(0.1, 0.11, 0.14);
    look->ItalicOff();
    look->ShadowOff();
    look->SetBold(false);
    look->SetFontSize(17 * kOversampling);
  }
  constexpr int height = 460;  // pixels
  const double share = static_cast<double>(height) / picture.height;
  bar->GetPositionCoordinate()->SetCoordinateSystemToNormalizedViewport();
  bar->SetPosition(0.05, 0.95 - share);
  bar->SetWidth(0.85);
  bar->SetHeight(share);
  renderer->AddViewProp(bar);
}

/// What all pictures of a scene are seen by.
struct Aim {
  Eigen::Vector3d eye, focus, up;
  Eigen::Vector3d size;  ///< of all surfaces, seen from the eye: width, height, depth
};

// From the negative side of the cut axis and a little from the side and above, at all surfaces.
Aim aim_at(const std::vector<vtkPolyData*>& surfaces, int cut_axis) {
  Aim aim;
  aim.up = cut_axis == 2 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d ahead = Eigen::Vector3d::Unit(cut_axis);
  const Eigen::Vector3d aside = ahead.cross(aim.up);
  const Eigen::Vector3d from = (-ahead - 0.55 * aside + 0.55 * aim.up).normalized();
  const Eigen::Vector3d right = aim.up.cross(from).normalized();
  const Eigen::Vector3d top = from.cross(right);

  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (vtkPolyData* surface : surfaces) {
    for (vtkIdType i = 0; i < surface->GetNumberOfPoints(); ++i) {
      const Eigen::Vector3d p(surface->GetPoint(i));
      const Eigen::Vector3d seen(p.dot(right), p.dot(top), p.dot(from));
      low = low.cwiseMin(seen);
      high = high.cwiseMax(seen);
    }
  }
  const Eigen::Vector3d middle = (low + high) / 2;
  aim.size = high - low;
  aim.focus = middle[0] * right + middle[1] * top + middle[2] * from;
  aim.eye = aim.focus + 2 * aim.size.norm() * from;
  return aim;
}

// Fits all into a panel of the given aspect, below its texts where it has any.
vtkNew<vtkCamera> make_camera(const Aim& aim, double aspect, bool has_texts) {
  constexpr double margin = 1.05, margin_for_texts = 1.32;
  vtkNew<vtkCamera> camera;
  camera->ParallelProjectionOn();
  camera->SetFocalPoint(aim.focus.data());
  camera->SetPosition(aim.eye.data());
  camera->SetViewUp(aim.up.data());
  camera->SetWindowCenter(0, has_texts ? 0.12 : 0);
  camera->SetParallelScale(std::max((has_texts ? margin_for_texts : margin) * aim.size[1],
                                    (has_texts ? 1.1 : margin) * aim.size[0] / aspect) /
                           2);
  const double depth = aim.size.norm();
  camera->SetClippingRange(depth, 3 * depth);
  return camera;
}

// A window to draw pictures in, one after the other: a new one would compile all shaders anew.
class Canvas {
 public:
  Canvas() {
    window_->SetOffScreenRendering(1);
    window_->SetMultiSamples(0);
    window_->SetAlphaBitPlanes(1);
  }

  void draw(const Picture& picture, Drawables& drawables, const Aim& aim, const fs::path& path) {
    window_->SetSize(picture.width * kOversampling, picture.height * kOversampling);
    add_panels(picture, drawables, aim);
    window_->Render();
    write(picture, path);
    for (vtkRenderer* renderer : renderers_) window_->RemoveRenderer(renderer);
    renderers_.clear();
  }

 private:
  void add_panels(const Picture& picture, Drawables& drawables, const Aim& aim) {
    const int count = static_cast<int>(picture.panels.size());
    const int rows = (count + picture.columns - 1) / picture.columns;
    const double right = picture.bar_title.empty() ? 1 : 1 - kBarWidth;
    const double width = right / picture.columns, height = 1.0 / rows;
    const bool has_texts =
        std::ranges::any_of(picture.panels, [](const Panel& p) { return !p.title.empty(); });
    const vtkNew<vtkCamera> camera =
        make_camera(aim, width * picture.width / (height * picture.height), has_texts);
    for (int i = 0; i < count; ++i) {
      const int row = i / picture.columns;
      const double left = (i % picture.columns) * width, top = 1 - row * height;
      add_panel(picture, picture.panels[i], drawables, camera,
                {left, top - height, left + width, top});
    }
    if (right < 1) add_scalar_bar(add_renderer({right, 0, 1, 1}, picture), picture);
  }

  void write(const Picture& picture, const fs::path& path) {
    vtkNew<vtkWindowToImageFilter> image;
    image->SetInput(window_);
    image->ReadFrontBufferOff();
    if (picture.is_transparent) image->SetInputBufferTypeToRGBA();
    vtkNew<vtkImageShrink3D> shrink;
    shrink->SetInputConnection(image->GetOutputPort());
    shrink->SetShrinkFactors(kOversampling, kOversampling, 1);
    shrink->AveragingOn();
    vtkNew<vtkPNGWriter> writer;
    writer->SetInputConnection(shrink->GetOutputPort());
    writer->SetFileName(path.c_str());
    writer->SetCompressionLevel(kCompression);
    writer->Write();
    if (writer->GetErrorCode() != 0 || !fs::exists(path))
      throw IoError("can't write " + path.string());
  }

  vtkNew<vtkRenderer> add_renderer(std::array<double, 4> viewport, const Picture& picture) {
    vtkNew<vtkRenderer> renderer;
    renderer->SetViewport(viewport.data());
    renderer->SetBackground(1, 1, 1);
    if (picture.is_transparent) renderer->SetBackgroundAlpha(0);
    window_->AddRenderer(renderer);
    renderers_.emplace_back(renderer);
    return renderer;
  }

  void add_panel(const Picture& picture, const Panel& panel, Drawables& drawables,
                 vtkCamera* camera, std::array<double, 4> viewport) {
    const vtkNew<vtkRenderer> renderer = add_renderer(viewport, picture);
    renderer->SetActiveCamera(camera);
    renderer->AutomaticLightCreationOff();
    add_light(renderer, {0, 0, 1}, 0.75);
    add_light(renderer, {-0.6, 0.9, 0.5}, 0.5);
    add_surface(renderer, drawables.at(panel.surface, panel.is_moved), panel, picture);
    const bool is_small = panel.title.size() > 20;
    add_text(renderer, panel.title, 0.97, is_small ? 21 : 28, true);
    add_text(renderer, panel.subtitle, is_small ? 0.91 : 0.9, 19, false);
  }

  vtkNew<vtkRenderWindow> window_;
  std::vector<vtkSmartPointer<vtkRenderer>> renderers_;
};

}  // namespace

void draw(const Scene& scene, const fs::path& folder) {
  Drawables drawables(folder);
  std::vector<vtkPolyData*> surfaces;
  for (const Picture& picture : scene.pictures)
    for (const Panel& panel : picture.panels)
      surfaces.push_back(drawables.at(panel.surface, panel.is_moved).surface);
  const Aim aim = aim_at(surfaces, scene.cut_axis);
  Canvas canvas;
  for (const Picture& picture : scene.pictures)
    canvas.draw(picture, drawables, aim, folder / picture.output);
}

}  // namespace cadmorph
