#pragma once

#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "apps/bench/families.h"

namespace cadmorph::bench {

/// A way to move a mesh, as the figures name it.
enum class Contender { RbfS, RbfIqr, Default, Femwarp, Lbwarp, SimplexLinear };

/// Names as in the results: RBF-S, RBF-IQR, default, FEMWARP, LBWARP, simplex-linear.
std::string to_string(Contender contender);
std::string to_string(Mode mode);

/// What can be evaluated in this build.
std::vector<Contender> all_contenders();

struct EvaluateOptions {
  std::filesystem::path models, output;
  std::set<std::string> families, meshes, methods;  ///< empty: all
  /// Told of each series before it runs.
  std::function<void(const std::string&)> tell;
};

/// Morphs every mesh of every family to steps 1 .. kSteps by every method, absolutely and
/// relatively, and appends a row a step to the CSV file `output`, series by series. Series that the
/// file holds already are not run again. A method that can't go on ends its series with a row that
/// says why.
void evaluate(const EvaluateOptions& options);

}  // namespace cadmorph::bench
