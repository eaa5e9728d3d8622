# The scripts of docs/schedulers under the schedulers themselves, where these are installed.
foreach(scheduler slurm snakemake dakota)
  add_test(NAME schedulers.${scheduler}
    COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/schedulers/${scheduler}_test.sh $<TARGET_FILE_DIR:cadmorph>)
  set_tests_properties(schedulers.${scheduler} PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 900)
endforeach()
