# The report page in a browser, where there are one and npm (scripts/install-dependencies
# --report-tests).
find_program(CHROMIUM NAMES chromium chromium-browser google-chrome)

set(report_test ${CMAKE_CURRENT_BINARY_DIR}/report)
function(report_test name)
  add_test(NAME ${name}
    COMMAND ${CMAKE_COMMAND}
      -DPROGRAM=$<TARGET_FILE:cadmorph> -DMODELS=${PROJECT_SOURCE_DIR}/models
      -DSOURCE=${CMAKE_CURRENT_SOURCE_DIR}/report -DWORK=${report_test}
      -DHAS_VIEWER=${CADMORPH_HAS_REPORT_VIEWER} -DNPM=${NPM} -DNODE=${NODE}
      -DBROWSER=${CHROMIUM} ${ARGN} -P ${CMAKE_CURRENT_SOURCE_DIR}/report/check_report.cmake)
  set_tests_properties(${name} PROPERTIES
    SKIP_REGULAR_EXPRESSION "skipped: " RESOURCE_LOCK report_test TIMEOUT 300)
endfunction()

report_test(report.page_works_in_browser)
report_test(report.broken_page_is_noticed -DBREAK=ON)

# The licences in the repository are those of what the page holds.
if(CADMORPH_HAS_REPORT_VIEWER)
  add_test(NAME report.licences_are_in_the_repository
    COMMAND ${CMAKE_COMMAND} -DBUNDLED=${PROJECT_BINARY_DIR}/apps/report/licences.txt
      -DKEPT=${PROJECT_SOURCE_DIR}/apps/report/page/licences.txt
      -P ${CMAKE_CURRENT_SOURCE_DIR}/report/check_licences.cmake)
  set_tests_properties(report.licences_are_in_the_repository PROPERTIES
    SKIP_REGULAR_EXPRESSION "skipped: ")
endif()
