# cadmorph_library(NAME SOURCES ... PUBLIC ... PRIVATE ...): one folder's library, as cadmorph::NAME.
function(cadmorph_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(cadmorph_${name} STATIC ${ARG_SOURCES})
  add_library(cadmorph::${name} ALIAS cadmorph_${name})
  set_target_properties(cadmorph_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_include_directories(cadmorph_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include/cadmorph>)
  target_link_libraries(cadmorph_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  cadmorph_warnings(cadmorph_${name})
endfunction()

function(cadmorph_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic)
  if(CADMORPH_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
