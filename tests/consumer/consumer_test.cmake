# Installs cadmorph below the build folder, then builds and runs the consumer against that alone.
set(consumer_dir ${PROJECT_BINARY_DIR}/consumer)
set(shapes ${PROJECT_SOURCE_DIR}/models/shapes)

add_test(NAME consumer.install
  COMMAND ${CMAKE_COMMAND} --install ${PROJECT_BINARY_DIR} --prefix ${consumer_dir}/prefix
    --config $<CONFIG>)
set_tests_properties(consumer.install PROPERTIES FIXTURES_SETUP installed_cadmorph)

# Each header stands for itself, and there is no other.
add_test(NAME consumer.headers
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/consumer/headers_test.sh
    ${consumer_dir}/prefix/${CMAKE_INSTALL_INCLUDEDIR} ${CMAKE_CXX_COMPILER}
    $<TARGET_PROPERTY:Eigen3::Eigen,INTERFACE_INCLUDE_DIRECTORIES>)
set_tests_properties(consumer.headers PROPERTIES FIXTURES_REQUIRED installed_cadmorph)

function(add_consumer_test name)
  add_test(NAME consumer.${name}
    COMMAND ${CMAKE_CTEST_COMMAND}
      --build-and-test ${PROJECT_SOURCE_DIR}/tests/consumer ${consumer_dir}/${name}
      --build-generator ${CMAKE_GENERATOR}
      --build-options
        -DCMAKE_BUILD_TYPE=$<CONFIG> -DCMAKE_PREFIX_PATH=${consumer_dir}/prefix
        -DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER} "-DCMAKE_CXX_FLAGS=${CMAKE_CXX_FLAGS}" ${ARGN}
      --test-command consumer ${shapes}/box.step ${shapes}/box_variant.step ${shapes}/box.vtu
        ${consumer_dir}/${name}.vtu)
  set_tests_properties(consumer.${name} PROPERTIES
    FIXTURES_REQUIRED installed_cadmorph TIMEOUT 600)
endfunction()

add_consumer_test(build_and_run)
find_program(PKG_CONFIG pkg-config)
if(PKG_CONFIG)
  add_consumer_test(build_and_run_with_pkg_config -DWITH_PKG_CONFIG=ON)
endif()
