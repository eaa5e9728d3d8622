# The dependencies between folders run one way, each heavy package has one home, and the libraries
# know no options of the program.
# cmake -DSOURCE_DIR=... -P check_includes.cmake
cmake_minimum_required(VERSION 3.25)
set(mistakes "")

# forbid(PATTERN WHY FOLDERS... [EXCEPT FILES...]): no source of these folders includes PATTERN.
function(forbid pattern why)
  cmake_parse_arguments(ARG "" "" "FOLDERS;EXCEPT" ${ARGN})
  set(found ${mistakes})
  foreach(folder ${ARG_FOLDERS})
    file(GLOB_RECURSE sources RELATIVE ${SOURCE_DIR}
      ${SOURCE_DIR}/${folder}/*.h ${SOURCE_DIR}/${folder}/*.cpp ${SOURCE_DIR}/${folder}/*.inc)
    if(NOT sources)
      message(FATAL_ERROR "no sources in ${SOURCE_DIR}/${folder}")
    endif()
    foreach(source ${sources})
      if(source IN_LIST ARG_EXCEPT)
        continue()
      endif()
      file(STRINGS ${SOURCE_DIR}/${source} lines REGEX "^#include [<\"]${pattern}")
      foreach(line ${lines})
        list(APPEND found "${source}: ${line} (${why})")
      endforeach()
    endforeach()
  endforeach()
  set(mistakes ${found} PARENT_SCOPE)
endfunction()

forbid("(cad|surface|volume|apps)/" "core stands alone" FOLDERS core)
forbid("(surface|volume|apps)/" "cad knows core only" FOLDERS cad)
forbid("(volume|apps)/" "surface knows core and cad only" FOLDERS surface)
forbid("(cad|surface|apps)/" "volume knows core only" FOLDERS volume)
forbid("[A-Za-z0-9_]+\\.hxx" "OCCT headers belong in cad/*.cpp"
  FOLDERS core cad surface volume apps
  EXCEPT cad/analytic_patches.cpp cad/brep.cpp cad/brep_builder.cpp cad/brep_impl.h cad/brep_reader.cpp cad/cut_seams.cpp cad/face_merge.cpp cad/face_pieces.cpp cad/fault_guard.cpp cad/healing.cpp
    cad/packed_model.cpp cad/pcurve.h cad/pcurve_repair.cpp cad/step_reader.cpp
    cad/trim_loops.cpp)
forbid("vtk[A-Za-z]+\\.h" "VTK belongs in the mesh file and the picture"
  FOLDERS core cad surface volume apps
  EXCEPT core/formats/vtk.cpp core/formats/vtk/layout.h core/formats/vtk/messages.cpp
    core/formats/vtk/reader.h core/formats/vtk/reader.cpp core/formats/vtk/writer.h
    core/formats/vtk/writer.cpp apps/picture/picture.cpp
    apps/picture/picture_renderer.cpp)
forbid("hdf5" "HDF5 belongs in its file" FOLDERS core cad surface volume apps
  EXCEPT core/formats/hdf5_library.cpp)
forbid("(netcdf|exodusII|cgnslib|med)\\.h" "only HDF5 is linked, the others read with it"
  FOLDERS core cad surface volume apps)
forbid("pugixml" "XML belongs in the XDMF reader" FOLDERS core cad surface volume apps
  EXCEPT core/formats/xdmf.cpp)
forbid("zlib" "zlib belongs in the source file" FOLDERS core cad surface volume apps
  EXCEPT core/formats/source_file.cpp)
forbid("libdeflate" "libdeflate belongs in the VTK writer" FOLDERS core cad surface volume apps
  EXCEPT core/formats/vtk/writer.cpp)
forbid("nanoflann" "nanoflann belongs in the kd-tree" FOLDERS core cad surface volume apps
  EXCEPT core/kd_tree.cpp)
forbid("CGAL/" "CGAL belongs in the simplex-linear method"
  FOLDERS core cad surface volume apps
  EXCEPT volume/baselines/simplex_linear.cpp)
forbid("(lapacke?|cblas)" "LAPACK belongs in the dense solvers" FOLDERS core cad surface volume apps
  EXCEPT core/rbf/dense_solver.cpp)

# The libraries do not know the command line: messages name remedies (core/remedies.h), which the
# program and the interface have words of their own for.
foreach(folder core cad surface volume apps/pipeline apps/library)
  file(GLOB_RECURSE sources RELATIVE ${SOURCE_DIR} ${SOURCE_DIR}/${folder}/*.h ${SOURCE_DIR}/${folder}/*.cpp)
  list(REMOVE_ITEM sources apps/library/errors.cpp)
  foreach(source ${sources})
    file(STRINGS ${SOURCE_DIR}/${source} lines REGEX "\"[^\"]*(--[a-z]|cadmorph (match|field|apply|batch|quality|velocity|gradient|compare))[^\"]*\"")
    foreach(line ${lines})
      list(APPEND mistakes "${source}: ${line} (an option of the program)")
    endforeach()
  endforeach()
endforeach()

if(mistakes)
  string(REPLACE ";" "\n  " mistakes "${mistakes}")
  message(FATAL_ERROR "includes across the layout:\n  ${mistakes}")
endif()
