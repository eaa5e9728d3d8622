#pragma once

#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "apps/bench/families.h"

namespace cadmorph::bench {

/// A way to move the nodes inside.
enum class Contender {
  Rbf,           ///< triharmonic
  Biharmonic,    ///< RBF by another kernel
  Quadharmonic,  ///< RBF by another kernel
  RbfIqr,
  Plain,    ///< the whole pipeline, no element raised (`--quality fast`)
  Default,  ///< the whole pipeline
  Femwarp,
  Lbwarp,
  SimplexLinear
};

/// Names as in the results; the RBF warp on its own surface morph is the paper's RBF-S.
std::string to_string(Contender contender, Surface surface);
std::string to_string(Surface surface);
std::string to_string(Mode mode);

struct EvaluateOptions {
  std::filesystem::path models, output;
  std::set<std::string> families, meshes, surfaces, modes, methods;  ///< empty: all
  int stride = 1;     ///< absolute, and the default on relative routes: every so many steps alone
  int last = kSteps;  ///< steps 1 to this one
  /// Told of each series before it runs.
  std::function<void(const std::string&)> tell;
};

/// The subjects that the options choose. Throws IoError when there is none.
std::vector<Subject> chosen_subjects(const EvaluateOptions& options);

/// Morphs every mesh of every family to steps 1 .. `last` by every method, absolutely and
/// relatively, and appends a row a step to the CSV file `output`, series by series. Series that the
/// file holds already are not run again. A method that can't go on ends its series with a row that
/// says why.
void evaluate(const EvaluateOptions& options);

}  // namespace cadmorph::bench
