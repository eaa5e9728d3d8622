// Prints how many pairs of the corpus are matched as known, by the class of their rows:
// match_score [-v] [TEXT]: only rows with this text in them. -v names the wrong rows.

#include <cstdio>
#include <cstring>
#include <map>
#include <string>

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
    int right = 0, all = 0;
    double seconds = 0;
  };
  std::map<std::string, Score> scores;
  Score sum;
  for (const KnownPair& row : known_pairs()) {
    if (to_string(row).find(text) == std::string::npos) continue;
    const MadePair pair = make(row);
    const Stopwatch watch;
    const std::string wrong = outcome(pair);
    const double seconds = watch.seconds();
    if (is_verbose && !wrong.empty())
      std::printf("%s\n    %s\n", to_string(row).c_str(), wrong.c_str());
    for (Score* score : {&scores[class_of(row)], &sum}) {
      score->right += wrong.empty();
      ++score->all;
      score->seconds += seconds;
    }
  }
  for (const auto& [name, score] : scores)
    std::printf("%-28s %4d of %4d right  %7.2f s\n", name.c_str(), score.right, score.all,
                score.seconds);
  std::printf("%-28s %4d of %4d right  %7.2f s\n", "all", sum.right, sum.all, sum.seconds);
  return 0;
}
