# The report page: its files become part of the program. Its script needs npm, at build time alone.
set(CADMORPH_REPORT_VIEWER AUTO CACHE STRING
  "3D view and charts in reports: ON, OFF, or AUTO: where npm is there")
set_property(CACHE CADMORPH_REPORT_VIEWER PROPERTY STRINGS AUTO ON OFF)
find_path(B64_INCLUDE_DIR b64/cencode.h REQUIRED)
find_library(B64_LIBRARY b64 REQUIRED)
find_path(MUSTACHE_INCLUDE_DIR kainjow/mustache.hpp REQUIRED)
find_package(meshoptimizer REQUIRED)

set(report_source ${CMAKE_CURRENT_SOURCE_DIR}/report/page)
set(report_work ${CMAKE_CURRENT_BINARY_DIR}/report)
set(report_script ${report_work}/page.js)
set(report_licences ${report_work}/licences.txt)
if(NOT CADMORPH_REPORT_VIEWER STREQUAL OFF)
  find_program(NPM npm)
  find_program(NODE NAMES node nodejs)
  if(CADMORPH_REPORT_VIEWER STREQUAL ON AND NOT (NPM AND NODE))
    message(FATAL_ERROR "CADMORPH_REPORT_VIEWER=ON needs npm and node")
  endif()
endif()

if(NPM AND NODE AND NOT CADMORPH_REPORT_VIEWER STREQUAL OFF)
  set(CADMORPH_HAS_REPORT_VIEWER ON CACHE INTERNAL "")
  set(is_required OFF)
  if(CADMORPH_REPORT_VIEWER STREQUAL ON)
    set(is_required ON)
  endif()
  add_custom_command(
    OUTPUT ${report_script} ${report_licences}
    COMMAND ${CMAKE_COMMAND} -DNPM=${NPM} -DNODE=${NODE} -DFOLDER=${report_source}
      -DWORK=${report_work} -DSCRIPT=${report_script} -DLICENCES=${report_licences}
      -DREQUIRED=${is_required} -P ${report_source}/bundle.cmake
    DEPENDS
      ${report_source}/build.mjs ${report_source}/bundle.cmake ${report_source}/charts.js
      ${report_source}/main.js ${report_source}/package-lock.json ${report_source}/package.json
      ${report_source}/viewer.js
    COMMENT "Bundling the report's 3D view")
else()
  set(CADMORPH_HAS_REPORT_VIEWER OFF CACHE INTERNAL "")
  message(STATUS "Reports will have no 3D view: no npm, or CADMORPH_REPORT_VIEWER=OFF")
  set(report_script ${report_work}/no_page.js) # not the bundle's name, which would count as made
  set(report_licences ${report_work}/no_licences.txt)
  file(WRITE ${report_script} "")
  file(WRITE ${report_licences} "")
endif()

add_custom_command(
  OUTPUT ${report_work}/assets.cpp
  COMMAND ${CMAKE_COMMAND} -DOUT=${report_work}/assets.cpp -DFOLDER=${report_source}
    -DSCRIPT=${report_script} -DLICENCES=${report_licences} -P ${report_source}/embed.cmake
  DEPENDS
    ${report_source}/bin_table.mustache ${report_source}/embed.cmake ${report_source}/overview.mustache
    ${report_source}/page.css
    ${report_source}/page.mustache ${report_script} ${report_licences})

target_sources(cadmorph PRIVATE
  picture/picture_process.cpp
  report/base64.cpp
  report/morph_showing.cpp
  report/overview_page.cpp
  report/report_page.cpp
  report/surface_data.cpp
  ${report_work}/assets.cpp)
target_include_directories(cadmorph SYSTEM PRIVATE ${B64_INCLUDE_DIR} ${MUSTACHE_INCLUDE_DIR})
target_link_libraries(cadmorph PRIVATE ${B64_LIBRARY} meshoptimizer::meshoptimizer)
install(FILES report/page/licences.txt DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT cadmorph)
