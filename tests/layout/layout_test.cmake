# Who may include whom (see CONTRIBUTING.md).
add_test(NAME layout.includes_follow_the_folders
  COMMAND ${CMAKE_COMMAND} -DSOURCE_DIR=${PROJECT_SOURCE_DIR}
    -P ${CMAKE_CURRENT_SOURCE_DIR}/layout/check_includes.cmake)
add_test(NAME layout.test_names_are_whole
  COMMAND ${CMAKE_COMMAND} -DSOURCE_DIR=${PROJECT_SOURCE_DIR}
    -P ${CMAKE_CURRENT_SOURCE_DIR}/layout/check_test_names.cmake)
set_tests_properties(layout.includes_follow_the_folders layout.test_names_are_whole
  PROPERTIES LABELS fast)
