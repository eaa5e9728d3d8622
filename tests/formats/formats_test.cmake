# Formats as other programs read them, where these are installed.
add_test(NAME formats.walks
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/formats/walks_test.sh $<TARGET_FILE_DIR:cadmorph>)
set_tests_properties(formats.walks PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 300)
