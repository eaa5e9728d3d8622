#include "models/step_files.h"

#include <APIHeaderSection_MakeHeader.hxx>
#include <BRepBuilderAPI_MakeVertex.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepExtrema_DistShapeShape.hxx>
#include <BRep_Builder.hxx>
#include <Interface_Static.hxx>
#include <STEPControl_Reader.hxx>
#include <STEPControl_Writer.hxx>
#include <StepBasic_Product.hxx>
#include <StepData_StepModel.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS_Compound.hxx>
#include <algorithm>

#include "core/errors.h"

namespace cadmorph::models {
namespace {

int count(const TopoDS_Shape& shape, TopAbs_ShapeEnum kind) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, kind, map);
  return map.Extent();
}

Handle(TCollection_HAsciiString) text(const std::string& value) {
  return new TCollection_HAsciiString(value.c_str());
}

void fix_header(STEPControl_Writer& writer, const std::string& name) {
  APIHeaderSection_MakeHeader header(writer.Model());
  header.SetName(text(name + ".step"));
  header.SetTimeStamp(text("2000-01-01T00:00:00"));
  header.SetAuthorValue(1, text("The cadmorph authors"));
  header.SetOrganizationValue(1, text("cadmorph"));
  header.SetPreprocessorVersion(text("Open CASCADE"));
  header.SetOriginatingSystem(text("cadmorph-models"));
  header.SetAuthorisation(text(""));
}

/// Names products `name`, `name_2`, ... in place of OCCT's numbers, which run on from file to file.
void name_products(const Handle(StepData_StepModel) & model, const std::string& name) {
  int count = 0;
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const auto product = Handle(StepBasic_Product)::DownCast(model->Value(i));
    if (product.IsNull()) continue;
    const auto label = text(++count == 1 ? name : name + "_" + std::to_string(count));
    product->SetId(label);
    product->SetName(label);
  }
}

}  // namespace

EntityCounts count_entities(const TopoDS_Shape& shape) {
  return {count(shape, TopAbs_FACE), count(shape, TopAbs_EDGE), count(shape, TopAbs_VERTEX)};
}

void write_step(const std::filesystem::path& path, const TopoDS_Shape& shape,
                const std::string& name) {
  STEPControl_Writer writer;
  Interface_Static::SetCVal("write.step.schema", "AP214IS");
  Interface_Static::SetCVal("write.step.unit", "MM");
  if (writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone) {
    throw IoError("can't translate " + name + " to STEP");
  }
  fix_header(writer, name);
  name_products(writer.Model(), name);
  if (writer.Write(path.c_str()) != IFSelect_RetDone) {
    throw IoError("can't write " + path.string());
  }
}

TopoDS_Shape read_step(const std::filesystem::path& path) {
  STEPControl_Reader reader;
  if (reader.ReadFile(path.c_str()) != IFSelect_RetDone) {
    throw IoError("can't read " + path.string());
  }
  reader.TransferRoots();
  return reader.OneShape();
}

NearestOnShape::NearestOnShape(const TopoDS_Shape& shape)
    : extrema_(std::make_unique<BRepExtrema_DistShapeShape>()) {
  TopoDS_Compound parts;
  BRep_Builder builder;
  builder.MakeCompound(parts);
  for (TopExp_Explorer part(shape, TopAbs_FACE); part.More(); part.Next()) {
    builder.Add(parts, part.Current());
  }
  extrema_->LoadS2(parts);
}

NearestOnShape::~NearestOnShape() = default;

Eigen::Vector3d NearestOnShape::operator()(const Eigen::Vector3d& point) const {
  extrema_->LoadS1(BRepBuilderAPI_MakeVertex(gp_Pnt(point[0], point[1], point[2])).Shape());
  extrema_->Perform();
  const gp_Pnt nearest = extrema_->PointOnShape2(1);
  return {nearest.X(), nearest.Y(), nearest.Z()};
}

double largest_distance(const Points& points, const TopoDS_Shape& shape) {
  const NearestOnShape nearest(shape);
  double largest = 0;
  for (Index i = 0; i < points.rows(); ++i) {
    const Eigen::Vector3d point = points.row(i);
    largest = std::max(largest, (nearest(point) - point).norm());
  }
  return largest;
}

void check_valid(const TopoDS_Shape& shape, const std::string& name) {
  if (shape.IsNull() || !BRepCheck_Analyzer(shape).IsValid()) {
    throw CadError(name + " is no valid B-Rep");
  }
}

}  // namespace cadmorph::models
