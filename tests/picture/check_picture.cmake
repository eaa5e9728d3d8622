# Runs PROGRAM on MESH with no DISPLAY, and checks its exit code and PICTURE. REFUSED: there is no
# Xvfb or no folder for PICTURE.
file(REMOVE ${PICTURE})
unset(ENV{DISPLAY})
if(REFUSED)
  set(ENV{PATH} /nonexistent)
endif()
execute_process(COMMAND ${PROGRAM} ${MESH} ${MESH} ${PICTURE} RESULT_VARIABLE code)

if(REFUSED)
  if(NOT code EQUAL 6 OR EXISTS ${PICTURE})
    message(FATAL_ERROR "exit code ${code}, or a picture; expected 6 and none")
  endif()
  return()
endif()

if(NOT code EQUAL 0)
  message(FATAL_ERROR "exit code ${code}, expected 0")
endif()
file(READ ${PICTURE} header OFFSET 16 LIMIT 8 HEX) # width and height of the PNG's first chunk
if(NOT header STREQUAL "00000640000004b0")
  message(FATAL_ERROR "the picture is not 1600 x 1200: ${header}")
endif()
file(SIZE ${PICTURE} bytes)
if(bytes LESS 100000) # a white picture takes 10,000 bytes, meshes with their edges 300,000
  message(FATAL_ERROR "the picture is nearly empty: ${bytes} bytes")
endif()
