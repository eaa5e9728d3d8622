# The public interface: the headers in include/cadmorph, and libcadmorph.so, which shows nothing else.
cadmorph_library(library
  SOURCES
    library/cad_model.cpp
    library/derivative.cpp
    library/errors.cpp
    library/mesh.cpp
    library/morpher.cpp
    library/options.cpp
    library/report.cpp
    library/threads.cpp
  PUBLIC Eigen3::Eigen
  PRIVATE cadmorph::pipeline cadmorph::summaries)
target_compile_definitions(cadmorph_library PRIVATE CADMORPH_V1=v1)
target_include_directories(cadmorph_library
  PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/library/include>
  PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/include)

add_library(cadmorph_shared SHARED $<TARGET_OBJECTS:cadmorph_library>)
target_link_libraries(cadmorph_shared
  PUBLIC Eigen3::Eigen
  PRIVATE cadmorph::pipeline cadmorph::summaries)
set(exports ${CMAKE_CURRENT_SOURCE_DIR}/library/exports.map)
target_link_options(cadmorph_shared PRIVATE -Wl,--version-script=${exports} -Wl,--no-undefined)
set_target_properties(cadmorph_shared PROPERTIES
  LINKER_LANGUAGE CXX
  LINK_DEPENDS ${exports}
  OUTPUT_NAME cadmorph
  EXPORT_NAME cadmorph
  VERSION ${PROJECT_VERSION}
  SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
target_include_directories(cadmorph_shared
  PUBLIC "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/library/include;${PROJECT_SOURCE_DIR}>"
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
