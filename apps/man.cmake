# The manual pages, made of the programs' own help: cadmorph.1, cadmorph-<command>.1 and
# cadmorph-picture.1.
find_program(HELP2MAN help2man)
if(NOT HELP2MAN)
  message(STATUS "No help2man: no manual pages")
  return()
endif()

set(pages)
# man_page(NAME PROGRAM COMMAND DESCRIPTION): `COMMAND` is empty for the main command.
function(man_page name program command description)
  set(page ${CMAKE_CURRENT_BINARY_DIR}/${name}.1)
  add_custom_command(OUTPUT ${page}
    COMMAND ${HELP2MAN} --no-info --name=${description}
      --version-string=${PROJECT_VERSION} --include=${CMAKE_CURRENT_SOURCE_DIR}/man/sections.h2m
      --output=${page} "$<TARGET_FILE:${program}> ${command}"
    DEPENDS ${program} man/sections.h2m
    COMMENT "Manual page ${name}.1"
    VERBATIM)
  set(pages ${pages} ${page} PARENT_SCOPE)
endfunction()

man_page(cadmorph cadmorph "" "moves a simulation mesh onto a changed CAD model")
man_page(cadmorph-quality cadmorph quality "measures the elements of a mesh")
man_page(cadmorph-match cadmorph match "shows which CAD entity became which")
man_page(cadmorph-batch cadmorph batch "morphs a mesh onto many variants of one base")
man_page(cadmorph-compare cadmorph compare "tells what differs between two meshes")
man_page(cadmorph-field cadmorph field "writes the deformation field of a morph")
man_page(cadmorph-apply cadmorph apply "moves points with a deformation field")
man_page(cadmorph-velocity cadmorph velocity "writes how a CAD parameter moves each node")
man_page(cadmorph-gradient cadmorph gradient "gradient by CAD parameters from nodal sensitivities")
man_page(cadmorph-picture cadmorph-picture "" "draws a mesh before and after morphing")

add_custom_target(man ALL DEPENDS ${pages})
install(FILES ${pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT cadmorph)
