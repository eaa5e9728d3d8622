// step_fixtures FOLDER [SHIFT]: writes box.step (6 faces), box_moved.step (the same, longer),
// box_chamfer.step (one face more) and box_inch.step (the same in inches) into a folder; with SHIFT
// only sphere_moved.step: models/shapes/sphere_in_box.step with the sphere moved along x.
// step_fixtures FOLDER boxes COUNT: v0.step, v1.step, ... only, boxes a tenth longer each.
// step_fixtures FOLDER block NAME LENGTH X RADIUS: NAME only, a block of LENGTH x 40 x 20 with a
// bore along z at (X, 20).
// step_fixtures FOLDER tube NAME LENGTH RADIUS: NAME only, a straight tube along z, 30 wide.

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepFilletAPI_MakeChamfer.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <Interface_Static.hxx>
#include <STEPControl_Controller.hxx>
#include <STEPControl_Writer.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <cstdlib>
#include <filesystem>

namespace {

bool write(const TopoDS_Shape& shape, const std::filesystem::path& path, const char* unit = "MM") {
  STEPControl_Controller::Init();  // makes the setting known
  Interface_Static::SetCVal("write.step.unit", unit);
  STEPControl_Writer writer;
  return writer.Transfer(shape, STEPControl_AsIs) == IFSelect_RetDone &&
         writer.Write(path.c_str()) == IFSelect_RetDone;
}

TopoDS_Shape box(double length) { return BRepPrimAPI_MakeBox(length, 20, 30).Shape(); }

TopoDS_Shape chamfered() {
  const TopoDS_Shape shape = box(10);
  BRepFilletAPI_MakeChamfer chamfer(shape);
  chamfer.Add(1.0, TopoDS::Edge(TopExp_Explorer(shape, TopAbs_EDGE).Current()));
  return chamfer.Shape();
}

TopoDS_Shape sphere_in_box(double shift) {
  const TopoDS_Shape outside = BRepPrimAPI_MakeBox(60, 60, 60).Solid();
  const TopoDS_Shape sphere = BRepPrimAPI_MakeSphere(gp_Pnt(30 + shift, 30, 30), 12).Solid();
  return BRepAlgoAPI_Cut(outside, sphere).Shape();
}

bool write_boxes(const std::filesystem::path& folder, int count) {
  bool is_done = true;
  for (int i = 0; i < count && is_done; ++i)
    is_done = write(box(10 + 0.1 * i), folder / ("v" + std::to_string(i) + ".step"));
  return is_done;
}

TopoDS_Shape block(double length, double x, double radius) {
  const TopoDS_Shape outside = BRepPrimAPI_MakeBox(length, 40, 20).Solid();
  const gp_Ax2 axis(gp_Pnt(x, 20, -5), gp_Dir(0, 0, 1));
  return BRepAlgoAPI_Cut(outside, BRepPrimAPI_MakeCylinder(axis, radius, 30).Solid()).Shape();
}

TopoDS_Shape tube(double length, double radius) {
  const gp_Ax2 axis(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1));
  return BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(axis, 15, length).Solid(),
                         BRepPrimAPI_MakeCylinder(axis, radius, length).Solid())
      .Shape();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 1;
  const std::filesystem::path folder = argv[1];
  if (argc == 7)
    return write(block(std::atof(argv[4]), std::atof(argv[5]), std::atof(argv[6])),
                 folder / argv[3])
               ? 0
               : 1;
  if (argc == 6)
    return write(tube(std::atof(argv[4]), std::atof(argv[5])), folder / argv[3]) ? 0 : 1;
  if (argc == 4) return write_boxes(folder, std::atoi(argv[3])) ? 0 : 1;
  if (argc == 3)
    return write(sphere_in_box(std::atof(argv[2])), folder / "sphere_moved.step") ? 0 : 1;
  const bool is_done = write(box(10), folder / "box.step") &&
                       write(box(12), folder / "box_moved.step") &&
                       write(chamfered(), folder / "box_chamfer.step") &&
                       write(box(10), folder / "box_inch.step", "INCH");
  return is_done ? 0 : 1;
}
