# The Debian package holds what a user needs, and its program runs.
add_test(NAME package.deb
  COMMAND ${CMAKE_COMMAND}
    -DCPACK=${CMAKE_CPACK_COMMAND} -DBUILD=${PROJECT_BINARY_DIR}
    -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/package
    -P ${CMAKE_CURRENT_SOURCE_DIR}/package/check_package.cmake)
