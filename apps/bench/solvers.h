#pragma once

#include "apps/bench/evaluate.h"

namespace cadmorph::bench {

/// Morphs every mesh to its full change with each solver of the RBF system, each in a process of
/// its own, so that its memory can be told and the reference LAPACK can take OpenBLAS's place, and
/// appends a row each to the CSV file (Sieger et al. 2013, Table 3). `program`: the name those
/// processes go by.
void compare_solvers(const EvaluateOptions& options, const std::string& program);

/// The work of such a process: one solver, named as in the CSV, on the one mesh that the options
/// choose.
void run_solver(const EvaluateOptions& options, const std::string& solver);

}  // namespace cadmorph::bench
