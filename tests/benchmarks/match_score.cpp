// Prints how many pairs of the corpus are matched as known, and of how many of these the runner-up
// costs less than a bit more, by the class of their rows:
// match_score [-v] [TEXT]: only rows with this text in them. -v names the wrong rows, and the
// others with their lead where that is less than a bit.

#include <cstdio>
#include <cstring>
#include <map>
#include <string>

#include "core/errors.h"
#include "core/stopwatch.h"
#include "known_pairs.h"

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

std::string class_of(const KnownPair& row) {
  const std::string change = row.change;
  const auto has = [&](const char* word) { return change.find(word) != std::string::npos; };
  if (change.empty()) return "written otherwise";
  if (has("mirror") || has("sheared") || has("bent")) return "mirrored, sheared or bent";
  if (has("turn") || has("move") || has("scale") || has("spin")) return "moved as a whole";
  if (has("seam")) return "seams elsewhere";
  if (has("first")) return "features in another order";
  return change.find(' ') == change.rfind(' ') ? "one dimension" : "several dimensions";
}

}  // namespace

int main(int count, char** words) {
  const bool is_verbose = count > 1 && std::strcmp(words[1], "-v") == 0;
  const std::string text = count > 1 + is_verbose ? words[1 + is_verbose] : "";
  struct Score {
    int right = 0, unclear = 0, all = 0;
    double seconds = 0;
  };
  std::map<std::string, Score> scores;
  Score sum;
  for (const KnownPair& row : known_pairs()) {
    if (to_string(row).find(text) == std::string::npos) continue;
    const MadePair pair = make(row);
    const Stopwatch watch;
    std::string wrong;
    double ahead = 0;
    try {
      const MatchedModels matched = match_models(pair.base.model, pair.variant.model);
      wrong = judge(pair, matched);
      ahead = lead(matched.match);
    } catch (const TopologyError& error) {
      wrong = error.what();
    }
    const double seconds = watch.seconds();
    const bool is_unclear = wrong.empty() && ahead < 1;
    if (is_verbose && !wrong.empty())
      std::printf("%s\n    %s\n", to_string(row).c_str(), wrong.c_str());
    if (is_verbose && is_unclear)
      std::printf("%s\n    ahead by %.2f bits\n", to_string(row).c_str(), ahead);
    for (Score* score : {&scores[class_of(row)], &sum}) {
      score->right += wrong.empty();
      score->unclear += is_unclear;
      ++score->all;
      score->seconds += seconds;
    }
  }
  for (const auto& [name, score] : scores)
    std::printf("%-28s %4d of %4d right, %3d hardly  %7.2f s\n", name.c_str(), score.right,
                score.all, score.unclear, score.seconds);
  std::printf("%-28s %4d of %4d right, %3d hardly  %7.2f s\n", "all", sum.right, sum.all,
              sum.unclear, sum.seconds);
  return 0;
}
