# The small models morph as they did: see models/reference/README.md.
set(models ${PROJECT_SOURCE_DIR}/models)
file(STRINGS ${models}/reference/morphs.csv morphs REGEX ".vtu$")
foreach(morph ${morphs})
  string(REPLACE "," ";" morph ${morph})
  list(GET morph 0 name)
  list(GET morph 1 base)
  list(GET morph 2 variant)
  list(GET morph 3 mesh)
  add_test(NAME regression.${name}
    COMMAND ${CMAKE_COMMAND}
      -DPROGRAM=$<TARGET_FILE:cadmorph> -DTOLERANCE=1e-6
      -DBASE=${models}/${base} -DVARIANT=${models}/${variant} -DMESH=${models}/${mesh}
      -DREFERENCE=${models}/reference/${name}.vtu
      -DOUTPUT=${CMAKE_CURRENT_BINARY_DIR}/${name}.vtu
      -P ${CMAKE_CURRENT_SOURCE_DIR}/regression/check_morph.cmake)
endforeach()
