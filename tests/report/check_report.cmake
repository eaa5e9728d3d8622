# Makes a report and runs page_test.mjs on it; with BREAK, on a page with an error in its script,
# which must be noticed.
if(NOT HAS_VIEWER OR NOT BROWSER)
  message("skipped: a 3D view in the build and a browser are needed "
    "(scripts/install-dependencies --report-tests)")
  return()
endif()

file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json ${SOURCE}/page_test.mjs
  ${SOURCE}/overview_test.mjs ${SOURCE}/body_test.mjs
  DESTINATION ${WORK})
if(NOT EXISTS ${WORK}/node_modules/puppeteer-core)
  execute_process(COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed ERROR_VARIABLE output OUTPUT_VARIABLE output)
  if(failed)
    message("skipped: the test's packages can't be fetched:\n${output}")
    return()
  endif()
endif()

set(bore ${MODELS}/bore)
execute_process(
  COMMAND ${PROGRAM} ${bore}/base.step ${bore}/step20.step ${bore}/hex.vtu
    -o ${WORK}/morphed.vtu --report ${WORK}/report.html
  OUTPUT_VARIABLE summary
  COMMAND_ERROR_IS_FATAL ANY)
if(NOT summary MATCHES "\nReport +${WORK}/report.html\n")
  message(FATAL_ERROR "the summary does not name the report:\n${summary}")
endif()
set(page ${WORK}/report.html)
if(BREAK)
  set(page ${WORK}/broken.html)
  file(READ ${WORK}/report.html text)
  string(REPLACE "</body>" "<script>throw new Error('broken')</script></body>" text "${text}")
  file(WRITE ${page} "${text}")
endif()

execute_process(COMMAND ${NODE} page_test.mjs ${page} ${BROWSER} ${SCREENSHOTS}
  WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(BREAK)
  if(NOT failed OR NOT output MATCHES "page error: broken")
    message(FATAL_ERROR "an error in the page went unnoticed:\n${output}")
  endif()
elseif(failed)
  message(FATAL_ERROR "the page does not work:\n${output}")
else()
  file(REMOVE_RECURSE ${WORK}/many)
  execute_process(
    COMMAND ${PROGRAM} batch ${bore}/base.step ${bore}/hex.vtu ${bore}/step20.step ${bore}/step05.step
      ${MODELS}/pipe/base.step -o ${WORK}/many --report ${WORK}/overview.html
    RESULT_VARIABLE code OUTPUT_QUIET ERROR_VARIABLE errors)
  if(NOT code EQUAL 8)
    message(FATAL_ERROR "exit code ${code} of a batch with one bad variant:\n${errors}")
  endif()
  execute_process(COMMAND ${NODE} overview_test.mjs ${WORK}/overview.html ${BROWSER}
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(failed)
    message(FATAL_ERROR "the overview does not work:\n${output}")
  endif()
  set(ball ${MODELS}/shapes/sphere_far_field)
  execute_process(
    COMMAND ${PROGRAM} ${ball}.step ${ball}_variant.step ${ball}.vtu -o ${WORK}/ball.vtu
      --report ${WORK}/ball.html
    OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND ${NODE} body_test.mjs ${WORK}/ball.html ${BROWSER}
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(failed)
    message(FATAL_ERROR "the body in a far field is not seen:\n${output}")
  endif()
endif()
