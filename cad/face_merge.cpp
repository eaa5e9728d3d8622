#include <BRepGProp.hxx>
#include <BRepTools_History.hxx>
#include <GProp_GProps.hxx>
#include <NCollection_DataMap.hxx>
#include <ShapeUpgrade_UnifySameDomain.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopTools_ShapeMapHasher.hxx>
#include <TopoDS_Face.hxx>
#include <cmath>

#include "cad/brep_builder.h"
#include "cad/brep_impl.h"

namespace cadmorph {
namespace {

// Surfaces within these of each other are one: far above the rounding of a file, far below a step.
constexpr double kSameDistance = 1e-7;  // diagonals
constexpr double kSameAngle = 1e-6;
constexpr double kSameArea = 1e-5;  // of the area: what a sound merge keeps

double area(const TopoDS_Shape& shape) {
  GProp_GProps properties;
  BRepGProp::SurfaceProperties(shape, properties);
  return properties.Mass();
}

// Names of the faces of a merged shape: that of the only face it came from; else none.
class MergedNames {
 public:
  MergedNames(const CadModel::Impl& model, const Handle(BRepTools_History) & history) {
    const TopTools_IndexedMapOfShape faces = usable_faces(model.shape);
    for (int i = 1; i <= faces.Extent(); ++i) {
      const std::string& name = model.faces[FaceId(i - 1)].name;
      const TopTools_ListOfShape& images = history->Modified(faces(i));
      if (images.IsEmpty()) add(faces(i), name);
      for (const TopoDS_Shape& image : images) add(image, name);
    }
  }

  std::string operator()(const TopoDS_Face& face) const {
    const std::string* name = names_.Seek(face);
    return name ? *name : std::string();
  }

 private:
  void add(const TopoDS_Shape& face, const std::string& name) {
    if (!names_.Bind(face, name)) names_.ChangeFind(face).clear();
  }

  NCollection_DataMap<TopoDS_Shape, std::string, TopTools_ShapeMapHasher> names_;
};

}  // namespace

std::optional<CadModel> CadModel::with_merged_faces() const {
  try {
    constexpr bool edges_too = false, faces_too = true, concatenates = false;
    ShapeUpgrade_UnifySameDomain merger(impl_->shape, edges_too, faces_too, concatenates);
    merger.SetLinearTolerance(kSameDistance * diagonal());
    merger.SetAngularTolerance(kSameAngle);
    merger.Build();
    const TopoDS_Shape merged = merger.Shape();
    if (merged.IsNull()) return std::nullopt;
    const int gone = static_cast<int>(faces().size()) - usable_faces(merged).Extent();
    if (gone <= 0) return std::nullopt;
    const double before = area(impl_->shape);
    if (!(std::abs(area(merged) - before) < kSameArea * before)) return std::nullopt;
    return build_model(merged,
                       {file_name(), file_unit(), MergedNames(*impl_, merger.History()), gone});
  } catch (const Standard_Failure&) {
    return std::nullopt;  // OCCT fails on pieces of a torus, for one
  }
}

}  // namespace cadmorph
