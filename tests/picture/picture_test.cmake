# cadmorph-picture draws without a display, and says so where it can't.
set(shapes ${PROJECT_SOURCE_DIR}/models/shapes)

add_test(NAME picture.draws_without_display
  COMMAND ${CMAKE_COMMAND}
    -DPROGRAM=$<TARGET_FILE:cadmorph-picture> -DMESH=${shapes}/torus.vtu
    -DPICTURE=${CMAKE_CURRENT_BINARY_DIR}/torus.png
    -P ${CMAKE_CURRENT_SOURCE_DIR}/picture/check_picture.cmake)

add_test(NAME picture.tells_of_missing_display
  COMMAND ${CMAKE_COMMAND}
    -DPROGRAM=$<TARGET_FILE:cadmorph-picture> -DMESH=${shapes}/torus.vtu
    -DPICTURE=${CMAKE_CURRENT_BINARY_DIR}/none.png -DREFUSED=ON
    -P ${CMAKE_CURRENT_SOURCE_DIR}/picture/check_picture.cmake)

add_test(NAME picture.tells_of_missing_folder
  COMMAND ${CMAKE_COMMAND}
    -DPROGRAM=$<TARGET_FILE:cadmorph-picture> -DMESH=${shapes}/torus.vtu
    -DPICTURE=${CMAKE_CURRENT_BINARY_DIR}/nowhere/none.png -DREFUSED=ON
    -P ${CMAKE_CURRENT_SOURCE_DIR}/picture/check_picture.cmake)
