#include "cad/healing.h"

#include <NCollection_Map.hxx>
#include <ShapeAlgo.hxx>
#include <ShapeAlgo_AlgoContainer.hxx>
#include <ShapeAlgo_ToolContainer.hxx>
#include <ShapeBuild_ReShape.hxx>
#include <ShapeFix_Shape.hxx>
#include <TopTools_OrientedShapeMapHasher.hxx>

namespace cadmorph {
namespace {

// Remembers the faces in which nothing was to be replaced.
class Replacements : public ShapeBuild_ReShape {
 public:
  using ShapeBuild_ReShape::Apply;

  TopoDS_Shape Apply(const TopoDS_Shape& shape, const TopAbs_ShapeEnum until) override {
    if (shape.IsNull() || shape.ShapeType() != TopAbs_FACE || until != TopAbs_SHAPE)
      return ShapeBuild_ReShape::Apply(shape, until);
    if (unchanged_.Contains(shape)) {
      myStatus = 0;  // ShapeExtend_OK
      return shape;
    }
    const TopoDS_Shape result = ShapeBuild_ReShape::Apply(shape, until);
    if (result.IsEqual(shape)) unchanged_.Add(shape);
    return result;
  }

  void Clear() override {
    unchanged_.Clear();
    ShapeBuild_ReShape::Clear();
  }

  void Remove(const TopoDS_Shape& shape) override {
    unchanged_.Clear();
    ShapeBuild_ReShape::Remove(shape);
  }

 protected:
  void replace(const TopoDS_Shape& shape, const TopoDS_Shape& by, TReplacementKind kind) override {
    unchanged_.Clear();
    ShapeBuild_ReShape::replace(shape, by, kind);
  }

 private:
  NCollection_Map<TopoDS_Shape, TopTools_OrientedShapeMapHasher> unchanged_;
};

class Tools : public ShapeAlgo_ToolContainer {
 public:
  Handle(ShapeFix_Shape) FixShape() const override {
    Handle(ShapeFix_Shape) fix = ShapeAlgo_ToolContainer::FixShape();
    fix->SetContext(new Replacements);
    return fix;
  }
};

}  // namespace

struct QuickHealing::Before {
  Handle(ShapeAlgo_ToolContainer) tools;
};

QuickHealing::QuickHealing() {
  ShapeAlgo::Init();
  const auto container = ShapeAlgo::AlgoContainer();
  before_ = std::make_unique<Before>(Before{container->ToolContainer()});
  container->SetToolContainer(new Tools);
}

QuickHealing::~QuickHealing() { ShapeAlgo::AlgoContainer()->SetToolContainer(before_->tools); }

}  // namespace cadmorph
