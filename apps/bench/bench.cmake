# cadmorph-bench: the comparison of methods, kernels and solvers of docs/evaluation.md.
add_executable(cadmorph-bench
  bench/evaluate.cpp
  bench/families.cpp
  bench/main.cpp
  bench/measure.cpp
  bench/results_file.cpp
  blas_restart.cpp
  text_table.cpp)
target_link_libraries(cadmorph-bench PRIVATE cadmorph::pipeline CLI11::CLI11)
cadmorph_warnings(cadmorph-bench)
