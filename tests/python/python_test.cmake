# The Python module, where it is built: a ctest for each file of tests.
if(NOT TARGET cadmorph_python)
  return()
endif()
# The real OpenMDAO, and files of others, where their folders are named: CADMORPH_OPENMDAO,
# CADMORPH_FORMATS.
foreach(subject mesh morpher derivative bad_arguments stubs memory picture freecad optimisation
    independent_readers pip)
  add_test(NAME python.${subject}
    COMMAND ${Python_EXECUTABLE} -m unittest --verbose ${subject}_test
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/python)
  set_tests_properties(python.${subject} PROPERTIES TIMEOUT 600
    ENVIRONMENT "PYTHONPATH=$<TARGET_FILE_DIR:cadmorph_python>/..:$ENV{CADMORPH_OPENMDAO};PYTHONDONTWRITEBYTECODE=1;OPENMDAO_REPORTS=0;CADMORPH_MODELS=${PROJECT_SOURCE_DIR}/models;CADMORPH_PROGRAM=$<TARGET_FILE:cadmorph>")
endforeach()
