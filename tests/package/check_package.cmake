# Makes the Debian packages of BUILD in FOLDER, unpacks the program's and the Python module's, and runs
# what they hold.
file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
execute_process(COMMAND ${CPACK} --config ${BUILD}/CPackConfig.cmake -B ${FOLDER}
  WORKING_DIRECTORY ${FOLDER} OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
file(GLOB package ${FOLDER}/cadmorph_*.deb)
set(root ${FOLDER}/root)
execute_process(COMMAND dpkg-deb -x ${package} ${root} COMMAND_ERROR_IS_FATAL ANY)

foreach(file bin/cadmorph-picture share/man/man1/cadmorph-compare.1
    share/man/man1/cadmorph-picture.1
    share/bash-completion/completions/cadmorph share/doc/cadmorph/troubleshooting.md)
  if(NOT EXISTS ${root}/usr/${file})
    message(FATAL_ERROR "the package lacks ${file}")
  endif()
endforeach()
set(model ${root}/usr/share/cadmorph/models/bore)
execute_process(
  COMMAND ${root}/usr/bin/cadmorph ${model}/base.step ${model}/step20.step ${model}/hex.vtu
    -o ${FOLDER}/bore.vtu --quiet
  COMMAND_ERROR_IS_FATAL ANY)

# What the program links to must be among the dependencies.
execute_process(COMMAND dpkg-deb -f ${package} Depends OUTPUT_VARIABLE depends)
foreach(library libocct-data-exchange libvtk9 libopenblas0 libtbb12)
  if(NOT depends MATCHES ${library})
    message(FATAL_ERROR "the package does not depend on ${library}: ${depends}")
  endif()
endforeach()

# With the number of the shared library's interface.
file(GLOB library ${FOLDER}/libcadmorph[0-9].[0-9]*_*.deb)
file(GLOB development ${FOLDER}/libcadmorph-dev_*.deb)
if(NOT library OR NOT development)
  message(FATAL_ERROR "the library and its headers have no packages")
endif()
execute_process(COMMAND dpkg-deb -f ${development} Depends OUTPUT_VARIABLE depends)
if(NOT depends MATCHES "libcadmorph[0-9]+\\.[0-9]+ \\(= " OR depends MATCHES "libocct|libvtk")
  message(FATAL_ERROR "libcadmorph-dev depends on ${depends}")
endif()

file(GLOB module ${FOLDER}/python3-cadmorph_*.deb)
if(NOT module)
  return()
endif()
execute_process(COMMAND dpkg-deb -x ${module} ${FOLDER}/python COMMAND_ERROR_IS_FATAL ANY)
execute_process(
  COMMAND ${CMAKE_COMMAND} -E env PYTHONPATH=${FOLDER}/python/usr/lib/python3/dist-packages
    /usr/bin/python3 -c "import cadmorph; cadmorph.Mesh.read('${model}/hex.vtu')"
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND dpkg-deb -f ${module} Depends OUTPUT_VARIABLE depends)
foreach(package python3-numpy libocct-data-exchange libvtk9 libopenblas0 libtbb12)
  if(NOT depends MATCHES ${package})
    message(FATAL_ERROR "python3-cadmorph does not depend on ${package}: ${depends}")
  endif()
endforeach()
