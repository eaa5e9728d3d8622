#pragma once

#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "apps/bench/families.h"

namespace cadmorph::bench {

/// A way to move the nodes inside.
enum class Contender { Rbf, RbfIqr, Default, Femwarp, Lbwarp, SimplexLinear };

/// Names as in the results; the RBF warp on its own surface morph is the paper's RBF-S.
std::string to_string(Contender contender, Surface surface);
std::string to_string(Surface surface);
std::string to_string(Mode mode);

struct EvaluateOptions {
  std::filesystem::path models, output;
  std::set<std::string> families, meshes, surfaces, modes, methods;  ///< empty: all
  int stride = 1;  ///< absolute: every so many steps alone
  /// Told of each series before it runs.
  std::function<void(const std::string&)> tell;
};

/// The subjects that the options choose. Throws IoError when there is none.
std::vector<Subject> chosen_subjects(const EvaluateOptions& options);

/// Morphs every mesh of every family to steps 1 .. kSteps by every method, absolutely and
/// relatively, and appends a row a step to the CSV file `output`, series by series. Series that the
/// file holds already are not run again. A method that can't go on ends its series with a row that
/// says why.
void evaluate(const EvaluateOptions& options);

}  // namespace cadmorph::bench
