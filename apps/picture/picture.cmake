# cadmorph-picture: a program of its own, so that rendering can never take the main job down.
# VTK's targets belong to the top folder, so what they link to here (X11, GLEW) must be seen there.
set(CMAKE_FIND_PACKAGE_TARGETS_GLOBAL ON)
find_package(VTK 9.1 REQUIRED COMPONENTS
  CommonCore CommonDataModel FiltersCore FiltersGeneral
  FiltersGeometry IOImage IOXML ImagingCore RenderingAnnotation RenderingCore RenderingFreeType
  RenderingOpenGL2)

add_executable(cadmorph-picture
  picture/picture.cpp
  picture/picture_display.cpp
  picture/picture_renderer.cpp)
target_link_libraries(cadmorph-picture PRIVATE
  cadmorph_pictures CLI11::CLI11
  VTK::CommonCore VTK::CommonDataModel VTK::FiltersCore VTK::FiltersGeneral
  VTK::FiltersGeometry VTK::IOImage VTK::IOXML VTK::ImagingCore VTK::RenderingAnnotation VTK::RenderingCore
  VTK::RenderingFreeType VTK::RenderingOpenGL2)
vtk_module_autoinit(TARGETS cadmorph-picture
  MODULES VTK::RenderingFreeType VTK::RenderingOpenGL2)
cadmorph_warnings(cadmorph-picture)
install(TARGETS cadmorph-picture COMPONENT cadmorph)
