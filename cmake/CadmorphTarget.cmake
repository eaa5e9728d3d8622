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
  if(name STREQUAL core)
    cadmorph_precompile(cadmorph_core)
  else()
    target_precompile_headers(cadmorph_${name} REUSE_FROM cadmorph_core)
  endif()
endfunction()

# Headers that most sources include, and those given, are read once, not for each source: that saves
# a quarter of the time to compile. Each source includes what it uses all the same.
function(cadmorph_precompile target)
  target_precompile_headers(${target} PRIVATE
    <algorithm> <array> <cmath> <filesystem> <functional> <map> <memory> <optional> <ranges> <span> <sstream>
    <string> <utility> <vector> <Eigen/Core> ${ARGN})
endfunction()

function(cadmorph_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic)
  # g++ 12 sees overlaps and copies out of bounds where strings are added or moved ("a" +
  # std::string()) that are none: GCC bug 105651 and its kin.
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    target_compile_options(${target} PRIVATE
      -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow -Wno-stringop-overread)
  endif()
  # Sources that are compiled together look like headers, where local types in a class are a fault.
  if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  endif()
  if(CADMORPH_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
