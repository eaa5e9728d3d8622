# Every command line of the pages runs as shown, every link leads somewhere, and the site builds.
file(GLOB pages CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}
  ${PROJECT_SOURCE_DIR}/*.md ${PROJECT_SOURCE_DIR}/docs/*.md ${PROJECT_SOURCE_DIR}/models/*.md
  ${PROJECT_SOURCE_DIR}/models/*/README.md)
foreach(page ${pages})
  file(STRINGS ${PROJECT_SOURCE_DIR}/${page} blocks REGEX "^```")
  if(NOT blocks)
    continue()
  endif()
  list(APPEND pages_with_commands ${page})
  add_test(NAME docs.commands:${page}
    COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/docs/run_commands.sh ${PROJECT_SOURCE_DIR}/${page}
      ${PROJECT_BINARY_DIR})
endforeach()
add_test(NAME docs.commands_are_run
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/docs/page_commands.py check ${PROJECT_SOURCE_DIR}
    ${pages_with_commands}
  WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
add_test(NAME docs.commands_of_nobody_are_noticed
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/docs/page_commands_test.sh)
add_test(NAME docs.links
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/docs/check_links.sh ${PROJECT_SOURCE_DIR})
add_test(NAME docs.site
  COMMAND ${PROJECT_SOURCE_DIR}/scripts/docs ${CMAKE_CURRENT_BINARY_DIR}/site)
add_test(NAME docs.container_is_built_as_shown
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/docs/dockerfile_test.sh ${PROJECT_SOURCE_DIR})
add_test(NAME docs.words
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/docs/words_test.sh ${PROJECT_SOURCE_DIR})
