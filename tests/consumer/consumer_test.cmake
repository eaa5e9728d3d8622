# Installs cadmorph below the build folder, then builds and runs the consumer against that alone.
set(consumer_dir ${PROJECT_BINARY_DIR}/consumer)
set(shapes ${PROJECT_SOURCE_DIR}/models/shapes)

add_test(NAME consumer.install
  COMMAND ${CMAKE_COMMAND} --install ${PROJECT_BINARY_DIR} --prefix ${consumer_dir}/prefix
    --config $<CONFIG>)
set_tests_properties(consumer.install PROPERTIES FIXTURES_SETUP installed_cadmorph)

add_test(NAME consumer.build_and_run
  COMMAND ${CMAKE_CTEST_COMMAND}
    --build-and-test ${PROJECT_SOURCE_DIR}/tests/consumer ${consumer_dir}/build
    --build-generator ${CMAKE_GENERATOR}
    --build-options
      -DCMAKE_BUILD_TYPE=$<CONFIG> -DCMAKE_PREFIX_PATH=${consumer_dir}/prefix
      -DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER} "-DCMAKE_CXX_FLAGS=${CMAKE_CXX_FLAGS}"
    --test-command consumer ${shapes}/box.step ${shapes}/box.step ${shapes}/box.vtu
      ${consumer_dir}/box.morphed.vtu)
set_tests_properties(consumer.build_and_run PROPERTIES
  FIXTURES_REQUIRED installed_cadmorph TIMEOUT 600)
