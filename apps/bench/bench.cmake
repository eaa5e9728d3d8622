# cadmorph-bench: the comparison of methods, kernels and solvers of docs/evaluation.md.

# The reference LAPACK and BLAS, loaded in OpenBLAS's place by the comparison of solvers.
find_library(CADMORPH_NETLIB_LAPACK NAMES liblapack.so.3
  PATH_SUFFIXES ${CMAKE_LIBRARY_ARCHITECTURE}/lapack PATHS /usr/lib NO_DEFAULT_PATH)
find_library(CADMORPH_NETLIB_BLAS NAMES libblas.so.3
  PATH_SUFFIXES ${CMAKE_LIBRARY_ARCHITECTURE}/blas PATHS /usr/lib NO_DEFAULT_PATH)

add_executable(cadmorph-bench
  bench/demonstrations.cpp
  bench/evaluate.cpp
  bench/families.cpp
  bench/given_surface.cpp
  bench/kernels.cpp
  bench/main.cpp
  bench/measure.cpp
  bench/rbf_warps.cpp
  bench/results_file.cpp
  bench/solvers.cpp
  summary/text_table.cpp)
target_link_libraries(cadmorph-bench PRIVATE cadmorph::pipeline CLI11::CLI11)
target_compile_definitions(cadmorph-bench PRIVATE
  CADMORPH_NETLIB_LAPACK="${CADMORPH_NETLIB_LAPACK}" CADMORPH_NETLIB_BLAS="${CADMORPH_NETLIB_BLAS}")
cadmorph_warnings(cadmorph-bench)
cadmorph_precompile(cadmorph-bench)
