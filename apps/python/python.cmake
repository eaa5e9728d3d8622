# The Python module, complete in the build folder's apps/python: PYTHONPATH=build/apps/python.
if(NOT CADMORPH_BUILD_PYTHON)
  return()
endif()
# Debian's own, which has numpy, unless another one is named.
if(NOT DEFINED Python_EXECUTABLE AND EXISTS /usr/bin/python3)
  set(Python_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "Python to build the module for")
endif()
find_package(Python COMPONENTS Interpreter Development.Module)
if(Python_FOUND)
  find_package(pybind11 CONFIG)
endif()
if(NOT Python_FOUND OR NOT pybind11_FOUND)
  message(STATUS "No Python module: pybind11-dev and python3-dev are needed for it")
  return()
endif()

pybind11_add_module(cadmorph_python MODULE NO_EXTRAS
  python/convert.cpp
  python/errors.cpp
  python/module.cpp
  python/progress.cpp
  python/reports.cpp)
target_link_libraries(cadmorph_python PRIVATE cadmorph::library)
target_include_directories(cadmorph_python PRIVATE ${PROJECT_SOURCE_DIR})
target_link_options(cadmorph_python PRIVATE -Wl,--exclude-libs,ALL)
set(python_dir ${CMAKE_CURRENT_BINARY_DIR}/python/cadmorph)
set_target_properties(cadmorph_python PROPERTIES
  OUTPUT_NAME _native LIBRARY_OUTPUT_DIRECTORY ${python_dir})
cadmorph_warnings(cadmorph_python)

set(python_files __init__.py _meshio.py _native.pyi _parameters.py _picture.py idwarp.py openmdao.py
  py.typed)
list(TRANSFORM python_files PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/python/cadmorph/)
file(MAKE_DIRECTORY ${python_dir})
foreach(file ${python_files})
  configure_file(${file} ${python_dir}/ COPYONLY)
endforeach()

set(CADMORPH_PYTHON_DIR lib/python3/dist-packages CACHE STRING
  "Where the Python module is installed, below the prefix")
install(FILES ${python_files} DESTINATION ${CADMORPH_PYTHON_DIR}/cadmorph COMPONENT python)
install(TARGETS cadmorph_python DESTINATION ${CADMORPH_PYTHON_DIR}/cadmorph COMPONENT python)
