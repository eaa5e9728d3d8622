# The manual pages, made of the program's own help: cadmorph.1 and cadmorph-<command>.1.
find_program(HELP2MAN help2man)
if(NOT HELP2MAN)
  message(STATUS "No help2man: no manual pages")
  return()
endif()

set(pages)
# man_page(NAME COMMAND DESCRIPTION): `COMMAND` is empty for the main command.
function(man_page name command description)
  set(page ${CMAKE_CURRENT_BINARY_DIR}/${name}.1)
  add_custom_command(OUTPUT ${page}
    COMMAND ${HELP2MAN} --no-info --name=${description}
      --version-string=${PROJECT_VERSION} --include=${CMAKE_CURRENT_SOURCE_DIR}/man/sections.h2m
      --output=${page} "$<TARGET_FILE:cadmorph> ${command}"
    DEPENDS cadmorph man/sections.h2m
    COMMENT "Manual page ${name}.1"
    VERBATIM)
  set(pages ${pages} ${page} PARENT_SCOPE)
endfunction()

man_page(cadmorph "" "moves a simulation mesh onto a changed CAD model")
man_page(cadmorph-quality quality "measures the elements of a mesh")
man_page(cadmorph-match match "shows which CAD entity became which")
man_page(cadmorph-batch batch "morphs a mesh onto many variants of one base")
man_page(cadmorph-compare compare "tells what differs between two meshes")
man_page(cadmorph-field field "writes the deformation field of a morph")
man_page(cadmorph-apply apply "moves points with a deformation field")

add_custom_target(man ALL DEPENDS ${pages})
install(FILES ${pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT cadmorph)
