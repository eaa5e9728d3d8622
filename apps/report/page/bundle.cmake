# Bundles the page's script with the packages of package-lock.json. Where the packages can't be
# fetched, SCRIPT and LICENCES are not made, so that the next build tries again; with REQUIRED, the
# build fails.
# cmake -DNPM=... -DNODE=... -DFOLDER=<apps/report/page> -DWORK=... -DSCRIPT=... -DLICENCES=... -P ...
cmake_minimum_required(VERSION 3.25)

file(GLOB sources ${FOLDER}/*.js ${FOLDER}/*.mjs ${FOLDER}/*.json)
file(COPY ${sources} DESTINATION ${WORK})
execute_process(COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline
    --fetch-retries=1
  WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(NOT failed)
  execute_process(COMMAND ${NODE} build.mjs ${SCRIPT} ${LICENCES}
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
endif()
if(failed AND REQUIRED)
  message(FATAL_ERROR "the report's 3D view can't be built:\n${output}")
elseif(failed)
  message(WARNING "reports will have no 3D view, for it can't be built "
    "(-DCADMORPH_REPORT_VIEWER=OFF leaves it out for good):\n${output}")
  file(REMOVE ${SCRIPT} ${LICENCES})
endif()
